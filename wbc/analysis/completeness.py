"""Whether a set of task and constraint coordinates always suffices, with a witness where it does not."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from wbc import validation
from wbc.analysis.branches import Branch
from wbc.analysis.budget import Budget
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
from wbc.robot import Robot
from wbc.validation import Array

ALGORITHMS: dict[str, Callable[[Exact, Matrix, Budget | None], Locus]] = {
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
    model: ExactModel,
    task: Sequence[Rows],
    constraints: Sequence[Rows],
    *,
    algorithm: str = "sub_determinants",
    budget: Budget | None = None,
) -> Analysis:
    """Completeness of task and constraint coordinates: { q : rank J_R < m } within { q : rank J_T < n }.

    J_T are the rows of the task, J_R those of task and constraints, m the number of joints. If the tall J_R has rank m
    and J_T full rank, some rows of the constraints complete the task; so one locus stands for all pairs.

    A witness is looked for on every branch where the task is not deficient, and checked with singular values of the
    robot's Jacobians, computed apart from the polynomials. Where the budget is spent, or a keyboard interrupt comes,
    what is known so far is the answer, with the branches that were not decided in ``locus.open``.

    Source: E. Dupuis, PhD thesis, McGill University, 2001, section 3.1.

    Raises:
        UnknownNameError: algorithm, frame or joint. RangeError: fewer rows than joints, or more task rows than joints.
    """
    began = time.process_time()
    wanted, added = checked("task", task), checked("constraints", constraints)
    rows = (*wanted, *added)
    found = loci(model, wanted, rows, algorithm, budget)
    witness = find_witness(model.robot, found, wanted, rows, model.configuration)
    verdict = found.verdict(witness)
    return Analysis(
        found.exact,
        symbolic_jacobian(model, wanted),
        found.augmented,
        found.locus,
        found.algorithmic,
        verdict,
        witness,
        time.process_time() - began,
    )


@dataclass(frozen=True, eq=False)
class Loci:
    """Where rows lose rank, and where the task does not.

    Attributes:
        exact: arithmetic of the robot. augmented: all rows. locus: where they have less than full rank.
        algorithmic: branches on which the task is not known to be deficient. doubtful: those among the open ones.
    """

    exact: Exact
    augmented: SymbolicJacobian
    locus: Locus
    algorithmic: tuple[Branch, ...]
    doubtful: tuple[Branch, ...]

    def verdict(self, witness: Witness | None) -> str:
        """In the words of :class:`Analysis`."""
        if witness is not None:
            return INCOMPLETE
        if self.algorithmic or self.doubtful:
            return UNDECIDED
        return LOOSE if self.locus.branches else STRICT


def loci(
    model: ExactModel, task: Sequence[Rows], rows: Sequence[Rows], algorithm: str, budget: Budget | None = None
) -> Loci:
    """The locus of rows; ``task``: some of them, none if their rank depends on other joints than the model's.

    Raises:
        UnknownNameError, RangeError: see :func:`analyse`.
    """
    validation.one_of("algorithm", algorithm, ALGORITHMS)
    exact, joints = Exact(model.ring), model.robot.nv
    J_T = symbolic_jacobian(model, task).matrix if task else []
    J_R = symbolic_jacobian(model, rows)
    if len(J_T) > joints or J_R.shape[0] < joints:
        raise RangeError("rows", J_R.shape[0], f"expected at least {joints} in all and at most {joints} in the task")
    locus = ALGORITHMS[algorithm](exact, _shortest(model, tuple(rows), J_R), budget)

    def kept(branches: Sequence[Branch]) -> tuple[Branch, ...]:
        return tuple(b for b in branches if not J_T or not exact.deficient(J_T, b))

    return Loci(exact, J_R, locus, kept(locus.branches), kept(locus.open))


def _shortest(model: ExactModel, rows: tuple[Rows, ...], stacked: SymbolicJacobian) -> Matrix:
    """Of the rows and their equivalents with a twist split at a point the matrix with the fewest terms."""
    splits = (symbolic_jacobian(model, split).matrix for split in split_twists(model, rows))
    return min((stacked.matrix, *splits), key=lambda matrix: sum(len(p) for row in matrix for p in row))


def find_witness(
    robot: Robot, found: Loci, task: Sequence[Rows], rows: Sequence[Rows], configuration: Callable[[Array], Array]
) -> Witness | None:
    """The best of random points on the first branch that has one: its task is farthest from a loss of rank.

    Args:
        configuration: of the robot, from a number for each joint of the arithmetic that found the branches.
    """
    numeric, rng = NumericRows(robot), np.random.default_rng(0)
    for branch in found.algorithmic:
        best: Witness | None = None
        for _ in range(TRIES):
            point = real_point(found.exact.half, branch, rng)
            if point is None:
                continue
            q = configuration(point)
            J_T, J_R = numeric.value(task, q), numeric.value(rows, q)
            if rank(J_T) < J_T.shape[0] or rank(J_R) == robot.nv:
                continue
            sigma, every = singular_values(J_T), singular_values(J_R)
            if best is None or sigma[-1] > best.task[-1]:
                best = Witness(q, branch, sigma, every)
        if best is not None:
            return best
    return None
