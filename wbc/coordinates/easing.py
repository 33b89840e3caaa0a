"""Near a locus the task gives way: damping that grows from nothing where a pair is about to lose rank."""

from __future__ import annotations

import numpy as np

from wbc.coordinates.chains import braked, free_joints
from wbc.coordinates.conditioning import LEAST
from wbc.coordinates.pair import CoordinatePair
from wbc.coordinates.rate_matrices import RateMatrices
from wbc.coordinates.scales import scales
from wbc.coordinates.singular import LeastSingular
from wbc.robot import Robot
from wbc.validation import Array

#: A bound this many times LEAST is above it, whatever rounding did
CLEAR = 1.001


class Easing:
    """Weight of joint speed beside the task rows, lambda^2, by the least singular value of D_r [J_T; J_C] D_c:

        lambda = least / 2 (1 - (sigma / least)^2) for sigma < least, else 0

    so that joint speeds stay below 1.3 |v_T| / least, and are zero on the locus itself: a robot that is driven
    at a locus comes to rest there. Constraint rows are not damped; brakes of other arms are left out, as in
    :class:`wbc.coordinates.Adviser`. D_r and D_c take the length of the arm that a row belongs to, see :func:`scales`;
    a stack that counts metres by a greater one has lambda as much smaller.

    Args:
        length: by which the stack counts metres [m]. rates: of all coordinates. native: singular values in C.

    Source: Y. Nakamura and H. Hanafusa, 1986, "Inverse kinematic solutions with singularity robustness for robot
    manipulator control", for damping that depends on the distance to a singularity.
    """

    def __init__(self, robot: Robot, length: float, rates: RateMatrices, *, native: bool = True) -> None:
        self._robot, self._rates, self._length = robot, rates, length
        self._rows, columns = scales(robot, rates.places)
        self._scales = self._rows[:, None] * columns
        self._least = LeastSingular(native=native)
        #: Of each pair: rows and columns of its matrix, and lambda at most
        self._parts: dict[int, tuple[CoordinatePair, tuple[Array, Array], float]] = {}
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
        _, part, most = self._part(pair)
        sigma = self._least((self._scales * every)[part])
        self._pair, self._matrix, self._room = pair, every, sigma - CLEAR * LEAST
        return _weight(sigma, most)

    def weight(self, pair: CoordinatePair, sigma: float) -> float:
        """lambda^2 of a pair with a least singular value."""
        return _weight(sigma, self._part(pair)[2])

    def _part(self, pair: CoordinatePair) -> tuple[CoordinatePair, tuple[Array, Array], float]:
        # By identity: to compare declarations costs more than all else. The pair is kept, so its number stays its own
        found = self._parts.get(id(pair))
        if found is None:
            some = braked(self._robot, pair)
            task, held = (
                np.r_[tuple(self._rates.places[one] for one in side)] if side else [] for side in (some.task, some.held)
            )
            rows = np.concatenate((task, held)).astype(int)
            metres = [1.0 / self._rows[k] for k in task if self._rates.units[k] == "m"]
            most = 0.5 * LEAST * min(1.0, min(metres, default=self._length) / self._length)
            found = pair, (rows[:, None], np.array(free_joints(self._robot, some.joints))), most
            self._parts[id(pair)] = found
        return found


def _weight(sigma: float, most: float) -> float:
    part = sigma / LEAST
    return (most * (1.0 - part * part)) ** 2 if part < 1.0 else 0.0
