"""Least squares over positive definite matrices, near given ones: convex, so that what is found is the best there is.

    minimise  |R x - z|^2 / 2 + weight sum_k d(P_k, Q_k),   d(P, Q) = tr(Q^-1 P) - log det(Q^-1 P) - n

P_k: symmetric, linear in its share of x; Q_k: what it is without data; d is 0 at P = Q and infinite where P ceases to
be positive definite. The weight comes down to its last value, by Newton steps at each. With P = U U' and
P + dP = U (1 + E) U' a step is the Tikhonov problem  |J e + r|^2 + weight |e + c|^2  over the entries e of E, whose
normal equations are never formed, and it goes to the least along its line.
Sources: Wensing, Kim and Slotine 2018, Linear matrix inequalities for physically consistent inertial parameter
identification; Lee, Wensing and Park 2020, Geometric robot dynamic identification: a convex programming approach.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.linalg import qr, solve_triangular
from scipy.optimize import brentq

from wbc.validation import Array

#: The weight comes down by this factor at a time
FALL = 0.1
#: Newton steps at most at each weight
STEPS = 50
#: Decrement, per weight, at which they end: what is left is that much of d
SETTLED = 1e-6
#: Part of the way to where a matrix ceases to be positive definite that a step goes at most
INSIDE = 0.999


class SemidefiniteCone:
    """One positive definite matrix of the problem.

    Args:
        columns: its share of x. entries: vec P as a linear function of that share ``[n n, columns]``, whose images are
            symmetric. near: Q ``[n, n]``.
    """

    def __init__(self, columns: slice, entries: Array, near: Array) -> None:
        self.columns = columns
        self._share = np.linalg.pinv(entries)
        self._near = np.linalg.cholesky(near)
        self._one = np.eye(len(near))
        self._factor = self._near

    @property
    def x(self) -> Array:
        """Its share of x: that of P = U U'."""
        return np.asarray(self._share @ (self._factor @ self._factor.T).ravel())

    def around(self) -> tuple[Array, Array]:
        """(dx / de ``[columns, n n]``, c ``[n n]``) where x is."""
        turned = np.linalg.solve(self._near, self._factor)
        slopes = np.asarray(self._share @ np.kron(self._factor, self._factor))
        return slopes, (turned.T @ turned - self._one).ravel()

    def stretches(self, e: Array) -> Array:
        """Eigenvalues of E ``[n]``; P stays positive definite as long as 1 plus them is above 0."""
        return np.asarray(np.linalg.eigvalsh(e.reshape(self._one.shape)))

    def move(self, e: Array) -> None:
        """Multiply by 1 + E from within."""
        self._factor = self._factor @ np.linalg.cholesky(self._one + e.reshape(self._one.shape))


def least_squares(R: Array, z: Array, cones: Sequence[SemidefiniteCone], weight: float) -> Array:
    """x of the least; columns that belong to no cone are 0."""
    x = np.zeros(R.shape[1])
    for cone in cones:
        x[cone.columns] = cone.x
    now = max(float(np.sum((R @ x - z) ** 2)), weight)
    while True:
        before = np.inf
        for _ in range(STEPS):
            decrement = _step(R, z, cones, x, now)
            # This near each step halves it, but for rounding
            if decrement <= SETTLED * now or (before < now and decrement > 0.5 * before):
                break
            before = decrement
        if now <= weight:
            return x
        now = max(FALL * now, weight)


def _step(R: Array, z: Array, cones: Sequence[SemidefiniteCone], x: Array, weight: float) -> float:
    """One step of Newton's, into x and the cones; its decrement."""
    parts = [cone.around() for cone in cones]
    turned = np.hstack([R[:, cone.columns] @ slope for cone, (slope, _) in zip(cones, parts, strict=True)])
    c = np.concatenate([part for _, part in parts])
    r, root = R @ x - z, np.sqrt(weight)
    rows = np.vstack([turned, root * np.eye(len(c))])
    # By rows that fall off and columns that are pivoted, Householder's is exact by rows: the small ones count
    Q, triangle, order = qr(rows, mode="economic", pivoting=True)
    e = np.empty(len(c))
    e[order] = solve_triangular(triangle, -Q.T @ np.concatenate([r, root * c]))
    ends = np.cumsum([0, *(len(part) for _, part in parts)])
    steps = [e[low:high] for low, high in pairwise(ends)]
    stretches = np.concatenate([cone.stretches(step) for cone, step in zip(cones, steps, strict=True)])
    moved = turned @ e
    decrement = float(moved @ moved + weight * (e @ e))

    def slope_at(t: float) -> float:
        bent = stretches.sum() + c @ e - (stretches / (1.0 + t * stretches)).sum()
        return float(moved @ r + t * (moved @ moved) + weight * bent)

    least = float(stretches.min())
    t = min(1.0, INSIDE / -least) if least < 0.0 else 1.0
    if slope_at(t) > 0.0 > slope_at(0.0):
        t = float(brentq(slope_at, 0.0, t))
    for cone, step in zip(cones, steps, strict=True):
        cone.move(t * step)
        x[cone.columns] = cone.x
    return decrement
