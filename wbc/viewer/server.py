"""One port for all: the page, viser's scene in it, and the sockets of pages and other clients."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import http
import io
import itertools
import pathlib
import socket
import threading
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from wbc.errors import WbcError
from wbc.viewer import messages
from wbc.viewer.errors import LOOPBACK, ViewerError
from wbc.viewer.gate import Gate, answer

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response

#: An operator's page that was silent for so long is lost [s]
SILENT = 1.0
#: Time between two signs of life of a page [s]
BEAT = 0.1
FOLDER = pathlib.Path(__file__).parent / "page"
KINDS = {".html": "text/html", ".js": "text/javascript", ".css": "text/css"}
PAGE = ""
SCENE = "scene"
SOCKET = "wbc"


class Client:
    """A page, or another client of the message format.

    Attributes:
        name: its page's, or one of its own. heard: when it was heard last [s].
    """

    def __init__(self, name: str, connection: ServerConnection) -> None:
        self.name, self.connection = name, connection
        self.heard = time.monotonic()
        self._queue: list[str] = []
        self._wake = asyncio.Event()

    def tell(self, message: dict[str, Any]) -> None:
        """A message that must arrive."""
        self._queue.append(messages.write(message))
        self._wake.set()

    @property
    def free(self) -> bool:
        """What was sent to it is on its way, so that another state would not be behind others."""
        return not self._queue and not self.connection.transport.get_write_buffer_size()

    async def send(self) -> None:
        """Send what must arrive until the connection ends."""
        while True:
            await self._wake.wait()
            self._wake.clear()
            queue, self._queue = self._queue, []
            for text in queue:
                await self.connection.send(text)


class PageServer:
    """Serves the page, and keeps who operates.

    Args:
        hello: what every client is told first. obey: a checked message of the operator for the loop, or a SERVED one;
            raises WbcError for what it refuses.

    Attributes:
        scene, server: viser's. url: address of the page, with its token.
        operator: name of the page or client that has control, "" for none.

    Raises:
        ViewerError: it cannot listen there, or what keeps foreign pages out does not.
    """

    def __init__(
        self,
        host: str,
        port: int,
        token: str | None,
        hello: dict[str, Any],
        obey: Callable[[dict[str, Any]], None],
        silence: float = SILENT,
    ) -> None:
        import viser

        _require_free(host, port)
        self._hello, self._obey, self._silence = hello, obey, silence
        self._gate = Gate(host in LOOPBACK, token)
        self._clients: dict[str, Client] = {}
        self._numbers = itertools.count(1)
        self.operator = ""
        self._lost: Callable[[], None] = lambda: None
        with _guarded(self._look, self._handle) as guarded, contextlib.redirect_stdout(io.StringIO()):
            self.server = viser.ViserServer(host=host, port=port, verbose=False)
            self._loop = self.server.get_event_loop()
        if not guarded:
            self.server.stop()
            raise ViewerError("viewer", viser.__version__, "this viser cannot be kept from foreign pages; use 1.1")
        self.scene = self.server.scene
        self.server.gui.configure_theme(show_logo=False, show_share_button=False)
        shown = host if ":" not in host else f"[{host}]"
        shown = "127.0.0.1" if shown in ("0.0.0.0", "localhost") else shown
        self.url = f"http://{shown}:{self.server.get_port()}/" + (f"?token={token}" if token else "")
        self._watching = asyncio.run_coroutine_threadsafe(self._watch(), self._loop)

    def on_lost(self, call: Callable[[], None]) -> None:
        """Call this where the operator's page is closed or silent."""
        self._lost = call

    def publish(self, message: dict[str, Any]) -> None:
        """A state for all clients; from any thread."""
        text = messages.write(message)
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._show, text)

    def tell_all(self, message: dict[str, Any]) -> None:
        """A message for all clients; from any thread."""
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._tell_all, message)

    @property
    def watchers(self) -> int:
        """How many are connected."""
        return len(self._clients)

    def answers(self) -> bool:
        """The thread that serves pages does something within a tenth of a second."""
        heard = threading.Event()
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(heard.set)
        return heard.wait(0.1)

    def operates(self, client: int | None) -> bool:
        """Whether one of viser's clients belongs to the operator's page."""
        from viser.infra import ClientId

        if client is None or not self.operator:
            return False
        connection = self.server._websock_server._live_connections.get(ClientId(client))
        if connection is None or connection.request is None:
            return False
        parts = urlsplit(connection.request.path).path.split("/")
        return len(parts) > 2 and parts[2] == self.operator

    def close(self) -> None:
        """End it."""
        with contextlib.suppress(RuntimeError, AttributeError):
            self._watching.cancel()
            # The first turn of the loop cancels it, the second ends it
            self.answers()
            self.answers()
        with contextlib.redirect_stdout(io.StringIO()):
            self.server.stop()

    # Requests for pages

    def _look(self, request: Request, page: Callable[[], Any]) -> Any:
        """Answer, or let a socket through with None; ``page`` asks viser."""
        reason = self._gate.refusal(request)
        if reason:
            return answer(http.HTTPStatus.FORBIDDEN, f"Refused: {reason}.\n")
        parts = urlsplit(request.path).path.strip("/").split("/")
        if request.headers.get("Upgrade", "").lower() == "websocket":
            known = parts[0] in (SCENE, SOCKET)
            return None if known else answer(http.HTTPStatus.NOT_FOUND, "There is no such socket.\n")
        if parts[0] == SCENE:
            request.path = "/"
            return page()
        return self._file(parts[0] or "index.html")

    def _file(self, name: str) -> Response:
        file = FOLDER / name
        if "/" in name or file.suffix not in KINDS or not file.is_file():
            return answer(http.HTTPStatus.NOT_FOUND, "There is no such page.\n")
        keep = {"Set-Cookie": self._gate.cookie()} if self._gate.token is not None else None
        return answer(http.HTTPStatus.OK, file.read_text(encoding="utf-8"), KINDS[file.suffix], keep)

    # Sockets

    async def _handle(self, connection: ServerConnection, scene: Callable[[Any], Any]) -> None:
        assert connection.request is not None
        parts = urlsplit(connection.request.path).path.strip("/").split("/")
        if parts[0] == SCENE:
            await scene(connection)
            return
        name = parts[1] if len(parts) > 1 and not self._lives(parts[1]) else f"client{next(self._numbers)}"
        client = self._clients[name] = Client(name, connection)
        client.tell(self._hello | {"you": name, "operator": self.operator})
        sender = asyncio.create_task(client.send())
        try:
            async for text in connection:
                client.heard = time.monotonic()
                try:
                    self._take(client, messages.read(text))
                except WbcError as error:
                    client.tell({"type": "refused", "reason": str(error)})
        except Exception as error:
            if type(error).__name__ not in ("ConnectionClosedError", "ConnectionClosedOK"):
                raise
        finally:
            sender.cancel()
            if self._clients.get(name) is client:
                del self._clients[name]
                if self.operator == name:
                    self._operator_lost()

    def _lives(self, name: str) -> bool:
        """A name is somebody's who was heard lately; of one who was not it is free for the page that comes back."""
        client = self._clients.get(name)
        return client is not None and time.monotonic() - client.heard < self._silence

    def _take(self, client: Client, message: dict[str, Any]) -> None:
        kind = message["type"]
        if kind == "alive":
            return
        if kind == "stop":
            # Whoever watches may stop it
            self._obey(message)
            return
        if kind == "operate":
            if self.operator not in ("", client.name):
                raise ViewerError("operate", client.name, "somebody else has control; they can release it")
            self._set_operator(client.name)
            self._obey(message)
            return
        if self.operator != client.name:
            raise ViewerError(kind, client.name, "you watch; take control first")
        if kind == "release":
            self._set_operator("")
        self._obey(message)

    def _set_operator(self, name: str) -> None:
        self.operator = name
        self._tell_all({"type": "operator", "name": name})

    def _operator_lost(self) -> None:
        self._set_operator("")
        self._lost()

    async def _watch(self) -> None:
        """An operator that is silent is lost."""
        while True:
            await asyncio.sleep(BEAT)
            client = self._clients.get(self.operator)
            if client is not None and time.monotonic() - client.heard > self._silence:
                self._operator_lost()

    def _show(self, text: str) -> None:
        """One frame for all who are free; a slow client misses states, and is late but not behind."""
        from websockets.asyncio.server import broadcast

        broadcast([client.connection for client in self._clients.values() if client.free], text)

    def _tell_all(self, message: dict[str, Any]) -> None:
        for client in self._clients.values():
            client.tell(message)


def _require_free(host: str, port: int) -> None:
    """viser would look for another port without an end."""
    try:
        family, kind, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except OSError as error:
        raise ViewerError("viewer", f"{host}:{port}", f"cannot listen there: {error.strerror}") from error


@contextlib.contextmanager
def _guarded(
    look: Callable[[Request, Callable[[], Any]], Any], handle: Callable[[Any, Any], Any]
) -> Iterator[list[bool]]:
    """viser's server, made inside, asks us first: it has no setting for who may connect. Gives whether it does."""
    from websockets.asyncio import server

    original, used = server.serve, list[bool]()

    @functools.wraps(original)
    def serve(handler: Any, *arguments: Any, process_request: Any = None, **settings: Any) -> Any:
        def process(connection: Any, request: Any) -> Any:
            return look(request, functools.partial(process_request, connection, request))

        async def handled(connection: Any) -> None:
            await handle(connection, handler)

        used.append(True)
        return original(handled, *arguments, process_request=process, **settings)

    server.serve = serve  # type: ignore[assignment,misc]
    try:
        yield used
    finally:
        server.serve = original  # type: ignore[misc]
