"""A session without a browser: what clients are told, who operates, and what happens when they are gone."""

from __future__ import annotations

import contextlib
import json
import runpy
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect

from tests.viewer import arms, clients
from tests.viewer.clients import client, heard
from wbc.viewer import ViewerError, server
from wbc.viewer.link import LoopEnd
from wbc.viewer.messages import read
from wbc.viewer.session import Session


class Loop:
    """A loop's end that keeps what it was told."""

    def __init__(self) -> None:
        self.end = LoopEnd(arms.state_size())
        self.told: list[dict[str, Any]] = []

    def take(self, kind: str) -> dict[str, Any]:
        """Wait for a message."""
        until = time.monotonic() + 10.0
        while time.monotonic() < until:
            self.told += [read(content) for content in self.end.take()]
            for message in self.told:
                if message["type"] == kind:
                    self.told.remove(message)
                    return message
            time.sleep(0.01)
        raise AssertionError(f"no {kind} came, only {self.told}")


@pytest.fixture(scope="module")
def served() -> Iterator[tuple[Session, Loop]]:
    loop = Loop()
    with clients.served(loop.end, 3) as session:
        yield session, loop


def send(socket: ClientConnection, **message: Any) -> None:
    socket.send(json.dumps(message))


def status(address: str) -> int:
    """Code of the answer to a request."""
    try:
        with urllib.request.urlopen(address) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        return error.code


def test_clients_are_told_what_there_is_and_then_states(served: tuple[Session, Loop]) -> None:
    session, _ = served
    with client(session) as one:
        hello = heard(one, "hello")
        assert (hello["wbc"], hello["robot"], len(hello["joints"])) == (1, "panda", 7)
        assert [item["name"] for item in hello["items"]] == ["hand", "posture", "limits", "ball"]
        state = heard(one, "state")
        assert state["number"] == 3
        assert set(state["items"]["hand"]["residual"]) == {"m", "rad"}
        assert state["items"]["hand"]["values"]["weight"] == pytest.approx(1.0)
        assert state["items"]["ball"]["margin"] > 0.0
        assert len(state["q"]) == 7


def test_one_operates_and_others_watch(served: tuple[Session, Loop]) -> None:
    session, loop = served
    with client(session, "one") as one, client(session, "two") as two:
        send(two, type="set", item="hand", values={"weight": 2.0})
        assert "watch" in heard(two, "refused")["reason"]
        send(one, type="operate")
        assert heard(two, "operator")["name"] == "one"
        loop.take("operate")
        send(two, type="operate")
        assert "somebody else" in heard(two, "refused")["reason"]
        send(one, type="set", item="hand", values={"weight": 2.0})
        assert loop.take("set")["values"] == {"weight": 2.0}
        send(one, type="set", item="hand", values={"weight": -2.0})
        assert "hand.weight" in heard(one, "refused")["reason"]
        one.send("nonsense")
        assert "JSON" in heard(one, "refused")["reason"]
        # Whoever watches may stop
        send(two, type="stop", reason="look out")
        assert loop.take("stop")["reason"] == "look out"
        send(one, type="release")
        loop.take("release")
        send(two, type="operate")
        loop.take("operate")
        send(two, type="release")
        loop.take("release")


def test_a_lost_operator_is_a_stop(served: tuple[Session, Loop]) -> None:
    session, loop = served
    with client(session, "gone") as one:
        send(one, type="operate")
        loop.take("operate")
    assert "lost" in loop.take("stop")["reason"]
    loop.take("release")
    # One whose connection stands but that is silent is lost as well
    with client(session, "silent") as one:
        send(one, type="operate")
        loop.take("operate")
        assert "lost" in loop.take("stop")["reason"]
        loop.take("release")


def test_the_past_is_shown_and_not_changed(served: tuple[Session, Loop]) -> None:
    session, loop = served
    with client(session, "looks") as one:
        send(one, type="operate")
        loop.take("operate")
        send(one, type="seek", time=0.0)
        while heard(one, "state")["timeline"]["live"]:
            pass
        send(one, type="set", item="hand", values={"weight": 2.0})
        assert "past" in heard(one, "refused")["reason"]
        send(one, type="live")
        send(one, type="release")
        loop.take("release")


def test_foreign_pages_and_unknown_paths_are_refused(served: tuple[Session, Loop]) -> None:
    session, _ = served
    address = session.url.replace("http", "ws")
    for path in ("wbc", "scene/some"):
        with pytest.raises(InvalidStatus) as caught, connect(address + path, origin="http://evil.example"):
            pass
        assert caught.value.response.status_code == 403
    with pytest.raises(InvalidStatus) as caught, connect(address + "other"):
        pass
    assert caught.value.response.status_code == 404
    for path, code in (("", 200), ("viewer.js", 200), ("scene/x", 200), ("../gate.py", 404), ("x/../gate.py", 404)):
        assert status(session.url + path) == code, path


def test_a_drag_of_who_does_not_operate_does_nothing(served: tuple[Session, Loop]) -> None:
    session, loop = served
    tick = session._tick
    assert tick is not None
    pose = tick.world_pose("hand", "target")
    assert pose is not None
    for number in (None, 0, 12345):
        session._dragged("hand", "target", pose, "update", number)
    assert list(loop.end.take()) == []


def test_a_script_drives_by_rates(
    served: tuple[Session, Loop], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    session, loop = served
    script = Path(__file__).parents[2] / "examples" / "remote" / "over_websocket.py"
    monkeypatch.setattr("sys.argv", [script.name, session.url.replace("http", "ws") + "wbc", "0.7"])
    runpy.run_path(str(script), run_name="__main__")
    assert [loop.take(kind)["type"] for kind in ("operate", "rate", "release")] == ["operate", "rate", "release"]
    assert "panda: driving hand\nsolved, hand " in capsys.readouterr().out
    assert not [message for message in loop.told if message["type"] == "stop"]
    loop.told.clear()


def test_a_viser_that_cannot_be_guarded_is_not_served(monkeypatch: pytest.MonkeyPatch) -> None:
    # As where a version makes its sockets in another way
    monkeypatch.setattr(server, "_guarded", lambda *_: contextlib.nullcontext([]))
    with pytest.raises(ViewerError, match="foreign pages"):
        server.PageServer("127.0.0.1", 0, None, {}, lambda message: None)
