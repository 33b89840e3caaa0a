"""Runs over a WebSocket, as Foxglove connects to."""

from __future__ import annotations

import pathlib
import time
from typing import Any

from wbc.formats.errors import FormatError
from wbc.formats.messages import NANO, Message, MessageSink

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
        self._foxglove, self._channels, self._bodies = foxglove, dict[str, Any](), list[Message]()
        self._context = foxglove.Context()
        self._began: float | None = None

        class LateListener(foxglove.websocket.ServerListener):  # type: ignore[misc]  # without the package it is Any
            """Who comes later is given what was said once."""

            def on_subscribe(listener, client: Any, channel: Any) -> None:
                for message in self._bodies:
                    if message.topic == channel.topic:
                        self._put(message)

        served = {"host": host or "127.0.0.1", "port": int(port or PORT), "context": self._context}
        try:
            self._server = foxglove.start_server(name="wbc", **served, server_listener=LateListener())
        except (RuntimeError, OSError) as error:
            raise FormatError("address", str(path), f"cannot be served on: {error}") from error
        self.port = int(self._server.port)

    def _open(self, topic: str, schema: dict[str, Any]) -> None:
        self._channels[topic] = self._foxglove.Channel(topic, schema=schema, context=self._context)

    def _say(self, message: Message) -> None:
        seconds = message.time / NANO
        if self._began is None:
            self._began = time.monotonic() - seconds
        time.sleep(max(0.0, self._began + seconds - time.monotonic()))
        self._put(message)

    def _put(self, message: Message) -> None:
        self._channels[message.topic].log(message.data, log_time=message.time)

    def close(self) -> None:
        self._server.stop()
