"""What a stack compiles to: a native library, or CasADi functions for the virtual machine; both cached."""

from __future__ import annotations

import pathlib
from dataclasses import dataclass, replace
from typing import Literal

import casadi as ca

from wbc import validation
from wbc.errors import CompileError
from wbc.native import cache, toolchain
from wbc.stack import codegen
from wbc.stack.declaration import Declaration
from wbc.stack.key import key
from wbc.stack.layout import Layout
from wbc.stack.program import TickProgram, build
from wbc.stack.rows import RowsLibrary

BackendName = Literal["auto", "native", "vm"]
BACKENDS = ("auto", "native", "vm")
#: C of the functions, beside them
_SOURCE = "rows.c"


@dataclass(frozen=True, eq=False)
class Artifact:
    """A compiled stack.

    Attributes:
        layout: where everything stands in the buffers.
        library: shared library of the tick, or None for the virtual machine.
        program: CasADi functions, or None for a native library.
        cached: it was in the cache, no expression was built.
        rows: the program as native code in the making, or None.
    """

    layout: Layout
    library: pathlib.Path | None
    program: TickProgram | None
    cached: bool
    rows: RowsLibrary | None = None

    @property
    def backend(self) -> str:
        """Its name."""
        return "vm" if self.library is None else "native"


def compile_stack(stack: Declaration, backend: str, version: str, search: bool = False, wait: bool = True) -> Artifact:
    """Compile a stack, or find it in the cache.

    Args:
        backend: ``native`` (needs gcc), ``vm``: rows on CasADi's virtual machine, or ``auto``: native where it can be.
        search: a native library with inverse kinematics.
        wait: False, of ``auto``: the virtual machine at once, and its rows as native code when they are compiled.

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
    return _virtual(stack, layout, version)[0]


def _native(stack: Declaration, layout: Layout, version: str, search: bool) -> Artifact:
    """The shared library, compiled or from the cache."""

    def fill(folder: pathlib.Path) -> None:
        program = build(stack, layout, loops=True)
        toolchain.compile_tick(codegen.sources(stack, layout, program), folder / "tick.so", search)

    built_by = toolchain.identity() + ("\nsearch" if search else "")
    folder, cached = cache.fetch(
        key(stack, version, built_by), fill, library=True, what=_said(stack), advice="backend='vm' is ready sooner"
    )
    return Artifact(layout, folder / "tick.so", None, cached)


def _virtual(stack: Declaration, layout: Layout, version: str, source: bool = False) -> tuple[Artifact, pathlib.Path]:
    """The functions for the virtual machine, built or from the cache, and their folder; ``source``: with their C."""
    made: dict[str, ca.Function] = {}

    def fill(folder: pathlib.Path) -> None:
        made.update(build(stack, layout).functions)
        for name, function in made.items():
            function.save(str(folder / f"{name}.casadi"))
        if source:
            (folder / _SOURCE).write_text(codegen.casadi_source(list(made.values())))

    folder, cached = cache.fetch(key(stack, version, f"vm {source}"), fill, what=_said(stack))
    saved = made or {path.stem: ca.Function.load(str(path)) for path in sorted(folder.glob("*.casadi"))}
    functions = TickProgram(saved["rows"], saved.get("ahead"), saved.get("curvature"), saved.get("torque"))
    functions = replace(functions, lost=saved.get("lost"))
    return Artifact(layout, None, functions, cached), folder


def _at_once(stack: Declaration, layout: Layout, version: str) -> Artifact:
    """The functions for the virtual machine, and behind them the same as native code, where a compiler is.

    Their C is made here and not behind: CasADi keeps the interpreter's lock meanwhile, and a tick would wait.
    """
    if not toolchain.available():
        return _virtual(stack, layout, version)[0]
    out, folder = _virtual(stack, layout, version, source=True)
    rows = RowsLibrary(lambda: key(stack, version, f"{toolchain.identity()}\nrows"), folder / _SOURCE, _said(stack))
    return replace(out, rows=rows)


def _said(stack: Declaration) -> str:
    return f"a stack of {len(stack.entries)} items on {stack.robot.name}"
