"""Compiled stacks on disk, one folder each, in the user's cache directory.

An entry's name is :func:`wbc.stack.key.key`. Folders are private to the user; every file's hash is in the manifest and
is checked before the file is loaded; an entry that fails the check is built again. An entry is written beside its
place and renamed into it under a lock, so that of parallel builds of one entry the first does the work. A cache
directory that cannot be used, that is full, or that others may write to, is replaced by a temporary one for this
process.
"""

from __future__ import annotations

import atexit
import contextlib
import errno
import functools
import hashlib
import json
import logging
import os
import pathlib
import stat
import sys
import threading
import time
from collections.abc import Callable, Iterator

from wbc.native.file_lock import lock, unlock

log = logging.getLogger("wbc")

MANIFEST = "manifest.json"
#: Errors of a disk that takes no more
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO)
#: Who waits longer for compiled code is told so [s]
SLOW = 5.0


def root() -> pathlib.Path:
    """Cache directory: ``WBC_CACHE`` if set, else the platform's user cache; of a user without a home, as in
    containers, a folder of temporary files.
    """
    chosen = os.environ.get("WBC_CACHE")
    if chosen:
        return pathlib.Path(chosen)
    import platformdirs

    # Versions of platformdirs leave "~" in the path, or raise
    with contextlib.suppress(RuntimeError):
        if (place := pathlib.Path(platformdirs.user_cache_dir("wbc"))).is_absolute():
            return place
    import tempfile

    return pathlib.Path(tempfile.gettempdir(), f"wbc-{os.getuid()}")


def find(name: str, library: bool) -> pathlib.Path | None:
    """Folder of an entry that is there; ``library`` as of :func:`fetch`."""
    folder = base_of(name, library) / name
    return folder if _valid(folder) else None


def holds(beginning: str) -> bool:
    """Whether there are entries of libraries whose names begin so, where :func:`find` looks for them."""
    for base in {root(), base_of(beginning, library=True)}:
        with contextlib.suppress(OSError):
            if any(name.startswith(beginning) for name in os.listdir(base)):
                return True
    return False


def base_of(name: str, library: bool) -> pathlib.Path:
    """The directory that :func:`fetch` looks for an entry in: made if it is not there, or one in place of it."""
    base = root()
    problem = _problem(base, name, library)
    return _instead(base, problem) if problem else base


def fetch(
    name: str, build: Callable[[pathlib.Path], None], *, library: bool = False, what: str = "C code", advice: str = ""
) -> tuple[pathlib.Path, bool]:
    """Folder of entry ``name``, and whether it was there; ``build(folder)`` fills a new one.

    Args:
        library: files of the entry will be loaded as code, so its file system must allow that.
        what, advice: what is built, and what spares the wait, for the log where it takes long.
    """
    base = base_of(name, library)
    try:
        return _fetched(base, name, build, what, advice)
    except OSError as error:
        if error.errno not in FULL:
            raise
        return _fetched(_instead(base, os.strerror(error.errno)), name, build, what, advice)


def _fetched(
    base: pathlib.Path, name: str, build: Callable[[pathlib.Path], None], what: str, advice: str
) -> tuple[pathlib.Path, bool]:
    """:func:`fetch` in a directory."""
    final = base / name
    if _valid(final):
        return final, True
    with _told_when_slow(what, advice), _locked(base / f".{name}.lock"):
        if _valid(final):  # another process has built it in the meantime
            return final, True
        if os.path.lexists(final):
            log.warning("cache entry %s is damaged or not private; building it again", name)
        fresh = _made(base, f".{name[:8]}-")
        try:
            build(fresh)
            _seal(fresh)
            _install(fresh, final)
        finally:
            if fresh.exists():
                _remove(fresh)
    return final, False


@contextlib.contextmanager
def _told_when_slow(what: str, advice: str) -> Iterator[None]:
    """A line in the log after :data:`SLOW`, twice that and so on, and one at the end where there was one before."""
    began, ended, told = time.monotonic(), threading.Event(), threading.Event()

    def tell() -> None:
        due = SLOW
        while not ended.wait(due - (time.monotonic() - began)):
            told.set()
            log.warning(
                "compiling %s: %.0f s so far; it is kept for the next time%s", what, due, advice and f"; {advice}"
            )
            due *= 2.0

    threading.Thread(target=tell, name="compiling", daemon=True).start()
    try:
        yield
    finally:
        ended.set()
        if told.is_set():
            log.warning("compiling %s ended after %.0f s", what, time.monotonic() - began)


def clear() -> int:
    """Remove everything in the cache directory; returns how many entries there were."""
    base = root()
    found = list(base.iterdir()) if base.is_dir() else []
    for path in found:
        if path.is_dir() and not path.is_symlink():
            _remove(path)
        else:
            path.unlink(missing_ok=True)
    return sum(not path.name.startswith(".") for path in found)


def _problem(base: pathlib.Path, name: str, library: bool) -> str:
    """Why the directory cannot serve, or an empty text. It is made if it is not there."""
    try:
        base.mkdir(mode=0o700, parents=True, exist_ok=True)
        info = base.stat()
    except OSError as error:
        return error.strerror or type(error).__name__
    if sys.platform == "win32":  # where access is by lists that stat does not know
        return "" if os.access(base, os.R_OK | os.W_OK) or _valid(base / name) else "it cannot be written to"
    # Who may rename entries could swap one between its check and its loading; a sticky folder prevents that
    if info.st_mode & (stat.S_IWGRP | stat.S_IWOTH) and not info.st_mode & stat.S_ISVTX:
        return "others may write to it"
    if info.st_uid not in (os.getuid(), 0):
        return "it belongs to another user"
    if library and sys.platform == "linux" and os.statvfs(base).f_flag & os.ST_NOEXEC:
        return "its file system is mounted noexec"
    if not os.access(base, os.R_OK | os.W_OK | os.X_OK) and not _valid(base / name):
        return "it cannot be written to"
    return ""


@functools.cache
def _instead(base: pathlib.Path, problem: str) -> pathlib.Path:
    """A private folder that lives as long as this process; said once in the log."""
    import tempfile

    folder = pathlib.Path(tempfile.mkdtemp(prefix="wbc-cache-"))
    atexit.register(_remove, folder)
    log.warning(
        "cache directory %s cannot be used (%s); compiled stacks are stored for this process only", base, problem
    )
    return folder


@contextlib.contextmanager
def _locked(path: pathlib.Path) -> Iterator[None]:
    """Keep other processes and threads out; a process that dies lets go."""
    with path.open("a") as file:
        # Some network file systems have no locks: then parallel builds do the work twice
        with contextlib.suppress(OSError):
            lock(file)
        try:
            yield
        finally:
            # Closing would leave it to a process that was forked meanwhile
            with contextlib.suppress(OSError):
                unlock(file)


def _seal(folder: pathlib.Path) -> None:
    """Write the manifest and take away the right to write."""
    hashes = {p.name: _hash(p) for p in sorted(folder.iterdir())}
    (folder / MANIFEST).write_text(json.dumps(hashes))
    for path in folder.iterdir():
        path.chmod(0o500 if path.suffix == ".so" else 0o400)


def _install(fresh: pathlib.Path, final: pathlib.Path) -> None:
    """Put a finished entry into its place."""
    for _ in range(5):
        with contextlib.suppress(OSError):
            fresh.rename(final)
            return
        if _valid(final):
            return
        # A damaged entry is moved out of the way first: another process may have its library open
        stale = _made(final.parent, ".stale-")
        with contextlib.suppress(OSError):
            final.rename(stale / "entry")
        _remove(stale)
    fresh.rename(final)


def _made(base: pathlib.Path, beginning: str) -> pathlib.Path:
    """A folder of this user's, of a name that no other has: ``tempfile`` takes 4 ms to import."""
    folder = base / f"{beginning}{os.getpid()}-{time.monotonic_ns():x}"
    folder.mkdir(mode=0o700)
    return folder


def _remove(folder: pathlib.Path) -> None:
    import shutil

    shutil.rmtree(folder, ignore_errors=True)


def _valid(folder: pathlib.Path) -> bool:
    """Private, complete and unchanged since it was sealed."""
    try:
        if not (_private(folder) and _private(folder / MANIFEST)):
            return False
        hashes = json.loads((folder / MANIFEST).read_text())
        present = {p.name for p in folder.iterdir()} - {MANIFEST}
        return bool(hashes and present == set(hashes)) and all(
            _private(folder / n) and _hash(folder / n) == h for n, h in hashes.items()
        )
    except (OSError, ValueError, AttributeError, TypeError):
        return False


def _private(path: pathlib.Path) -> bool:
    """Owned by this user and writable by nobody else; no link."""
    info = path.lstat()
    if stat.S_ISLNK(info.st_mode):
        return False
    if sys.platform == "win32":
        return True
    return info.st_uid == os.getuid() and not info.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _hash(path: pathlib.Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
