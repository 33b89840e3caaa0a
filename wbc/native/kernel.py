"""Hand-written C, which is the same for every stack, as libraries: compiled when the package is installed or made a
wheel, else once on a machine, into the cache.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Mapping
from pathlib import Path

from wbc.native import cache, toolchain
from wbc.native.targets import HERE, TargetMachine

#: Libraries that were compiled ahead, see :mod:`wbc.stack.ahead`
AHEAD = Path(__file__).parent / "ahead"
#: What is compiled: name -> text
Texts = Mapping[str, str]


def kernel(main: Path, *folders: Path, at_once: bool = False) -> Path:
    """The library of a C file and of the headers that it includes.

    Args:
        folders: of headers of other packages. at_once: as of :func:`library`.

    Raises:
        CompileError: it was not compiled ahead, and there is no compiler, or it fails.
    """
    return library(texts_of(main, *folders), toolchain.compile_kernel, at_once=at_once)


def texts_of(main: Path, *folders: Path) -> dict[str, str]:
    """Name -> text of a C file, which comes first, and of the headers that it includes."""
    texts: dict[str, str] = {}
    waiting = [main.name]
    while waiting:
        name = waiting.pop(0)
        if name not in texts:
            found = next(file for folder in (main.parent, *folders) if (file := folder / name).exists())
            texts[name] = found.read_text(encoding="utf-8")
            waiting += re.findall(r'^#include "(.+)"', texts[name], re.MULTILINE)
    return texts


def library(
    texts: Texts, compile_to: Callable[[Texts, Path], None], what: str = "C code", at_once: bool = False
) -> Path:
    """The library of some texts.

    Args:
        compile_to: (texts, output). what: it is, for the log where compiling takes long.
        at_once: what was compiled ahead, for any processor of this kind, is taken also where a compiler is.

    Raises:
        CompileError: as of :func:`kernel`.
    """
    shipped = ahead(texts)
    if shipped.exists() and (at_once or toolchain.compiler() is None):
        return shipped
    name = _hash(*texts.values(), toolchain.machine())
    folder, _ = cache.fetch(name, lambda place: compile_to(texts, place / "code.so"), library=True, what=what)
    return folder / "code.so"


def ahead(texts: Texts, target: TargetMachine = HERE) -> Path:
    """Where the library of some texts, for any processor of this kind, is if it was compiled ahead: its name says what
    it was made of.
    """
    name = _hash(*texts.values(), target.system, target.machine, toolchain.solver_version())
    return AHEAD / f"{name[:32]}{target.suffix}"


def _hash(*texts: str) -> str:
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()
