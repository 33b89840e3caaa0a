"""A stack's library from its functions in the cache: what a process of its own does, see :mod:`wbc.stack.behind`.

CasADi writes C with the interpreter's lock held, so that a thread which did would keep ticks waiting.
"""

from __future__ import annotations

from pathlib import Path

import casadi as ca

from wbc.native import cache, toolchain
from wbc.stack.key import library_key
from wbc.stack.sources import completed

#: The library in its entry of the cache, and what files of functions end with in theirs
LIBRARY = "tick.so"
#: See LIBRARY
FUNCTION = ".casadi"


def functions_in(folder: Path) -> dict[str, ca.Function]:
    """The functions of a stack that is in the cache, by name."""
    return {path.stem: ca.Function.deserialize(path.read_text()) for path in sorted(folder.glob(f"*{FUNCTION}"))}


def compile_behind(folder: Path) -> str:
    """Make the cache's entry of a stack's library from ``folder``, which has its functions; the entry's name.

    Raises:
        CompileError: as of :func:`wbc.native.toolchain.compile_tick`.
    """

    def fill(place: Path) -> None:
        tables = {path.name: path.read_text() for path in folder.glob("*.h")}
        toolchain.compile_tick(completed(functions_in(folder), tables), place / LIBRARY)

    name = library_key(folder.name, toolchain.identity())
    cache.fetch(name, fill, library=True)
    return name
