"""The space of all rates that do a task, and what an orthogonal factorisation makes of it."""

from __future__ import annotations

import enum
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import qr

from wbc import validation
from wbc.errors import InfeasibleError, RangeError, ShapeError
from wbc.resolvers.fsp.compiled import NONE, Generated, generated
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
    still = checked_held(held, J.shape[1])
    made = generated("wbc_orthogonal", J, x, still, free) or _orthogonal(J, x, still, free)
    idle = idle_joints(made, J.shape)
    status, missed, reached = consistency(J, x, made, project)
    if status is Consistency.INCONSISTENT:
        made = generated("wbc_orthogonal", J, reached, still, free) or _orthogonal(J, reached, still, free)
    rows = tuple(sorted(made.order[: made.rank]))
    return SolutionSpace(J, reached, made.vectors, rows, idle, status, missed)


def _orthogonal(J: Array, x: Array, held: tuple[int, ...], free: bool) -> Generated:
    """By LAPACK."""
    active = moving_columns(J, held, free)
    if not active:
        return NONE
    scale = row_scales(J[:, active])
    Q, R, order = qr((J[:, active] * scale[:, None]).T, pivoting=True, check_finite=False)
    diagonal = np.abs(R.diagonal())
    rank = int((diagonal > RANK * diagonal[0]).sum())
    vectors = np.zeros((len(active) - rank + 1, J.shape[1]))
    vectors[:, active] = Q[:, :rank] @ np.linalg.solve(R[:rank, :rank].T, (scale * x)[order[:rank]])
    vectors[1:, active] += Q[:, rank:].T
    return Generated(vectors, rank, order.tolist(), active, [])


def consistency(J: Array, x: Array, made: Generated, project: bool) -> tuple[Consistency, float, Array]:
    """(status, what is missed, rates that can be had) of a task with its space.

    Raises:
        InfeasibleError: it is inconsistent and nothing shall be projected.
    """
    if made.rank == len(J):
        return Consistency.FULL, 0.0, x
    J, v = J[:, made.active], made.vectors[0, made.active]
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


def moving_columns(J: Array, held: tuple[int, ...], free: bool) -> list[int]:
    """Joints that are not held, and, if they are not free, whose columns are not zero to working precision; none where
    no column moves.
    """
    sizes = (np.abs(J) * row_scales(J)[:, None]).max(axis=0)
    zero = sizes <= IDLE * sizes.max()
    still = np.zeros_like(zero) if free else zero.copy()
    still[list(held)] = True
    return [] if (still | zero).all() else np.flatnonzero(~still).tolist()


def idle_joints(made: Generated, shape: tuple[int, ...]) -> tuple[int, ...]:
    """Joints that no vector moves.

    Raises:
        RangeError: none is left that does.
    """
    if not made.active:
        raise RangeError("J", shape, "no joint moves the task: every column is zero or held")
    return tuple(sorted(set(range(shape[1])).difference(made.active)))


def _gram(vectors: Array, weight: Array | None) -> Array:
    if weight is None:
        return np.asarray(vectors @ vectors.T)
    return np.asarray((vectors * weight if weight.ndim == 1 else vectors @ weight) @ vectors.T)
