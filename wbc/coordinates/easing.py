"""Near a locus the task gives way: damping that grows from nothing where a pair is about to lose rank."""

from __future__ import annotations

import numpy as np

from wbc.coordinates.conditioning import LEAST
from wbc.coordinates.pair import CoordinatePair
from wbc.coordinates.rate_matrices import RateMatrices
from wbc.robot import Robot
from wbc.validation import Array

#: A bound this many times LEAST is above it, whatever rounding did
CLEAR = 1.001


class Easing:
    """Weight of joint speed beside the task rows, lambda^2, by the least singular value of D_r [J_T; J_C] D_c:

        lambda = least / 2 (1 - (sigma / least)^2) for sigma < least, else 0

    so that joint speeds stay below 1.3 |v_T| / least, and are zero on the locus itself: a robot that is driven
    at a locus comes to rest there. Constraint rows are not damped. See :class:`wbc.coordinates.Conditioning` for D_r
    and D_c, which take the robot's own characteristic length; a stack that counts metres by a greater one has
    lambda as much smaller.

    Source: Y. Nakamura and H. Hanafusa, 1986, "Inverse kinematic solutions with singularity robustness for robot
    manipulator control", for damping that depends on the distance to a singularity.
    """

    def __init__(self, robot: Robot, length: float, rates: RateMatrices) -> None:
        own = robot.characteristic_length
        self._places = rates.places
        self._most = 0.5 * LEAST * min(1.0, own / length)
        rows = np.array([1.0 / own if unit == "m" else 1.0 for unit in rates.units])
        self._scales = rows[:, None] * np.array([own if unit == "m" else 1.0 for unit in robot.dof_units])
        #: The pair, the matrix of all coordinates and the room of the singular value looked at last
        self._pair: CoordinatePair | None = None
        self._matrix, self._room = np.zeros_like(self._scales), 0.0

    def at(self, pair: CoordinatePair, every: Array) -> float:
        """lambda^2 where the rates of all coordinates have the matrix ``every``.

        Singular values are computed only where they may be below LEAST: from one matrix to another none changes by
        more than the Frobenius norm of the difference (H. Weyl, 1912), that of all coordinates' rows for any pair's.
        """
        if pair is self._pair:
            change = (self._scales * (every - self._matrix)).ravel()
            if np.sqrt(change.dot(change)) < self._room:
                return 0.0
        M = self._scales * every
        found = np.linalg.svd(np.vstack([M[self._places[one]] for one in pair.rows]), compute_uv=False)
        sigma = float(found[-1])
        self._pair, self._matrix, self._room = pair, every, sigma - CLEAR * LEAST
        return self.weight(sigma)

    def weight(self, sigma: float) -> float:
        """lambda^2."""
        part = sigma / LEAST
        return (self._most * (1.0 - part * part)) ** 2 if part < 1.0 else 0.0
