"""Who may connect: pages of this server's own origin, on this machine, and elsewhere who knows the token."""

from __future__ import annotations

import hmac
import http
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlsplit

from websockets.datastructures import Headers
from websockets.http11 import Request, Response

LOCAL = ("127.0.0.1", "localhost", "[::1]")
COOKIE = "wbc_token"


class Gate:
    """Looks at the head of every request, of pages and sockets alike.

    * A request that names an ``Origin`` must name this server's: no page of another site drives the robot.
    * On this machine alone the ``Host`` must be it, so that no name of somebody else's leads here (DNS rebinding).
    * With a token: in the address (``?token=``), which a page then keeps as a cookie, or ``Authorization: Bearer``.

    Args:
        local: the server listens on the loopback address alone.
    """

    def __init__(self, local: bool, token: str | None) -> None:
        self.local, self.token = local, token

    def refusal(self, request: Request) -> str:
        """Why a request is refused, "" where it is not."""
        host = request.headers.get("Host", "")
        if self.local and _name(host) not in LOCAL:
            return f"this viewer serves {LOCAL[0]}, not {host[:80]!r}"
        origin = request.headers.get("Origin")
        if origin is not None and urlsplit(origin).netloc != host:
            return "another site's page may not drive this robot"
        if self.token is not None and not self._knows(request):
            return "the token is missing or wrong; the address with it was printed where the viewer was started"
        return ""

    def _knows(self, request: Request) -> bool:
        given = parse_qs(urlsplit(request.path).query).get("token", [""])[0]
        bearer = request.headers.get("Authorization", "").removeprefix("Bearer ")
        try:
            cookie = SimpleCookie(request.headers.get("Cookie", ""))
        except CookieError:
            cookie = SimpleCookie()
        kept = cookie[COOKIE].value if COOKIE in cookie else ""
        expected = str(self.token).encode()
        return any(hmac.compare_digest(one.encode(), expected) for one in (given, bearer, kept))

    def cookie(self) -> str:
        """What a page keeps so that its sockets are let in."""
        return f"{COOKIE}={self.token}; HttpOnly; SameSite=Strict; Path=/"


def _name(host: str) -> str:
    """A host without its port."""
    return host.rsplit(":", 1)[0] if ":" in host and not host.endswith("]") else host


def answer(
    status: http.HTTPStatus, text: str, kind: str = "text/plain", more: dict[str, str] | None = None
) -> Response:
    """An answer to a request for a page."""
    body = text.encode()
    headers = Headers({"Content-Type": f"{kind}; charset=utf-8", "Content-Length": str(len(body))})
    headers["Cache-Control"] = "no-store"
    headers["X-Content-Type-Options"] = "nosniff"
    headers["Content-Security-Policy"] = "frame-ancestors 'self'"
    for name, value in (more or {}).items():
        headers[name] = value
    return Response(status, status.phrase, headers, body)
