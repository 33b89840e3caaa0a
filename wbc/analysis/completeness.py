"""Whether a set of task and constraint coordinates always suffices, with a witness where it does not."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from wbc import validation
from wbc.analysis.branches import Branch
from wbc.analysis.deficiency import Exact
from wbc.analysis.equivalent_rows import split_twists
from wbc.analysis.jacobian import SymbolicJacobian, symbolic_jacobian
from wbc.analysis.locus import Locus
from wbc.analysis.model import ExactModel
from wbc.analysis.numeric import NumericRows, rank, singular_values
from wbc.analysis.points import real_point
from wbc.analysis.ring import Matrix
from wbc.analysis.rows import Rows, checked
from wbc.analysis.singular_vectors import singular_vector_locus
from wbc.analysis.sub_determinants import sub_determinant_locus
from wbc.errors import RangeError
from wbc.validation import Array

ALGORITHMS: dict[str, Callable[[Exact, Matrix], Locus]] = {
    "sub_determinants": sub_determinant_locus,
    "singular_vectors": singular_vector_locus,
}
#: Random points on a branch that are tried for a witness
TRIES = 40
#: Verdicts
STRICT, LOOSE, INCOMPLETE, UNDECIDED = "strict", "loose", "incomplete", "undecided"


@dataclass(frozen=True, eq=False)
class Witness:
    """A configuration where the task has full rank and task and constraints together have not.

    Attributes:
        q: configuration of the robot [nq]. branch: of the locus, on which it lies.
        task: singular values of the task Jacobian there. augmented: those of task and constraints.
    """

    q: Array
    branch: Branch
    task: Array
    augmented: Array


@dataclass(frozen=True, eq=False)
class Analysis:
    """Rank analysis of one set.

    Attributes:
        exact: arithmetic of the robot, which writes the branches. task, augmented: the symbolic Jacobians.
        locus: where the augmented one has less than its full rank. algorithmic: branches on which the task alone
            keeps full rank. verdict: ``strict`` (no such configuration), ``loose`` (only where the task itself is
            deficient), ``incomplete``, or ``undecided`` (a branch is open, or no real point of it was found).
        witness: for ``incomplete``. seconds: processor time.
    """

    exact: Exact
    task: SymbolicJacobian
    augmented: SymbolicJacobian
    locus: Locus
    algorithmic: tuple[Branch, ...]
    verdict: str
    witness: Witness | None
    seconds: float


def analyse(
    model: ExactModel, task: Sequence[Rows], constraints: Sequence[Rows], *, algorithm: str = "sub_determinants"
) -> Analysis:
    """Completeness of task and constraint coordinates: { q : rank J_R < m } within { q : rank J_T < n }.

    J_T are the rows of the task, J_R those of task and constraints, m the number of joints. If the tall J_R has rank m
    and J_T full rank, some rows of the constraints complete the task; so one locus stands for all pairs.

    A witness is looked for on every branch where the task is not deficient, and checked with singular values of the
    robot's Jacobians, computed apart from the polynomials.

    Source: E. Dupuis, PhD thesis, McGill University, 2001, section 3.1.

    Raises:
        UnknownNameError: algorithm, frame or joint. RangeError: fewer rows than joints, or more task rows than joints.
    """
    validation.one_of("algorithm", algorithm, ALGORITHMS)
    began = time.process_time()
    wanted, added = checked("task", task), checked("constraints", constraints)
    exact = Exact(model.ring)
    J_T, J_R = symbolic_jacobian(model, wanted), symbolic_jacobian(model, (*wanted, *added))
    joints = model.robot.nv
    if J_T.shape[0] > joints or J_R.shape[0] < joints:
        raise RangeError("rows", J_R.shape[0], f"expected at least {joints} in all and at most {joints} in the task")
    locus = ALGORITHMS[algorithm](exact, _shortest(model, (*wanted, *added), J_R))
    algorithmic = tuple(b for b in locus.branches if not exact.deficient(J_T.matrix, b))
    doubtful = [b for b in locus.open if not exact.deficient(J_T.matrix, b)]
    witness = _witness(model, exact, wanted, added, algorithmic)
    verdict = STRICT if not locus.branches else LOOSE
    if witness is not None:
        verdict = INCOMPLETE
    elif algorithmic or doubtful:
        verdict = UNDECIDED
    return Analysis(exact, J_T, J_R, locus, algorithmic, verdict, witness, time.process_time() - began)


def _shortest(model: ExactModel, rows: tuple[Rows, ...], stacked: SymbolicJacobian) -> Matrix:
    """Of the rows and their equivalents with a twist split at a point the matrix with the fewest terms."""
    splits = (symbolic_jacobian(model, split).matrix for split in split_twists(model, rows))
    return min((stacked.matrix, *splits), key=lambda matrix: sum(len(p) for row in matrix for p in row))


def _witness(
    model: ExactModel, exact: Exact, task: tuple[Rows, ...], constraints: tuple[Rows, ...], branches: Sequence[Branch]
) -> Witness | None:
    """The best of random points on the first branch that has one: its task is farthest from a loss of rank."""
    numeric, rng = NumericRows(model.robot), np.random.default_rng(0)
    for branch in branches:
        best: Witness | None = None
        for _ in range(TRIES):
            point = real_point(exact.half, branch, rng)
            if point is None:
                continue
            q = model.configuration(point)
            J_T, J_R = numeric.value(task, q), numeric.value((*task, *constraints), q)
            if rank(J_T) < J_T.shape[0] or rank(J_R) == model.robot.nv:
                continue
            sigma, every = singular_values(J_T), singular_values(J_R)
            if best is None or sigma[-1] > best.task[-1]:
                best = Witness(q, branch, sigma, every)
        if best is not None:
            return best
    return None
