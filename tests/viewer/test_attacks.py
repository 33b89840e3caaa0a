"""Clients that mean no good, or are only slow: others are served on, and the loop is told nothing that does not fit."""

from __future__ import annotations

import contextlib
import json
import random
import socket
import time
from collections.abc import Iterator

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from tests.viewer import arms, clients
from tests.viewer.clients import client, heard
from wbc.errors import WbcError
from wbc.viewer.link import LoopEnd
from wbc.viewer.messages import LONGEST, OBEYED, SERVED, read, write
from wbc.viewer.operation import Operation
from wbc.viewer.session import Session

#: Values in place of those that a message should have
WRONG = (
    None,
    True,
    -1,
    1e308,
    float("nan"),
    "",
    "hand",
    "1,2",
    [],
    [1, 2, 3],
    [[0]] * 6,
    {},
    {"target": [1] * 7},
    {"x": 1},
)


@pytest.fixture(scope="module")
def served() -> Iterator[tuple[Session, LoopEnd]]:
    loop = LoopEnd(arms.state_size())
    with clients.served(loop, 2, silence=5.0) as session:
        yield session, loop


def gone(session: Session) -> None:
    """Wait until nobody is connected."""
    until = time.monotonic() + 10.0
    while session.server.watchers:
        assert time.monotonic() < until
        time.sleep(0.01)


def test_messages_of_any_content_raise_typed_errors_and_nothing_bad_reaches_the_loop(
    served: tuple[Session, LoopEnd],
) -> None:
    session, loop = served
    controller, chance = arms.fresh(), random.Random(0)
    operation, q = Operation(controller), controller.stack.robot.neutral
    passed = 0
    for _ in range(400):
        kind = chance.choice([name for name in (*OBEYED, *SERVED) if name != "alive"])
        fields = {name: chance.choice(WRONG) for name in (OBEYED | SERVED)[kind]}
        message = {"type": kind, "wbc": chance.choice((1, 1, 1, 2, "1"))} | fields
        with contextlib.suppress(WbcError):
            session._obey(read(json.dumps(message)))
        for content in loop.take():
            passed += 1
            operation.resume()
            # What passed the viewer does fit the controller
            operation.obey(read(content))
            operation.advance(0.01)
    assert passed > 10
    operation.resume()
    step = controller.step(q)
    assert abs(step.v).max() < 10.0
    session._obey({"type": "live"})
    session._obey({"type": "show", "what": "reach", "on": False})


def test_a_storm_of_connections_and_of_noise_leaves_nothing(served: tuple[Session, LoopEnd]) -> None:
    session, _ = served
    port = session.server.server.get_port()
    for k in range(30):
        with socket.create_connection(("127.0.0.1", port)) as raw:
            raw.sendall((b"", b"GET / HTTP/1.1\r\nHost", bytes(range(256)), b"\r\n\r\n")[k % 4])
        with client(session, f"page{k % 3}") as page:
            page.send(("", "[]", "{" * 1000, '{"type": "set"}', "x" * (LONGEST + 1))[k % 5])
            if k % 2:
                page.socket.close()
    gone(session)
    with client(session) as page:
        assert heard(page, "hello")["robot"] == "panda"
        heard(page, "state")


def test_a_name_that_somebody_has_is_not_given_twice(served: tuple[Session, LoopEnd]) -> None:
    session, loop = served
    with client(session, "captain") as one, client(session, "captain") as two:
        assert heard(one, "hello")["you"] == "captain"
        assert heard(two, "hello")["you"] != "captain"
        one.send('{"type": "operate"}')
        assert heard(two, "operator")["name"] == "captain"
        two.send('{"type": "resume"}')
        assert "watch" in heard(two, "refused")["reason"]
        two.close()
        one.send('{"type": "release"}')
        assert heard(one, "operator")["name"] == "captain"
        assert heard(one, "operator")["name"] == ""
    gone(session)
    assert [read(content)["type"] for content in loop.take()] == ["operate", "release"]


def test_a_client_that_does_not_read_is_left_out_and_holds_nobody_up(served: tuple[Session, LoopEnd]) -> None:
    session, _ = served
    slow = connect(session.url.replace("http", "ws") + "wbc/slow", max_size=None, max_queue=1)
    until = time.monotonic() + 10.0
    while session.server.watchers < 1:
        assert time.monotonic() < until
    with client(session, "quick") as quick:
        # 700 states are 14 MB; the slow one has what its sockets hold, and one frame more
        big = {"type": "state", "number": -1, "text": "x" * 20_000}
        seen = 0
        for _ in range(700):
            session.server.publish(big)
            with contextlib.suppress(TimeoutError, ConnectionClosed):
                seen += '"number":-1' in str(quick.recv(timeout=1.0))
        assert seen > 500
        waits = session.server._clients["slow"].connection.transport.get_write_buffer_size()
        assert waits <= 2 * len(write(big))
    slow.socket.close()
    gone(session)
