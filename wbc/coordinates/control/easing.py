"""Near a locus the task gives way: damping that grows from nothing where a pair is about to lose rank."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import sqrt

import numpy as np

from wbc.coordinates.chains import braked, free_joints
from wbc.coordinates.control.conditioning import LEAST
from wbc.coordinates.control.singular import LeastSingular
from wbc.coordinates.pair import CoordinatePair
from wbc.coordinates.rate_matrices import RateMatrices
from wbc.coordinates.samples import states_of
from wbc.coordinates.scales import scales
from wbc.robot import Robot
from wbc.validation import Array

#: A bound this many times the threshold is above it, whatever rounding did
CLEAR = 1.001
#: A pair is eased below this part of the least singular value that it typically has, and below LEAST at most
PART = 0.1
#: Configurations at which "typically" is looked at
EASED_STATES = 64


@dataclass(frozen=True, eq=False)
class _Part:
    """A pair's share: rows and columns of its matrix, the threshold of sigma, and lambda at most."""

    entries: tuple[Array, Array]
    least: float
    most: float


class Easing:
    """Weight of joint speed beside the task rows, lambda^2, by the least singular value of D_r [J_T; J_C] D_c:

        lambda = most (1 - (sigma / least)^2) for sigma < least, else 0,      most = least / 2

    so that joint speeds stay below 1.3 |v_T| / least, and are zero on the locus itself: a robot that is driven
    at a locus comes to rest there. Constraint rows are not damped; brakes of other arms are left out, as in
    :class:`wbc.coordinates.Adviser`. D_r and D_c take the length of the arm that a row belongs to, see :func:`scales`;
    a stack that counts metres by a greater one has lambda as much smaller.

    The threshold ``least`` of a pair is 0.1 of the median of its sigma over random configurations within the joints'
    limits, so that it means "a tenth of what is usual for this pair of this arm" whatever the arm's size and shape,
    and 0.01 at most: there the joints run a hundred times as fast as the task over the arm's length.

    Args:
        pairs: all that there are. length: by which the stack counts metres [m]. rates: of all coordinates.
        native: singular values in C.

    Source: Y. Nakamura and H. Hanafusa, 1986, "Inverse kinematic solutions with singularity robustness for robot
    manipulator control", for damping that depends on the distance to a singularity.
    """

    def __init__(
        self,
        robot: Robot,
        pairs: Iterable[CoordinatePair],
        length: float,
        rates: RateMatrices,
        *,
        native: bool = True,
    ) -> None:
        self._rates = rates
        rows, columns = scales(robot, rates.row_slices)
        self._scales = rows[:, None] * columns
        self._least = LeastSingular(native=native)
        usual = np.array([self._scales * rates.whole(q) for q in states_of(robot, EASED_STATES)])
        self._parts = {pair.name: self._part(robot, pair, rows, length, usual) for pair in pairs}
        #: The pair, the matrix of all coordinates and how far its singular value was above the threshold
        self._name, self._margin = "", 0.0
        self._matrix, self._change = np.zeros_like(self._scales), np.zeros_like(self._scales)
        self._flat = self._change.ravel()

    def at(self, name: str, every: Array) -> float:
        """lambda^2 of a pair where the rates of all coordinates have the matrix ``every``, which is not copied.

        Singular values are computed only where they may be below the threshold: from one matrix to another none
        changes by more than the Frobenius norm of the difference (H. Weyl, 1912), that of all coordinates' rows for
        any pair's.
        """
        if name == self._name:
            np.subtract(every, self._matrix, out=self._change)
            self._change *= self._scales
            if sqrt(self._flat.dot(self._flat)) < self._margin:
                return 0.0
        part = self._parts[name]
        sigma = self.sigma(name, every)
        self._name, self._matrix, self._margin = name, every, sigma - CLEAR * part.least
        return _weight(sigma, part)

    def sigma(self, name: str, every: Array) -> float:
        """The least singular value of a pair's scaled rows."""
        part = self._parts[name]
        return self._least((self._scales * every)[part.entries])

    def weight(self, name: str, sigma: float) -> float:
        """lambda^2 of a pair with a least singular value."""
        return _weight(sigma, self._parts[name])

    def threshold(self, name: str) -> float:
        """The least singular value below which a pair is eased."""
        return self._parts[name].least

    def _part(self, robot: Robot, pair: CoordinatePair, scale: Array, length: float, usual: Array) -> _Part:
        some, slices = braked(robot, pair), self._rates.row_slices
        task, held = (
            np.r_[tuple(slices[one] for one in part)] if part else np.zeros(0, dtype=int)
            for part in (some.task, some.held)
        )
        rows = np.concatenate((task, held)).astype(int)
        entries = rows[:, None], np.array(free_joints(robot, some.joints))
        sigma = np.linalg.svd(usual[(slice(None), *entries)], compute_uv=False)[:, -1]
        least = min(LEAST, PART * float(np.median(sigma)))
        metres = [1.0 / scale[k] for k in task if self._rates.units[k] == "m"]
        return _Part(entries, least, 0.5 * least * min(1.0, min(metres, default=length) / length))


def _weight(sigma: float, part: _Part) -> float:
    if not sigma < part.least:
        return 0.0
    share = sigma / part.least
    return (part.most * (1.0 - share * share)) ** 2
