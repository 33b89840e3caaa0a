"""Configurations at which generic ranks are looked at, and what a rank is in floating-point numbers."""

from __future__ import annotations

import numpy as np

from wbc.robot import Robot
from wbc.robot.sampling import configuration, draw
from wbc.validation import Array

#: Part of the largest singular value below which one is zero. Entries of a Jacobian come from products of a few dozen
#: rotations, so they are off by some 1e-15 of the largest; a rank that no rounding makes has a singular value that is
#: many powers of ten above. Being a ratio, it does not depend on units, on the arm's size or on rows' common scale.
ROUNDING = 1e-9


def states_of(robot: Robot, count: int, seed: int = 0) -> Array:
    """Configurations uniform within the joints' limits, a turn where there is none; the base stays [count, nq]."""
    return np.array([configuration(robot, step) for step in draw(robot, count, np.random.default_rng(seed))])


def ranks(matrices: Array) -> Array:
    """Rank of each matrix [...]: singular values above :data:`ROUNDING` of the largest, or of 1 where that is more.

    Rows are scaled by the arm's length; those that are zero but for rounding have no rank among themselves.
    """
    sigma = np.linalg.svd(matrices, compute_uv=False)
    return np.asarray((sigma > ROUNDING * np.maximum(sigma[..., :1], 1.0)).sum(axis=-1))


def rank(matrices: Array) -> int:
    """The rank that almost all configurations have: the largest of some."""
    return int(ranks(matrices).max(initial=0)) if matrices.size else 0
