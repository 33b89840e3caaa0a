"""Kept solvers for the quadratic program of a tick, certificates of their answers, and relaxation of conflicts."""

from wbc.qp.certificate import Certificate, certify
from wbc.qp.equalities import Equalities, independent
from wbc.qp.polish import Polished, polish
from wbc.qp.problem import QP, Solution
from wbc.qp.solvers import available_solvers, make_solver
from wbc.qp.solvers.backend import Backend

__all__ = [
    "QP",
    "Backend",
    "Certificate",
    "Equalities",
    "Polished",
    "Solution",
    "available_solvers",
    "certify",
    "independent",
    "make_solver",
    "polish",
]
