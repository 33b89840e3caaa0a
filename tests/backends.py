"""What ``backend="auto"`` means in tests: the virtual machine, where compiled code is not the point.

A stack's own library takes half a second to compile, its functions for the virtual machine a tenth of that; both run
the same C (``tests/stack/test_generic.py``) and give the same answers (``tests/controller/test_backends.py``). Tests
that are there for the compiled tick ask for ``native``, or are marked ``compiled``; with ``make test REPEATS=3`` all
tests get what a user gets.

Most tests evaluate the virtual machine's functions a few times, so there expressions that occur twice stay: to find
them takes as long as thousands of evaluations, and a third of the time of a new stack. The numbers are the same bits
(``tests/stack/test_program.py``).
"""

from __future__ import annotations

from typing import Any

import pytest

from tests import optimised, repeats
from wbc.api import stack
from wbc.native import toolchain
from wbc.qp import solvers
from wbc.stack import artifact, program
from wbc.stack.artifact import Artifact, compile_stack
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Layout
from wbc.stack.program import TickProgram
from wbc.symbolic import operators

#: With all repeats every stack has a library of its own
_ALWAYS = repeats.MORE >= repeats.ALL
#: For tests of the tick's C code: the same, whether it is compiled once or for each stack
COMPILED = "native" if _ALWAYS else "vm"

#: A solver as Python calls it: the QP that C assembled goes the way of all solvers but the tick's own, to DAQP as well
IN_PYTHON = "python"
solvers._SUPPORTED[IN_PYTHON] = solvers._SUPPORTED["daqp"]

#: The test that runs
_running: list[pytest.Item] = []


def way(name: str) -> dict[str, Any]:
    """Arguments of :meth:`wbc.Stack.compile` for a back end, or for :data:`IN_PYTHON`."""
    return {"backend": "vm", "solver": IN_PYTHON} if name == IN_PYTHON else {"backend": name}


def _compile(declared: Declaration, backend: str, version: str, wait: bool = True) -> Artifact:
    marked = any(item.get_closest_marker("compiled") for item in _running)
    virtual = backend == "auto" and wait and not _ALWAYS and not marked and not toolchain.missing()
    return compile_stack(declared, "vm" if virtual else backend, version, wait=wait)


stack.compile_stack = _compile
_build, _shared = program.build, program.shared


def _quickly(declared: Declaration, layout: Layout, loops: bool = False) -> TickProgram:
    program.shared = _shared if loops or _ALWAYS or optimised.busy() else list
    try:
        return _build(declared, layout, loops)
    finally:
        program.shared = _shared


artifact.build = _quickly

# What CasADi asks of an SX is answered quickly also where tests make expressions of their own
operators._outside = operators._ANSWERS
operators._answer(True)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Also for fixtures that tests of a module share: they are made for the first of them."""
    _running[:] = [item]
