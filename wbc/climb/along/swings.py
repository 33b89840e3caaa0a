"""How a limb goes from one foothold to another while the body goes on."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wbc.climb.along.spans import SpanTable
from wbc.climb.chain import library
from wbc.validation import Array

#: Time of a swing at least [s]
LEAST = 0.5
#: Part of a swing in which a contact comes to its height, as ``native/swings.h`` has it [1]
RISING = 0.4
#: How much higher than over its footholds a contact is half-way, as a share of its way
ARCH = 0.04
#: Of a swing: limb, spans that it leaves and comes to, whether it goes straight over, lift and landing
SwingKey = tuple[int, tuple[int, int], bool, int, int]


@dataclass(frozen=True)
class SwingLimits:
    """What swings keep.

    Attributes:
        height: of contacts over what they leave and land on [m].
        rate: share of the joints' velocities. acceleration: share of their accelerations.
    """

    height: float
    rate: float
    acceleration: float


class Swings:
    """Swings of a climber along a track. At x from 0 to 1 the contact is at

        p(x) = p_from + e(x) (p_onto - p_from) + h(x) n(x),   e(x) = 10 x^3 - 15 x^4 + 6 x^5

    with n from one normal to the other and h a height with even accelerations, or at that height over there alone; and
    the angles are those nearest to a polynomial of fifth order from the angles and rates at which one span is left to
    those at which the other is come to. The contact's turn is free on the way.

    Args:
        table: spans of its limbs. limits: of the swings.
    """

    def __init__(self, table: SpanTable, limits: SwingLimits) -> None:
        self.table, self.limits = table, limits
        robot, climber = table.world.climber.robot, table.world.climber
        joints = [climber.joints(limb) for limb in range(len(climber.limbs))]
        self._rates = [limits.rate * robot.limits.velocity[rows] for rows in joints]
        self._pulls = [limits.acceleration * robot.limits.acceleration[rows] for rows in joints]
        self._instant = instant = float(table.track.instants[1])
        self._most = [
            np.concatenate([instant * rate, instant**2 * pull])
            for rate, pull in zip(self._rates, self._pulls, strict=True)
        ]
        self._bodies = np.ascontiguousarray(table.track.places)
        self._code = library()
        self._code.wbc_swing.restype = ctypes.c_double
        #: Joints turn about so far as a contact is lifted: by the height over a quarter of the limb
        self._lifted = [4.0 * limits.height / float(row.length) for row in table.world.limbs.numbers]

    def shortest(self, limb: int, moved: Array) -> Array:
        """About how long swings take whose joints move so far ``(n, k)`` [instants]."""
        size = np.abs(moved)
        even = (1.875 * size / self._rates[limb]).max(axis=-1)
        quick = np.sqrt((5.0 * size + 4.0 / RISING**2 * self._lifted[limb]) / self._pulls[limb]).max(axis=-1)
        return np.asarray(np.maximum(np.maximum(even, quick), LEAST) / self._instant)

    def swung(self, key: SwingKey, ends: Array, parts: int) -> tuple[float, NDArray[np.int32], Array]:
        """How many times longer a swing should be for the limits of its joints, inf where there is none; and instants
        ``(parts + 1)`` with the angles there.

        Args:
            key: which; it goes straight over, or keeps its height alone. ends: angles and rates by instants at lift,
                then at landing ``(4, k)``. parts: in which it is looked at, those near the footholds shorter where they
                are fewer than instants.
        """
        table, (limb, rows, straight, lift, land) = self.table, key
        first, last = (table.world.places[table.limbs[limb].place[row]] for row in rows)
        over = self.limits.height + ARCH * float(np.linalg.norm(last[9:] - first[9:]))
        angles, at = np.empty((parts + 1, ends.shape[1])), np.empty(parts + 1, dtype=np.int32)
        used = self._code.wbc_swing(
            ctypes.byref(table.world.limbs.numbers[limb]), land - lift, parts, _at(self._bodies[lift:]), _at(first),
            _at(last), _at(ends), ctypes.c_double(over), int(straight), _at(self._most[limb]), _at(angles), _at(at),
        )  # fmt: skip
        return float(used), lift + at, angles


def _at(array: NDArray[np.generic]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
