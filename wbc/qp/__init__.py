"""Kept solvers for the quadratic program of a tick, certificates of their answers, and relaxation of conflicts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.qp.certificate import Certificate as Certificate, certify as certify
    from wbc.qp.equalities import Equalities as Equalities, independent as independent
    from wbc.qp.polishing import Polished as Polished, polish as polish
    from wbc.qp.problem import QP as QP, QPSolution as QPSolution
    from wbc.qp.solvers import available_solvers as available_solvers, make_solver as make_solver
    from wbc.qp.solvers.backend import Backend as Backend
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
