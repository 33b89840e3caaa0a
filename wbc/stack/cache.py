"""Compiled ticks on disk, one folder a declaration, in the user's cache directory.

The key is the hash of the declaration (robot data, items, package and compiler versions), so that a hit
builds no expression. Folders are private to the user; every file's hash is in the manifest and is checked
before the file is loaded; an entry that fails the check is built again. An entry is written beside its place
and renamed into it, so parallel builds at worst do the work twice.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import logging
import os
import pathlib
import shutil
import stat
import tempfile
from collections.abc import Callable
from importlib import metadata
from typing import Any

import numpy as np
import platformdirs

log = logging.getLogger("wbc")

MANIFEST = "manifest.json"


def root() -> pathlib.Path:
    """Cache directory: ``WBC_CACHE`` if set, else the platform's user cache."""
    chosen = os.environ.get("WBC_CACHE")
    return pathlib.Path(chosen) if chosen else pathlib.Path(platformdirs.user_cache_dir("wbc"))


def key(data: Any, version: str, toolchain: str) -> str:
    """Hash of everything that the build is a function of."""
    own = {p.name: p.read_text() for p in sorted((pathlib.Path(__file__).parent / "native").iterdir())}
    versions = [metadata.version("casadi"), metadata.version("pin"), np.__version__, version, toolchain]
    text = json.dumps([data, versions, own], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def fetch(name: str, build: Callable[[pathlib.Path], None]) -> tuple[pathlib.Path, bool]:
    """Folder of entry ``name``, and whether it was there; ``build(folder)`` fills a new one."""
    base = root()
    base.mkdir(mode=0o700, parents=True, exist_ok=True)
    final = base / name
    if _valid(final):
        return final, True
    if final.exists():
        log.warning("cache entry %s is damaged or not private; building it again", name)
    fresh = pathlib.Path(tempfile.mkdtemp(prefix=f".{name[:8]}-", dir=base))
    try:
        build(fresh)
        hashes = {p.name: _hash(p) for p in sorted(fresh.iterdir())}
        (fresh / MANIFEST).write_text(json.dumps(hashes))
        for path in fresh.iterdir():
            path.chmod(0o500 if path.suffix == ".so" else 0o400)
        _install(fresh, final)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
    return final, False


def clear() -> int:
    """Remove all entries; returns how many there were."""
    base = root()
    entries = [p for p in base.iterdir() if p.is_dir()] if base.is_dir() else []
    for path in entries:
        shutil.rmtree(path, ignore_errors=True)
    return len(entries)


def _install(fresh: pathlib.Path, final: pathlib.Path) -> None:
    for _ in range(5):
        with contextlib.suppress(OSError):
            fresh.rename(final)
            return
        if _valid(final):
            return
        # A damaged entry is moved out of the way first: another process may have its library open
        stale = pathlib.Path(tempfile.mkdtemp(prefix=".stale-", dir=final.parent))
        with contextlib.suppress(OSError):
            final.rename(stale / "entry")
        shutil.rmtree(stale, ignore_errors=True)
    fresh.rename(final)


def _valid(folder: pathlib.Path) -> bool:
    try:
        if not _private(folder):
            return False
        hashes = json.loads((folder / MANIFEST).read_text())
        present = {p.name for p in folder.iterdir()} - {MANIFEST}
        return present == set(hashes) and all(
            _private(folder / n) and _hash(folder / n) == h for n, h in hashes.items()
        )
    except (OSError, ValueError, AttributeError):
        return False


def _private(path: pathlib.Path) -> bool:
    """Owned by this user and writable by nobody else; no link."""
    info = path.lstat()
    if stat.S_ISLNK(info.st_mode) or not hasattr(os, "getuid"):
        return not stat.S_ISLNK(info.st_mode)
    return info.st_uid == os.getuid() and not info.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _hash(path: pathlib.Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
