"""What jobs found, kept in a file: a run that was ended goes on from there."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bench.pool import ROOT

#: What decides what a job finds
SUFFIXES = (".py", ".h", ".c", ".toml")


class Kept:
    """Jobs that are done, a line each in a file that belongs to one version of the sources; nothing without a file.

    Args:
        version: plain data; the file's first line.

    Raises:
        ValueError: the file belongs to another version.
    """

    def __init__(self, path: Path | None, version: dict[str, Any]) -> None:
        self._path, self._done = path, dict[str, Any]()
        if path is None:
            return
        head = json.dumps(version)
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(head + "\n")
        first, *lines = path.read_text().splitlines()
        if first != head:
            raise ValueError(f"{path} holds jobs of other sources; give another file")
        # A run that was killed may have left half a line
        if lines and not path.read_text().endswith("\n"):
            lines.pop()
            path.write_text("\n".join([first, *lines, ""]))
        self._done = {done["job"]: done["found"] for done in map(json.loads, lines)}

    def get(self, job: str) -> Any:
        """What a job that is done found; None if it is not."""
        return self._done.get(job)

    def put(self, job: str, found: Any) -> None:
        """Keep it."""
        self._done[job] = found
        if self._path is not None:
            with self._path.open("a") as file:
                file.write(json.dumps({"job": job, "found": found}) + "\n")

    def __iter__(self) -> Any:
        return iter(self._done.items())


def sources(folders: Sequence[str]) -> str:
    """Hash of the sources in some folders of the repository."""
    digest = hashlib.sha256()
    for folder in folders:
        for path in sorted((ROOT / folder).rglob("*.*")):
            if path.suffix in SUFFIXES:
                digest.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]
