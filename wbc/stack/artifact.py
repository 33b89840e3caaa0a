"""What a stack compiles to: a native library, or CasADi functions for the virtual machine; both cached."""

from __future__ import annotations

import pathlib
from dataclasses import replace

from wbc import validation
from wbc.errors import CompileError
from wbc.native import cache, toolchain
from wbc.quick_dataclasses import dataclass
from wbc.stack import codegen
from wbc.stack.behind import NativeBehind
from wbc.stack.compiling import FUNCTION, LIBRARY, functions_in
from wbc.stack.declaration import Declaration
from wbc.stack.key import key, library_key
from wbc.stack.layout import Layout
from wbc.stack.program import TickProgram, build, loaded

BACKENDS = ("auto", "native", "vm")


@dataclass(frozen=True, eq=False)
class Artifact:
    """A compiled stack.

    Attributes:
        layout: where everything stands in the buffers.
        library: shared library of the tick, or None for the virtual machine.
        program: CasADi functions, or None for a native library.
        cached: it was in the cache, no expression was built.
        behind: the library in the making, or None.
    """

    layout: Layout
    library: pathlib.Path | None
    program: TickProgram | None
    cached: bool
    behind: NativeBehind | None = None

    @property
    def backend(self) -> str:
        """Its name."""
        return "vm" if self.library is None else "native"

    def settled(self, wait: bool = False) -> Artifact:
        """With its library, if that is there now; ``wait``: or will be."""
        if self.behind is None or (made := self.behind.library(wait)) is None:
            return self
        return replace(self, library=made, program=None, behind=None)


def compile_stack(stack: Declaration, backend: str, version: str, search: bool = False, wait: bool = True) -> Artifact:
    """Compile a stack, or find it in the cache.

    Args:
        backend: ``native`` (needs gcc), ``vm``: rows on CasADi's virtual machine, or ``auto``: native where it can be.
        search: a native library with inverse kinematics.
        wait: False, of ``auto``: the virtual machine at once, and native code when that is compiled.

    Where ``auto`` finds a compiler that fails, the first lines of its message are in the log and the virtual machine
    does the work.

    Raises:
        UnknownNameError: another backend. CompileError: native without a compiler, or it failed.
    """
    validation.one_of("backend", backend, BACKENDS)
    if backend == "native" and toolchain.missing():
        raise CompileError("backend", backend, f"cannot compile: {', '.join(toolchain.missing())}")
    layout = Layout(stack)
    if backend == "auto" and not wait:
        return _at_once(stack, layout, version)
    if backend == "native" or (backend == "auto" and toolchain.available()):
        try:
            return _native(stack, layout, version, search)
        except CompileError as error:
            if backend == "native":
                raise
            toolchain.fall_back(str(error))
    return _virtual(stack, layout, key(stack, version))[0]


def _native(stack: Declaration, layout: Layout, version: str, search: bool) -> Artifact:
    """The shared library, compiled or from the cache."""

    def fill(folder: pathlib.Path) -> None:
        program = build(stack, layout)
        toolchain.compile_tick(codegen.sources(stack, layout, program, moves=search), folder / LIBRARY, search)

    name = library_key(key(stack, version), toolchain.identity() + ("\nsearch" if search else ""))
    what = _said(stack)
    folder, cached = cache.fetch(name, fill, library=True, what=what, advice="wait=False answers meanwhile")
    return Artifact(layout, folder / LIBRARY, None, cached)


def _virtual(stack: Declaration, layout: Layout, name: str) -> tuple[Artifact, pathlib.Path]:
    """The functions for the virtual machine, built or from the cache, and their folder, which is all that
    :mod:`wbc.stack.compiling` needs.
    """
    made: list[TickProgram] = []

    def fill(folder: pathlib.Path) -> None:
        made.append(build(stack, layout))
        for name, function in made[0].functions.items():
            # CasADi does not say that a disk is full, and opens no path that has other letters than the locale's
            (folder / f"{name}{FUNCTION}").write_text(function.serialize())
        for name, text in codegen.tables(stack, layout, made[0]).items():
            (folder / name).write_text(text)

    folder, cached = cache.fetch(name, fill, what=_said(stack))
    program = made[0] if made else loaded(stack, layout, functions_in(folder))
    return Artifact(layout, None, program, cached), folder


def _at_once(stack: Declaration, layout: Layout, version: str) -> Artifact:
    """The library where it is in the cache; else the functions for the virtual machine, and behind them the library,
    where a compiler is.
    """
    name = key(stack, version)
    if not toolchain.available():
        return _virtual(stack, layout, name)[0]
    # Which compiler this is takes two processes, and only says which of its libraries is the right one
    if cache.holds(f"{name}-"):
        found = cache.find(library_key(name, toolchain.identity()), library=True)
        if found is not None:
            return Artifact(layout, found / LIBRARY, None, cached=True)
    out, folder = _virtual(stack, layout, name)
    return replace(out, behind=NativeBehind(folder, _said(stack)))


def _said(stack: Declaration) -> str:
    return f"a stack of {len(stack.entries)} items on {stack.robot.name}"
