"""The same messages over ZeroMQ: each peer of a ROUTER socket becomes a client of the page's server.

So every rule holds here as well: one operates, others watch, and who is silent is lost. ZeroMQ does not say when a peer
is gone; one that was silent for so long as the server waits for an operator is dropped.
"""

from __future__ import annotations

import asyncio
import importlib
import threading
import time
from typing import Any

from wbc import extras
from wbc.viewer.errors import ViewerError, require_local

#: Between two looks for peers that are gone [s]
LOOK = 0.1


class ZeroMqEnd:
    """Serves a ROUTER socket beside a page's server, in a thread of its own.

    Args:
        address: such as ``tcp://127.0.0.1:5555``; of this machine alone, as ZeroMQ asks for no token here.
        page: address of the page. silence: after which a peer is dropped [s].

    Raises:
        MissingPackageError: pyzmq is not installed.
        ViewerError: the address is not this machine's, or it cannot be listened on.
    """

    def __init__(self, address: str, page: str, silence: float) -> None:
        require_local(address)
        extras.require("zeromq", "a ZeroMQ socket")
        # pyzmq has no types where it is not installed
        self._zmq: Any = importlib.import_module("zmq")
        self._asyncio: Any = importlib.import_module("zmq.asyncio")
        self._address, self._silence = address, silence
        self._page = page.replace("http", "ws", 1).partition("?")[0] + "wbc/"
        self._peers: dict[bytes, tuple[asyncio.Task[None], asyncio.Queue[str]]] = {}
        self._heard: dict[bytes, float] = {}
        self._problem, ready = "", threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve(ready)), name="zeromq", daemon=True)
        self._thread.start()
        ready.wait()
        if self._problem:
            raise ViewerError("zeromq", address, f"cannot be listened on: {self._problem}")

    async def _serve(self, ready: threading.Event) -> None:
        with self._asyncio.Context() as context:
            socket = context.socket(self._zmq.ROUTER)
            socket.linger = 0
            try:
                socket.bind(self._address)
            except self._zmq.ZMQError as error:
                self._problem = str(error)
                return
            finally:
                ready.set()
            while True:
                if await socket.poll(1e3 * LOOK):
                    identity, *rest = await socket.recv_multipart()
                    self._heard[identity] = time.monotonic()
                    if identity not in self._peers:
                        queue: asyncio.Queue[str] = asyncio.Queue()
                        self._peers[identity] = asyncio.create_task(self._relay(socket, identity, queue)), queue
                    self._peers[identity][1].put_nowait(b"".join(rest).decode("utf-8", "replace"))
                for identity, when in list(self._heard.items()):
                    if time.monotonic() - when > self._silence:
                        self._peers.pop(identity)[0].cancel()
                        del self._heard[identity]

    async def _relay(self, socket: Any, identity: bytes, queue: asyncio.Queue[str]) -> None:
        """One peer's messages to the server and back."""
        from websockets.asyncio.client import connect

        async with connect(f"{self._page}zeromq-{identity.hex()}", max_size=None) as link:

            async def back() -> None:
                async for text in link:
                    await socket.send_multipart([identity, text.encode() if isinstance(text, str) else text])

            returning = asyncio.create_task(back())
            try:
                while True:
                    await link.send(await queue.get())
            finally:
                returning.cancel()
