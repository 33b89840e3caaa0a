"""The space of all rates that do a task, and what an orthogonal factorisation makes of it."""

from __future__ import annotations

import enum
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import lapack

from wbc import validation
from wbc.errors import InfeasibleError, RangeError, ShapeError
from wbc.validation import Array

#: A row is dependent where less than this share of it is left after the others
RANK = 1e-10
#: A row below this share of the largest is rounding
NOISE = 1e-14
#: A column is idle below this share of the largest, each row counted against its own size
IDLE = 1e-15
#: What a consistent system may leave of its rates, against the rates themselves
CONSISTENT = 1e-9


class Consistency(enum.StrEnum):
    """What a generator met."""

    FULL = "full rank"
    REDUCED = "dependent rows"
    INCONSISTENT = "inconsistent"


@dataclass(frozen=True, eq=False)
class SolutionSpace:
    """Every v with J v = x, as M - rank + 1 vectors g_i with J g_i = x:

        v = sum_i t_i g_i,   sum_i t_i = 1;        sum_i t_i = 0 gives the self-motions, J v = 0

    Attributes:
        J, x: the task [N, M], [N]; of an inconsistent one x is the nearest rates that can be had.
        vectors: g_i, one a row [K, M].
        rows: indices of independent rows of J that state the whole task.
        idle: joints that no vector moves: columns of zeros, and those that were held.
        status: see :class:`Consistency`. missed: max |J g - x| of what was asked for.
        blocks: for each vector of the published generator the joints that were blocked, beside the idle ones.
        completed: how many vectors, the last ones, are no blocked solutions: where the rates need not all columns,
            blocking finds fewer than M - N + 1 vectors, and the others are one of them and a self-motion.

    Source: F. G. Pin and others, Full Space Parameterization; ORNL/TM-13096, eqs. 6 and 7.
    """

    J: Array
    x: Array
    vectors: Array
    rows: tuple[int, ...]
    idle: tuple[int, ...] = ()
    status: Consistency = Consistency.FULL
    missed: float = 0.0
    blocks: tuple[tuple[int, ...], ...] = ()
    completed: int = 0

    @property
    def rank(self) -> int:
        """Of J, with the idle joints at rest."""
        return len(self.rows)

    @property
    def span(self) -> int:
        """How many vectors there are."""
        return len(self.vectors)

    @cached_property
    def directions(self) -> Array:
        """Self-motions g_i - g_1 [K - 1, M]."""
        return np.asarray(self.vectors[1:] - self.vectors[0])

    @cached_property
    def conditions(self) -> tuple[float, ...]:
        """Condition number of each block that was solved with, rows against their own size."""
        J = self.J[list(self.rows)]
        J = J / np.abs(J).max(axis=1)[:, None]
        still = set(self.idle)
        return tuple(float(np.linalg.cond(np.delete(J, list(still | set(b)), axis=1))) for b in self.blocks)

    def gram(self, weight: Array | None = None) -> Array:
        """G_ij = g_i' H g_j [K, K]; the report's H = B' B with B diagonal (eqs. 10 and 14). ``weight``: H or its
        diagonal.
        """
        return _gram(self.vectors, weight)

    def condition(self, weight: Array | None = None) -> float:
        """Condition number of the Gram matrix, infinite where x = 0 leaves it singular."""
        return float(np.linalg.cond(self.gram(weight)))

    def at(self, t: Any) -> Array:
        """sum t_i g_i [M].

        Raises:
            ShapeError: not K numbers.
        """
        return np.asarray(validation.ordinary_array("t", t, (self.span,)) @ self.vectors)

    def coordinates(self, v: Any) -> tuple[Array, float]:
        """(t, distance): the nearest point of the space has these t, with sum 1, and is so far away."""
        off = validation.ordinary_array("v", v, (self.J.shape[1],)) - self.vectors[0]
        z = np.linalg.lstsq(self.directions.T, off, rcond=None)[0] if self.span > 1 else np.zeros(0)
        return np.concatenate(([1.0 - z.sum()], z)), float(np.linalg.norm(off - z @ self.directions))


def orthogonal(J: Any, x: Any, *, held: Iterable[int] = (), free: bool = False, project: bool = False) -> SolutionSpace:
    """The space by J' = Q R: the least-norm solution, and that plus one orthonormal self-motion each.

    One factorisation; the least-norm solution is orthogonal to all self-motions, and these to each other, so the Gram
    matrix is I + |p|^2 e e' and nothing worse.

    Args:
        J: [N, M]. x: [N]. held: joints that must not move. free: joints with columns of zeros are self-motions of
            their own; else they stand still, as published. project: take the nearest rates of an inconsistent task.

    Raises:
        InfeasibleError: an inconsistent task; ``value`` has its rates. RangeError: no column that moves.
        ShapeError, NotFiniteError: bad input.
    """
    J, x = checked_system(J, x)
    return _orthogonal(J, x, checked_held(held, J.shape[1]), free, project)


def _orthogonal(J: Array, x: Array, held: tuple[int, ...], free: bool, project: bool) -> SolutionSpace:
    """The same without checks."""
    idle, active = split_columns(J, held, free)
    A = J if len(active) == J.shape[1] else J[:, active]
    n, m = A.shape
    scale = row_scales(A)
    factors, pivots, tau, _, _ = lapack.dgeqp3((A * scale[:, None]).T)
    diagonal = np.abs(factors.diagonal())
    rank = int((diagonal > RANK * diagonal[0]).sum()) if diagonal[0] > 0.0 else 0
    order = pivots - 1
    chosen = order[:rank]
    R = factors[:rank, :rank]
    Q = np.zeros((m, m), order="F")
    Q[:, : min(n, m)] = factors[:, : min(n, m)]
    Q = lapack.dorgqr(Q, tau)[0]
    along, _ = lapack.dtrtrs(R, (scale * x)[chosen], trans=1) if rank else (np.zeros(0), 0)
    vectors = np.zeros((m - rank + 1, J.shape[1]))
    vectors[:, active] = Q[:, :rank] @ along
    vectors[1:, active] += Q[:, rank:].T
    status, missed, reached = consistency(A, x, vectors[0, active], rank, project)
    if status is Consistency.INCONSISTENT:
        again = _orthogonal(J, reached, held, free, False)
        return SolutionSpace(J, reached, again.vectors, again.rows, idle, status, missed)
    return SolutionSpace(J, x, vectors, tuple(sorted(chosen.tolist())), idle, status, missed)


def consistency(J: Array, x: Array, v: Array, rank: int, project: bool) -> tuple[Consistency, float, Array]:
    """(status, what is missed, rates that can be had) of a task with a candidate solution; J: of joints that move.

    Raises:
        InfeasibleError: it is inconsistent and nothing shall be projected.
    """
    if rank == len(J):
        return Consistency.FULL, 0.0, x
    off = np.abs(J @ v - x)
    # Each row against its own size, for rows in mm and in rad stand side by side; what moves most counts for all
    scales = row_scales(J)
    norms = 1.0 / np.where(scales > 0.0, scales, 1.0)
    sizes = norms * float(((np.abs(J) @ np.abs(v) + np.abs(x)) / norms).max())
    if (off <= CONSISTENT * sizes).all():
        return Consistency.REDUCED, float(off.max(initial=0.0)), x
    if not project:
        worst = int(np.argmax(off / sizes))
        reason = f"the rates contradict each other: row {worst} depends on others and would miss {off[worst]:.3g}"
        raise InfeasibleError("x", x, reason)
    u, sigma, _ = np.linalg.svd(J / norms[:, None])
    basis = u[:, : int((sigma > RANK * sigma[0]).sum())]
    reached = norms * (basis @ (basis.T @ (x / norms)))
    return Consistency.INCONSISTENT, float(np.abs(reached - x).max()), reached


def checked_system(J: Any, x: Any) -> tuple[Array, Array]:
    """J as a matrix and x as its rates.

    Raises:
        ShapeError, NotFiniteError: they are none, or do not fit.
    """
    J = validation.ordinary_array("J", J)
    if J.ndim != 2 or not J.size:
        raise ShapeError("J", J, "expected a matrix, task rows by joints")
    return J, validation.ordinary_array("x", x, (J.shape[0],))


def checked_held(held: Iterable[int], joints: int) -> tuple[int, ...]:
    """Indices of joints, each once.

    Raises:
        RangeError: no index of a joint, or all of them.
    """
    out = tuple(sorted({validation.integer("held", k, high=joints - 1) for k in held}))
    if len(out) == joints:
        raise RangeError("held", out, "all joints are blocked: none is left to do the task")
    return out


def row_scales(J: Array) -> Array:
    """1 / |row|, and 0 for rows that are rounding beside the others."""
    norms = np.sqrt((J * J).sum(axis=1))
    norms[norms <= NOISE * norms.max()] = np.inf
    return np.asarray(1.0 / norms)


def split_columns(J: Array, held: tuple[int, ...], free: bool) -> tuple[tuple[int, ...], list[int]]:
    """(idle joints, the others): those held, and, if they are not free, columns of zeros to working precision.

    Raises:
        RangeError: none is left.
    """
    sizes = (np.abs(J) * row_scales(J)[:, None]).max(axis=0)
    zero = sizes <= IDLE * sizes.max()
    still = np.zeros_like(zero) if free else zero.copy()
    still[list(held)] = True
    if (still | zero).all():
        raise RangeError("J", J.shape, "no joint moves the task: every column is zero or held")
    return tuple(np.flatnonzero(still).tolist()), np.flatnonzero(~still).tolist()


def _gram(vectors: Array, weight: Array | None) -> Array:
    if weight is None:
        return np.asarray(vectors @ vectors.T)
    return np.asarray((vectors * weight if weight.ndim == 1 else vectors @ weight) @ vectors.T)
