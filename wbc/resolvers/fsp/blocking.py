"""The published generator: solutions with blocked columns, and the search over which columns to block."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import combinations
from math import comb
from typing import Any

import numpy as np
from scipy.linalg import lapack, qr

from wbc import validation
from wbc.resolvers.fsp.compiled import NONE, Generated, generated
from wbc.resolvers.fsp.space import (
    RANK,
    Consistency,
    SolutionSpace,
    checked_held,
    checked_system,
    consistency,
    idle_joints,
    moving_columns,
    row_scales,
)
from wbc.validation import Array

SEARCHES = ("exchange", "exhaustive")
#: A vector is new where it stands out of the others by more than this share of its length, joints by their columns
NEW = 1e-8
#: Of pivots in a column those within this factor of the largest are taken for well conditioned
SOUND = 0.1
#: Bases that the search by exchange looks at for each vector that it needs
LOOKS = 30


def pattern_counts(joints: int, rows: int) -> tuple[int, int, int]:
    """(blocking patterns, vectors needed, sets of so many patterns) for a task of rows on joints."""
    patterns, needed = comb(joints, joints - rows), joints - rows + 1
    return patterns, needed, comb(patterns, needed)


def blocked(
    J: Any,
    x: Any,
    *,
    held: Iterable[int] = (),
    free: bool = False,
    search: str = "exchange",
    project: bool = False,
) -> SolutionSpace:
    """The space by blocked columns: M - N joints stand still, the others are solved for,

        g_i = (J_B^-1 x on the joints of block i, zeros elsewhere),   J_B an N x N block of J

    for as many blocks as there are independent vectors. Dependent rows leave first (N becomes the rank), columns of
    zeros stand still in every vector.

    Args:
        J, x, held, free, project: as of :func:`orthogonal`.
        search: ``exchange``: from the best conditioned block, one column is exchanged at a time, for one that leaves a
            sound block and a new solution; ``exhaustive``: every pattern in lexicographic order until there are enough.

    Raises:
        InfeasibleError: an inconsistent task. RangeError: no column that moves. UnknownNameError: no such search.
        ShapeError, NotFiniteError: bad input.

    Source: ORNL/TM-13096, sections 2.2 and 4.2.1; its rules of search are not in print, and these are others.
    """
    J, x = checked_system(J, x)
    validation.one_of("search", search, SEARCHES)
    still = checked_held(held, J.shape[1])
    quick = generated("wbc_blocked", J, x, still, False) if search == "exchange" else None
    made, blocks, completed = (quick, _first_blocks(quick), 0) if quick else _searched(J, x, still, search)
    idle = idle_joints(made, J.shape)
    status, missed, reached = consistency(J, x, made, project)
    if status is Consistency.INCONSISTENT:
        return replace(blocked(J, reached, held=still, free=free, search=search), status=status, missed=missed)
    vectors, loose = made.vectors, [k for k in idle if free and k not in still]
    if loose:
        vectors = np.vstack((vectors, np.tile(vectors[0], (len(loose), 1))))
        vectors[range(made.vectors.shape[0], len(vectors)), loose] = float(np.abs(vectors[0]).max()) or 1.0
        idle = tuple(k for k in idle if k not in loose)
    rows = tuple(sorted(made.order[: made.rank]))
    return SolutionSpace(J, reached, vectors, rows, idle, status, missed, blocks, completed + len(loose))


def _first_blocks(made: Generated) -> tuple[tuple[int, ...], ...]:
    """Joints at rest in each vector, as one column after another changes places with one of the first block."""
    rest = made.active[made.rank :]
    others = (sorted([*rest[:k], *rest[k + 1 :], joint]) for k, joint in enumerate(made.leaving))
    return tuple(map(tuple, (sorted(rest), *others)))


def _searched(J: Array, x: Array, held: tuple[int, ...], search: str) -> tuple[Generated, Any, int]:
    """The space, its blocks, and how many vectors are none: in numpy, for all that the first block does not show."""
    active = moving_columns(J, held, False)
    if not active:
        return NONE, (), 0
    A = J[:, active]
    rows = _independent(A)
    columns = _first_block(A[rows], x[rows])[1]
    finder = _BlockingSearch(A[rows], x[rows])
    if len(columns) < A.shape[1]:
        finder.exhaust() if search == "exhaustive" else finder.exchange(columns)
    else:
        finder.take(columns)
    completed = finder.complete()
    vectors = np.zeros((len(finder.found), J.shape[1]))
    vectors[:, active] = finder.found
    blocks = tuple(tuple(active[k] for k in b) for b in finder.blocks)
    return Generated(vectors, len(rows), rows, active, []), blocks, completed


class _BlockingSearch:
    """Independent solutions of A v = b, A of full row rank, with at most as many joints moving as rows."""

    def __init__(self, A: Array, b: Array) -> None:
        self.A, self.b = A, b
        self.n, self.m = A.shape
        self.size = np.linalg.norm(A / np.abs(A).max(axis=1)[:, None], axis=0)
        self.found: list[Array] = []
        self.blocks: list[tuple[int, ...]] = []
        self._axes = np.zeros((0, self.m))

    def enough(self) -> bool:
        """Whether there are M - N + 1."""
        return bool(len(self.found) == self.m - self.n + 1)

    def take(self, columns: Array) -> None:
        """The solution of a block, if it is regular and its solution is new."""
        _, _, x, singular = lapack.dgesv(self.A[:, columns], self.b)
        if singular:
            return
        v = np.zeros(self.m)
        v[columns] = x
        if self._new(v):
            self.blocks.append(tuple(self._still(columns)))

    def _still(self, columns: Array) -> list[int]:
        """All other columns, by number."""
        moving = set(columns.tolist())
        return [k for k in range(self.m) if k not in moving]

    def exhaust(self) -> None:
        """Pattern after pattern, the first columns blocked first."""
        for still in combinations(range(self.m), self.m - self.n):
            columns = np.setdiff1d(np.arange(self.m), still)
            sigma = np.linalg.svd(self.A[:, columns] / self.size[columns], compute_uv=False)
            if sigma[-1] > RANK * sigma[0]:
                self.take(columns)
            if self.enough():
                return

    def exchange(self, basis: Array) -> None:
        """From the best block on, breadth first: every blocked column in turn takes the place of one that moves."""
        self.take(basis)
        queue, seen = deque([basis]), {tuple(sorted(basis.tolist()))}
        while queue and not self.enough() and len(seen) < LOOKS * (self.m - self.n + 1):
            for other in self._neighbours(queue.popleft()):
                key = tuple(sorted(other.tolist()))
                if key not in seen:
                    seen.add(key)
                    self.take(other)
                    queue.append(other)
                if self.enough():
                    return

    def _neighbours(self, basis: Array) -> Iterator[Array]:
        """For each blocked column the basis in which it replaces the one that moves most, by a sound pivot."""
        factors, pivoted, singular = lapack.dgetrf(self.A[:, basis])
        if singular:
            return
        inverse = lapack.dgetri(factors, pivoted)[0]
        moving, table = np.abs(inverse @ self.b) * self.size[basis], inverse @ self.A
        for j in self._still(basis):
            pivots = np.abs(table[:, j]) * self.size[basis]
            if pivots.max() <= RANK * self.size[j] or not np.isfinite(pivots).all():
                continue
            sound = pivots > SOUND * pivots.max()
            other = basis.copy()
            other[int(np.argmax(np.where(sound, moving, -1.0)))] = j
            yield other

    def complete(self) -> int:
        """Adds one solution and a self-motion each until there are enough; how many.

        Rates that need not all columns leave some blocks without motion: there blocking shows nothing of the space.
        """
        missing = int(self.m - self.n + 1 - len(self.found))
        if missing <= 0:
            return 0
        first, basis = _first_block(self.A, self.b)
        start = self.found[0] if self.found else first
        if not self.found:
            self._new(start)
            missing -= 1
        table = np.linalg.inv(self.A[:, basis]) @ self.A
        length = float(np.abs(start * self.size).max()) or 1.0
        for j in self._still(basis):
            if self.enough():
                break
            turn = np.zeros(self.m)
            turn[j], turn[basis] = 1.0, -table[:, j]
            self._new(start + turn * (length / (float(np.abs(turn * self.size).max()) or 1.0)))
        return missing

    def _new(self, v: Array) -> bool:
        """Keeps v if it is affinely independent of what was found."""
        if not self.found:
            self.found.append(v)
            return True
        off = (v - self.found[0]) * self.size
        long = float(np.linalg.norm(off))
        scale = float(max(np.abs(v * self.size).max(), np.abs(self.found[0] * self.size).max()))
        for _ in range(2):
            off -= self._axes.T @ (self._axes @ off)
        left = float(np.linalg.norm(off))
        if left <= NEW * long or left <= NEW * scale:
            return False
        self._axes = np.vstack((self._axes, off / left))
        self.found.append(v)
        return True


def _independent(A: Array) -> list[int]:
    """Indices of independent rows, those that pivoting takes first."""
    R, order = qr((A * row_scales(A)[:, None]).T, mode="r", pivoting=True, check_finite=False)
    diagonal = np.abs(R.diagonal())
    return sorted(order[: int((diagonal > RANK * diagonal[0]).sum())].tolist())


def _first_block(A: Array, b: Array) -> tuple[Array, Array]:
    """(solution, columns) of the block that pivoting finds."""
    n = len(A)
    scaled = A / np.abs(A).max(axis=1)[:, None]
    columns = np.asarray(qr(scaled, mode="r", pivoting=True, check_finite=False)[1][:n])
    out = np.zeros(A.shape[1])
    out[columns] = np.linalg.solve(A[:, columns], b)
    return out, columns
