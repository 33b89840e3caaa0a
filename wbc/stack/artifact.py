"""What a stack compiles to: a native library, or CasADi functions for the virtual machine; both cached."""

from __future__ import annotations

import pathlib
from dataclasses import dataclass
from typing import Literal

import casadi as ca

from wbc import validation
from wbc.errors import CompileError
from wbc.stack import cache, codegen, toolchain
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Layout
from wbc.stack.program import Program, build

BackendName = Literal["auto", "native", "vm"]


@dataclass(frozen=True, eq=False)
class Artifact:
    """A compiled stack.

    Attributes:
        layout: where everything stands in the buffers.
        library: shared library of the tick, or None for the virtual machine.
        program: CasADi functions, or None for a native library.
        cached: it was in the cache, no expression was built.
    """

    layout: Layout
    library: pathlib.Path | None
    program: Program | None
    cached: bool


def compile_stack(stack: Declaration, backend: str, version: str) -> Artifact:
    """Compile a stack, or find it in the cache.

    Args:
        backend: ``native`` (needs gcc), ``vm``, or ``auto``: native where it can be.

    Raises:
        UnknownNameError: another backend. CompileError: native without a compiler, or it failed.
    """
    validation.one_of("backend", backend, ("auto", "native", "vm"))
    if backend == "native" and not toolchain.available():
        raise CompileError("backend", backend, "needs gcc and the static daqp library of the casadi package")
    native = backend != "vm" and toolchain.available()
    layout = Layout(stack)
    name = cache.key(stack.key_data(), version, toolchain.identity() if native else "vm")

    def fill_native(folder: pathlib.Path) -> None:
        toolchain.compile_tick(codegen.sources(stack, layout, build(stack, layout)), folder / "tick.so")

    def fill_vm(folder: pathlib.Path) -> None:
        program = build(stack, layout)
        program.rows.save(str(folder / "rows.casadi"))
        if program.ahead is not None:
            program.ahead.save(str(folder / "ahead.casadi"))

    if native:
        folder, cached = cache.fetch(name, fill_native)
        return Artifact(layout, folder / "tick.so", None, cached)
    folder, cached = cache.fetch(name, fill_vm)
    later = folder / "ahead.casadi"
    program = Program(
        ca.Function.load(str(folder / "rows.casadi")), ca.Function.load(str(later)) if later.exists() else None
    )
    return Artifact(layout, None, program, cached)
