"""What connects to a session as a page does, and waits for messages of a kind."""

from __future__ import annotations

import contextlib
import json
import os
import threading
import time
from collections.abc import Iterator
from typing import Any

from websockets.sync.client import ClientConnection, connect

from tests.viewer import arms
from wbc.viewer.link import LoopEnd, ViewerEnd
from wbc.viewer.session import Session


@contextlib.contextmanager
def served(loop: LoopEnd, states: int, silence: float | None = None) -> Iterator[Session]:
    """A session of the arm in a thread, which has seen some states; at its end the loop's end is closed."""
    patience = {} if silence is None else {"silence": silence}
    session = Session(arms.shared().clone(), ViewerEnd(os.dup(loop.file), arms.state_size()), **patience)
    runner = threading.Thread(target=session.run)
    runner.start()
    for state in arms.states(states):
        loop.write(state.data, state.time)
    yield session
    session.ended.set()
    runner.join()
    loop.close()


def client(session: Session, name: str = "") -> ClientConnection:
    """A connection, closed as its context ends."""
    return connect(session.url.replace("http", "ws") + f"wbc/{name}", max_size=None)


def heard(link: ClientConnection, kind: str) -> dict[str, Any]:
    """The next message of a kind; others are passed over."""
    until = time.monotonic() + 10.0
    while time.monotonic() < until:
        message: dict[str, Any] = json.loads(link.recv(timeout=10.0))
        if message["type"] == kind:
            return message
    raise AssertionError(f"no {kind} came")
