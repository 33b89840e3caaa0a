"""Soft constraints and scaled tasks by another way than the package's: bounded least squares of their stated costs.

A soft row costs p (x / r)^2 for its violation x, so the rows that are violated at the optimum are task rows there: the
set of them is found by repetition, and a set that reproduces itself is the optimum of the convex whole. A scaled task
has the variable lambda. Jacobians are Pinocchio's, and scipy's method for bounded variables solves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from tests.models import frame_jacobian, placement
from wbc.robot import Robot

Array = NDArray[np.float64]

#: Price of a direction against the weight of its task, as docs/soft.md says
DIRECTION = 1e6
#: Cost of the other variables, as docs/controller.md says
DAMPING = 1e-8


def jacobian(robot: Robot, q: Array, frame: str) -> tuple[Array, Array]:
    """Place of a frame's origin, and its derivative along v."""
    return placement(robot, frame, q).translation, frame_jacobian(robot, frame, q)[:3]


@dataclass(frozen=True)
class Wish:
    """J v = w at a weight a row, whose scale is in it; ``scaled``: J v = lambda w."""

    J: Array
    w: Array
    weight: float
    scaled: bool = False


@dataclass(frozen=True)
class Soft:
    """lower <= A v <= upper at a price a row, whose scale is in it."""

    A: Array
    lower: Array
    upper: Array
    price: float


def optimum(low: Array, high: Array, wishes: list[Wish], rows: list[Soft]) -> tuple[Array, list[float]]:
    """The velocities, and lambda of every scaled wish."""
    n, count = low.size, sum(wish.scaled for wish in wishes)
    blocks, rights = [np.sqrt(DAMPING) * np.eye(n + count)], [np.zeros(n + count)]

    def put(J: Array, idle: Array, w: Array, cost: float) -> None:
        """Rows over (v, mu) at a cost."""
        blocks.append(np.sqrt(cost) * np.hstack((J, idle)))
        rights.append(np.sqrt(cost) * w)

    place = n
    for wish in wishes:
        put(wish.J, np.zeros((len(wish.w), count)), wish.w, wish.weight)
        if wish.scaled:
            idle = np.zeros((len(wish.w), count))
            idle[:, place - n] = wish.w
            put(wish.J, idle, wish.w, DIRECTION * wish.weight)
            place += 1
    A = np.vstack([np.zeros((0, n)), *[row.A for row in rows]])
    lower, upper = (np.concatenate([np.zeros(0), *[getattr(r, side) for r in rows]]) for side in ("lower", "upper"))
    price = np.concatenate([np.zeros(0), *[np.full(len(r.A), r.price) for r in rows]])
    ends = np.concatenate((low, np.zeros(count))), np.concatenate((high, np.ones(count)))
    side = np.zeros(len(A))
    for _ in range(50):
        on = side != 0.0
        cost = np.sqrt(price[on])[:, None]
        violated = cost * np.hstack((A[on], np.zeros((int(on.sum()), count))))
        target = cost[:, 0] * np.where(side > 0.0, upper, lower)[on]
        found = lsq_linear(
            np.vstack((*blocks, violated)), np.concatenate((*rights, target)), ends, method="bvls", tol=1e-15
        )
        at = A @ found.x[:n]
        now = np.where(at > upper, 1.0, np.where(at < lower, -1.0, 0.0))
        if (now == side).all():
            return found.x[:n], [float(1.0 - mu) for mu in found.x[n:]]
        side = now
    raise AssertionError("the violated rows do not settle")
