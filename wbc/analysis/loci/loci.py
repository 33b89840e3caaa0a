"""Loci of rows and of the task among them, searched in a process of its own."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import TypeAlias

from wbc import validation
from wbc.analysis.algebra.branches import LocusBranch
from wbc.analysis.algebra.deficiency import Exact
from wbc.analysis.algebra.locus import Locus
from wbc.analysis.algebra.ring import Matrix
from wbc.analysis.jacobians.equivalent_rows import split_twists
from wbc.analysis.jacobians.jacobian import SymbolicJacobian, augmented_jacobian, symbolic_jacobian
from wbc.analysis.jacobians.model import ExactModel
from wbc.analysis.loci.budget import Budget
from wbc.analysis.loci.child import Child, Report
from wbc.analysis.loci.singular_vectors import singular_vector_locus
from wbc.analysis.loci.sub_determinants import sub_determinant_locus
from wbc.analysis.rows import Rows

#: Given the part of a locus that is known after each step
Told: TypeAlias = Callable[[Locus], None]
Algorithm: TypeAlias = Callable[[Exact, Matrix, Budget | None, Told | None], Locus]
ALGORITHMS: dict[str, Algorithm] = {
    "sub_determinants": sub_determinant_locus,
    "singular_vectors": singular_vector_locus,
}
#: Verdict of the exact method: the locus is empty
STRICT = "strict"
#: Verdict of the exact method: the task has lost rank on every branch of the locus
LOOSE = "loose"
#: Verdict of the exact method: on some branch the task may have full rank
UNDECIDED = "undecided"
#: Time between two messages of what is known so far [s]
_NEWS = 0.2


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
    algorithmic: tuple[LocusBranch, ...]
    doubtful: tuple[LocusBranch, ...]

    @property
    def verdict(self) -> str:
        """``strict``, ``loose``, or ``undecided`` where some branch may have a task of full rank."""
        if self.algorithmic or self.doubtful:
            return UNDECIDED
        return LOOSE if self.locus.branches else STRICT


class LocusSearch:
    """A search of the locus of rows, until its budget is spent; ``found`` is what is known at any time.

    Use as a context.

    Args:
        task: some of the rows, none if their rank depends on other joints than the model's.

    Raises:
        UnknownNameError: algorithm, frame or joint. RangeError: fewer rows than joints, or more task rows than joints.
    """

    def __init__(
        self, model: ExactModel, task: Sequence[Rows], rows: Sequence[Rows], algorithm: str, budget: Budget
    ) -> None:
        validation.one_of("algorithm", algorithm, ALGORITHMS)
        self._exact = Exact(model.ring)
        self._task, self.augmented = augmented_jacobian(model, task, rows)
        self._model, self._rows, self._budget = model, tuple(rows), budget
        self._algorithm = ALGORITHMS[algorithm]
        self._child = Child(self._work, budget.seconds)

    @property
    def done(self) -> bool:
        """Whether the search has come to its end by itself."""
        return self._child.done

    def wait(self, seconds: float) -> bool:
        """Whether the search has ended within this time."""
        return self._child.wait(seconds)

    def interrupt(self) -> None:
        """The end, with what is known."""
        self._child.interrupt()

    def found(self) -> Loci:
        """What is known now; ends the search."""
        self._child.stop()
        reports = self._child.reports
        locus = next((what for what in reversed(reports) if isinstance(what, Locus)), Locus((), (LocusBranch(),)))
        deficient = {branch for branch, lost in (what for what in reports if isinstance(what, tuple)) if lost}
        kept, doubtful = (tuple(b for b in some if b not in deficient) for some in (locus.branches, locus.open))
        return Loci(self._exact, self.augmented, locus, kept, doubtful)

    def _work(self, report: Report) -> None:
        last = time.monotonic()

        def progress(locus: Locus) -> None:
            nonlocal last
            if time.monotonic() - last > _NEWS:
                report(locus)
                last = time.monotonic()

        exact = self._exact
        locus = self._algorithm(exact, _shortest(self._model, self._rows, self.augmented), self._budget, progress)
        report(locus)
        locus = Locus(exact.real(locus.branches), locus.open)
        report(locus)
        for branch in (*locus.branches, *locus.open) if self._task else ():
            report((branch, exact.deficient(self._task, branch)))

    def __enter__(self) -> LocusSearch:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._child.stop()


def loci(model: ExactModel, task: Sequence[Rows], rows: Sequence[Rows], algorithm: str, budget: Budget) -> Loci:
    """What a :class:`LocusSearch` finds within its budget, or until a keyboard interrupt."""
    with LocusSearch(model, task, rows, algorithm, budget) as search:
        try:
            search.wait(budget.seconds)
        except KeyboardInterrupt:
            search.interrupt()
        return search.found()


def _shortest(model: ExactModel, rows: tuple[Rows, ...], stacked: SymbolicJacobian) -> Matrix:
    """Of the rows and their equivalents with a twist split at a point the matrix with the fewest terms."""
    splits = (symbolic_jacobian(model, split).matrix for split in split_twists(model, rows))
    return min((stacked.matrix, *splits), key=lambda matrix: sum(len(p) for row in matrix for p in row))
