"""What connects to a session as a page does, and waits for messages of a kind."""

from __future__ import annotations

import json
import time
from typing import Any

from websockets.sync.client import ClientConnection, connect

from wbc.viewer.session import Session


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
