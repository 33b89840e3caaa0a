"""What ``backend="auto"`` means in tests: the virtual machine, and nothing behind it, where compiled code is not the
point.

A stack's own library takes half a second to compile, its functions for the virtual machine a tenth of that; both run
the same C (``tests/stack/test_generic.py``) and give the same answers (``tests/controller/test_backends.py``). Tests
that are there for the compiled tick ask for ``native``, or are marked ``compiled``, as all are with ``make test
REPEATS=3``; those marked ``at_once`` get what a user gets, code that is compiled behind the ticks.
"""

from __future__ import annotations

from typing import Any

import pytest

from tests import repeats
from wbc.api import stack
from wbc.native import toolchain
from wbc.qp import solvers
from wbc.stack.artifact import Artifact, compile_stack
from wbc.stack.declaration import Declaration
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
    marks = {name for name in ("compiled", "at_once") for item in _running if item.get_closest_marker(name)}
    virtual = backend == "auto" and not _ALWAYS and not marks and not toolchain.missing()
    return compile_stack(declared, "vm" if virtual else backend, version, wait=wait or "at_once" not in marks)


stack.compile_stack = _compile
# What CasADi asks of an SX is answered quickly also where tests make expressions of their own
operators._outside = operators._ANSWERS
operators._answer(True)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Also for fixtures that tests of a module share: they are made for the first of them."""
    _running[:] = [item]
