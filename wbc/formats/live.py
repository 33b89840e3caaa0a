"""Runs over a WebSocket, as Foxglove connects to."""

from __future__ import annotations

import pathlib
import time
from typing import Any

from wbc.formats.errors import FormatError
from wbc.formats.messages import NANO, SCENE, MessageSink

#: Port that Foxglove proposes
PORT = 8765


class FoxgloveSink(MessageSink):
    """A server on this machine, which plays a run at the speed at which it was, or as it is written.

    Attributes:
        port: where it listens.

    Args:
        path: ``HOST:PORT``, or nothing for 127.0.0.1 and port 8765.

    Raises:
        FormatError: the address cannot be served on.
    """

    needs = ("foxglove", "a connection for Foxglove")

    def __init__(self, path: pathlib.Path) -> None:
        import foxglove

        host, _, port = ("" if path == pathlib.Path() else str(path)).rpartition(":")
        if (host or port) and not port.isdigit():
            raise FormatError("address", str(path), "expected HOST:PORT")

        class LateListener(foxglove.websocket.ServerListener):  # type: ignore[misc]  # without the package it is Any
            """Who comes later is given what was said once."""

            def on_subscribe(listener, client: Any, channel: Any) -> None:
                if channel.topic == SCENE:
                    self._put(*self._still)

        self._channels, self._context, self._began = dict[str, Any](), foxglove.Context(), 0.0
        served = {"host": host or "127.0.0.1", "port": int(port or PORT), "server_listener": LateListener()}
        try:
            self._server = foxglove.start_server(name="wbc", context=self._context, **served)
        except (RuntimeError, OSError) as error:
            raise FormatError("address", str(path), f"cannot be served on: {error}") from error
        self.port = int(self._server.port)

    def _open(self, topic: str, schema: dict[str, Any]) -> None:
        from foxglove import Channel

        self._channels[topic] = Channel(topic, schema=schema, context=self._context)

    def _put(self, topic: str, when: int, data: dict[str, Any]) -> None:
        if topic != SCENE:
            self._began = self._began or time.monotonic() - when / NANO
            time.sleep(max(0.0, self._began + when / NANO - time.monotonic()))
        self._channels[topic].log(data, log_time=when)

    def close(self) -> None:
        self._server.stop()
