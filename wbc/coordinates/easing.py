"""Near a locus the task gives way: damping that grows from nothing where a pair is about to lose rank."""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np

from wbc.coordinates import expressions
from wbc.coordinates.conditioning import LEAST
from wbc.coordinates.pair import CoordinatePair
from wbc.coordinates.rows import Coordinate
from wbc.robot import Robot
from wbc.validation import Array


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

    def __init__(self, robot: Robot, length: float) -> None:
        self._robot, self._length = robot, robot.characteristic_length
        self._most = 0.5 * LEAST * min(1.0, robot.characteristic_length / length)
        self._dofs = np.array([self._length if unit == "m" else 1.0 for unit in robot.dof_units])
        self._known: dict[CoordinatePair, tuple[ca.Function, Array, tuple[slice, ...]]] = {}

    def rates(self, pair: CoordinatePair, q: Array) -> tuple[float, dict[Coordinate, Array]]:
        """(the least singular value of a pair, the matrix of each of its coordinates) at a configuration, unchecked."""
        if pair not in self._known:
            rows = [expressions.labels(self._robot, one) for one in pair.rows]
            scale = np.array([1.0 / self._length if row.unit == "m" else 1.0 for some in rows for row in some])
            ends = np.cumsum([0, *map(len, rows)]).tolist()
            places = tuple(slice(a, b) for a, b in pairwise(ends))
            function = expressions.rate_function(self._robot, pair.rows)
            self._known[pair] = function, scale[:, None] * self._dofs, places
        function, scales, places = self._known[pair]
        J = np.asarray(function(q).full())
        sigma = float(np.linalg.svd(scales * J, compute_uv=False)[-1])
        return sigma, {one: J[place] for one, place in zip(pair.rows, places, strict=True)}

    def weight(self, sigma: float) -> float:
        """lambda^2."""
        part = sigma / LEAST
        return (self._most * (1.0 - part * part)) ** 2 if part < 1.0 else 0.0
