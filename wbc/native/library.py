"""Compiled ticks loaded into this process, from copies that no other process can change."""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import os
import pathlib
import sys
import threading
from collections.abc import Iterator

#: Most that is read at once [bytes]: longer than almost all sources
_PIECE = 1 << 16
_loaded: dict[str, ctypes.PyDLL] = {}
_lock = threading.Lock()
# A forked process has no other thread that would release it; Windows forks none
if sys.platform != "win32":
    os.register_at_fork(before=_lock.acquire, after_in_parent=_lock.release, after_in_child=_lock.release)


def file_bytes(path: str | os.PathLike[str]) -> bytes:
    """What is in a file, by three calls of the system; Python's own files make seven."""
    file, parts = os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0)), []
    try:
        while part := os.read(file, _PIECE):
            parts.append(part)
            if len(part) < _PIECE:
                break
    finally:
        os.close(file)
    return parts[0] if len(parts) == 1 else b"".join(parts)


def load_library(path: pathlib.Path) -> ctypes.PyDLL:
    """The library at a path; one of the same contents is loaded once.

    What is loaded is a copy that loses its name at once: pages of a library come from its file when they are first
    used, and one that is truncated or written over in place would take the process with it. Where no copy can be
    made, the file itself is loaded, as on Windows, which lets nobody change or remove the file of what is loaded.

    Raises:
        OSError: it cannot be read, or it is no library.
    """
    content = file_bytes(path)
    digest = hashlib.sha256(content).hexdigest()
    with _lock:
        if digest not in _loaded:
            _loaded[digest] = _load_copy(content, path)
        return _loaded[digest]


def _load_copy(content: bytes, path: pathlib.Path) -> ctypes.PyDLL:
    for folder in _folders(path) if sys.platform != "win32" else ():
        with contextlib.suppress(OSError):
            # A name of its own: the loader takes two files of one name for the same
            name = os.path.join(folder, f".loading-{os.getpid()}-{len(_loaded)}.so")
            file = os.open(name, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            try:
                with open(file, "wb") as copy:
                    copy.write(content)
                return ctypes.PyDLL(name)
            finally:
                os.unlink(name)
    return ctypes.PyDLL(str(path))


def _folders(path: pathlib.Path) -> Iterator[str]:
    yield str(path.parent.parent)
    # Not imported, and not looked for, where the first can be written to
    import tempfile

    yield tempfile.gettempdir()
