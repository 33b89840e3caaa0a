"""Strict levels of least squares by another way than the package's: a primal active-set method on each level.

At a feasible z the steepest direction of descent that no tight row forbids is what non-negative least squares leaves of
the negative gradient (Moreau); on the face of the rows that carry a multiplier the minimiser is one ``lstsq``. The
method ends where the projection is zero, which is the proof of optimality. Slow, and exact to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

Array = NDArray[np.float64]

#: Singular values below this are null
NULL = 1e-9
TIGHT = 1e-10


@dataclass(frozen=True)
class Goal:
    """|rows x - b|^2 of a level, and the general rows whose violation is minimised with weight 1."""

    rows: Array
    b: Array
    soft: NDArray[np.intp]


def hierarchy(x: Array, lower: Array, upper: Array, A: Array, goals: list[Goal]) -> Array:
    """The lexicographic optimum that is shortest, from a feasible x."""
    n = x.size
    C = np.vstack((np.eye(n), A))
    soft = {n + int(k) for goal in goals for k in goal.soft}
    on = [i for i in range(C.shape[0]) if i not in soft and lower[i] < upper[i]]
    space = null(C[[i for i in range(C.shape[0]) if i not in soft and lower[i] == upper[i]]])
    low, high = lower.copy(), upper.copy()
    for goal in [*goals, Goal(np.eye(n), np.zeros(n), np.zeros(0, dtype=np.intp))]:
        ks = [n + int(k) for k in goal.soft]
        f, s = space.shape[1], len(ks)
        B = np.vstack((np.hstack((goal.rows @ space, np.zeros((len(goal.b), s)))), np.eye(f + s)[f:]))
        r = np.concatenate((goal.b - goal.rows @ x, np.zeros(s)))
        G, h = sides(C, low, high, x, space, on, s)
        if s:
            extra, limit = sides(C, low, high, x, space, ks, 0)
            slack = np.zeros((extra.shape[0], s))
            for row, i in enumerate([i for i in ks for end in (low, high) if np.isfinite(end[i])]):
                slack[row, ks.index(i)] = -1.0 if extra[row] @ space.T @ C[i] >= 0 else 1.0
            G, h = np.vstack((G, np.hstack((extra, slack)))), np.concatenate((h, limit))
        at = C[ks] @ x
        begin = np.zeros(f + s)
        begin[f:] = np.maximum(0.0, at - high[ks]) - np.maximum(0.0, low[ks] - at)
        z = least(B, r, G, h, begin)
        x = x + space @ z[:f]
        kept = np.vstack((goal.rows, C[[i for i, v in zip(ks, z[f:], strict=True) if abs(v) > 1e-8]]))
        on += ks
        at = C[on] @ x
        low[on], high[on] = np.minimum(low[on], at), np.maximum(high[on], at)
        space = space @ null(kept @ space)
    return x


def null(rows: Array) -> Array:
    """Orthonormal basis of the null space."""
    if not rows.size:
        return np.eye(rows.shape[1])
    _, sigma, directions = np.linalg.svd(rows)
    return np.asarray(directions[int((sigma > NULL).sum()) :].T)


def sides(
    C: Array, low: Array, high: Array, x: Array, space: Array, rows: list[int], extra: int
) -> tuple[Array, Array]:
    """G z <= h of some rows, in the space; zeros for ``extra`` variables."""
    G, h = [], []
    for i in rows:
        local, at = C[i] @ space, C[i] @ x
        for sign, end in ((-1.0, low[i]), (1.0, high[i])):
            if np.isfinite(end):
                G.append(sign * local)
                h.append(sign * (end - at))
    return np.hstack((np.reshape(G, (len(h), space.shape[1])), np.zeros((len(h), extra)))), np.array(h)


def least(B: Array, r: Array, G: Array, h: Array, z: Array) -> Array:
    """z of the least |B z - r| over G z <= h, from a feasible one."""
    lengths = np.linalg.norm(G, axis=1)
    moves = lengths > 1e-12
    G, h = G[moves] / lengths[moves, None], h[moves] / lengths[moves]
    if not z.size:
        return z
    scale = 1.0 + float(np.abs(B.T @ r).max(initial=0.0))
    for _ in range(1000):
        descent = -B.T @ (B @ z - r)
        tight = np.flatnonzero(h - G @ z <= TIGHT)
        forces = nnls(G[tight].T, descent)[0] if tight.size else np.zeros(0)
        rest = descent - G[tight].T @ forces
        if np.abs(rest).max() <= 1e-12 * scale:
            return z
        # to the minimiser of the face, or along the projection where the face has none that is lower
        face = null(G[tight[forces > 0.0]])
        step = face @ np.linalg.lstsq(B @ face, r - B @ z, rcond=NULL)[0]
        blocked = G[tight] @ step > 1e-14
        blocked[forces > 0.0] = False
        if blocked.any() or step @ descent <= 0.0:
            step = rest * (rest @ rest) / max(float((B @ rest) @ (B @ rest)), 1e-300)
        speed = G @ step
        closing = speed > 1e-14
        closing[tight] &= speed[tight] > 1e-9 * np.abs(step).max()
        room = np.maximum(h - G @ z, 0.0)
        z = z + min(1.0, float((room[closing] / speed[closing]).min(initial=1.0))) * step
    raise AssertionError("the reference did not converge")
