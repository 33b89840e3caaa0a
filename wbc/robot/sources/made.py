"""Descriptions that are made of files in other formats, in the cache: what reads a robot's file reads these."""

from __future__ import annotations

import hashlib
import pathlib

from wbc.native import cache


def kept(text: str, name: str) -> pathlib.Path:
    """A file of this text and name in the cache."""

    def write(folder: pathlib.Path) -> None:
        (folder / name).write_text(text, encoding="utf-8")

    folder, _ = cache.fetch(hashlib.sha256(f"{name}\n{text}".encode()).hexdigest(), write, what=name)
    return folder / name
