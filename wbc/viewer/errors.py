"""What can be wrong with a viewer."""

from __future__ import annotations

from urllib.parse import urlsplit

from wbc.errors import WbcError


class ViewerError(WbcError):
    """A viewer that cannot be shown: what it needs is not installed, or its process ended."""


LOOPBACK = ("127.0.0.1", "localhost", "::1")


def require_local(address: str) -> None:
    """Raise :class:`ViewerError` for an address that other machines reach."""
    parts = urlsplit(address)
    if parts.scheme not in ("ipc", "tcp") or (parts.scheme == "tcp" and parts.hostname not in LOOPBACK):
        raise ViewerError("zeromq", address, "expected ipc://FILE or tcp://127.0.0.1:PORT, of this machine alone")
