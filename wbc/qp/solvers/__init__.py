"""Kept solvers, built once for a size and called in every tick, by name."""

from __future__ import annotations

import functools
import importlib

from wbc import extras, validation
from wbc.qp.solvers.backend import Backend, Prepared

#: Solvers that are held to one answer by the tests, and the module and class of each
_SUPPORTED = {"daqp": ("wbc.qp.solvers.daqp", "Daqp"), "osqp": ("wbc.qp.solvers.osqp", "Osqp")}


def available_solvers(experimental: bool = False) -> tuple[str, ...]:
    """Names that :func:`make_solver` takes on this machine; with ``experimental`` also the unproven ones."""
    from wbc.qp.solvers.conic import EXPERIMENTAL

    names = [*_SUPPORTED, "qpoases", *(EXPERIMENTAL if experimental else ())]
    return tuple(name for name in names if name in _SUPPORTED or _has_conic(name))


@functools.cache
def _has_conic(name: str) -> bool:
    """CasADi has the plugin; for those that are missing it searches the disk, and every compilation asks."""
    import casadi as ca

    return bool(ca.has_conic(name))


def require_solver(name: str) -> None:
    """There is a solver of that name.

    Raises:
        UnknownNameError: there is none.
    """
    # To look for those of CasADi loads all of them
    if not (isinstance(name, str) and name in _SUPPORTED):
        validation.one_of("solver", name, available_solvers(experimental=True))


def make_solver(name: str, n: int, m: int, prepared: bool = True) -> Backend:
    """A kept solver for ``n`` variables and ``m`` general rows.

    Args:
        name: one of ``available_solvers(experimental=True)``.
        prepared: equality rows are made independent and orthonormal first (:class:`Prepared`).

    Raises:
        UnknownNameError: no solver of that name here. MissingPackageError: its package is not installed.
        SolverError: the solver cannot take problems of this form.
    """
    require_solver(name)
    if name in _SUPPORTED:
        if name in extras.EXTRAS:
            extras.require(name, "this solver")
        module, kind = _SUPPORTED[name]
        inner: Backend = getattr(importlib.import_module(module), kind)(n, m)
    else:
        from wbc.qp.solvers.conic import Conic

        inner = Conic(n, m, name)
    return Prepared(inner) if prepared else inner
