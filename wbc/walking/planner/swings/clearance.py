"""Whether a swinging arm stays clear: of the structure, of the other arms, and of the rest of its own body."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.holds.structure import Structure
from wbc.walking.native import compiled
from wbc.walking.native.compiled import plain_surface
from wbc.walking.planner.grips.conflicts import ROOM, ArmClearance
from wbc.walking.planner.grips.table import Ints

#: Parts of upper arm, forearm and hand at which their distance from the structure is measured
ALONG = (0.25, 0.5, 0.75, 1.0)
#: What is kept of the distance from the structure for feedback, besides the clearance [m]
ROOM_BELOW = 0.0005
#: The same of the distance from other arms; arms that hold keep more
SWING_ROOM = 0.006

Flags = NDArray[np.bool_]


class SwingClearance:
    """Checks of swings, given by the arm's points O N S E W H in the body's frame at the points of its way.

    Args:
        walker: its capsules and clearance. arms: for points and distances of arms, those that hold too.

    Attributes:
        least: distance of upper arm, forearm and hand from the structure ``[3]`` [m]. touching: a hand that is so near
            to one of its holds may touch [m].
    """

    def __init__(self, walker: Walker, structure: Structure, arms: ArmClearance) -> None:
        self._structure, self._arms = structure, arms
        data: Any = walker.data
        radii = np.array([data.upper_arm_radius, data.forearm_radius, data.hand_radius])
        self.least: Array = radii + data.clearance + ROOM_BELOW
        self.touching: float = data.exempt_distance + 2 * ROOM_BELOW

    def structure(self, points: Array, bodies: Array, holds: Array) -> Flags:
        """Whether upper arms, forearms and hands are clear of the structure; a hand near a hold may touch.

        Args:
            points: ``[m, n, 6, 3]``. bodies: ``[m, n, 4, 4]``, where the bodies are.
            holds: places of the holds that the hands leave and come to ``[m, 2, 3]`` [m].

        Returns:
            ``[m]``.
        """
        least, touching, library = self.least, self.touching, compiled.library()
        surface = plain_surface(self._structure)
        if library is not None and surface is not None:
            out = np.empty(len(points), dtype=np.bool_)
            given = [compiled.packed(array) for array in (points, bodies, holds, ALONG, least)]
            where = [compiled.at(array) for array in given]
            library.stay_above(
                surface,
                *(ctypes.c_long(size) for size in points.shape[:2]),
                *where[:4],
                ctypes.c_long(len(ALONG)),
                where[4],
                ctypes.c_double(touching),
                compiled.at(out),
            )
            return out
        turn, origin = bodies[..., :3, :3], bodies[..., :3, 3]
        placed = np.einsum("mnij,mnkj->mnki", turn, points[:, :, 2:]) + origin[:, :, None]
        part = np.array(ALONG)[:, None]
        start, end = placed[:, :, :3, None], placed[:, :, 1:, None]
        along = start + part * (end - start)
        room = self._structure.clearance(along) - least[:, None]
        # As high as it is far, less what it is across, which the curve keeps small
        gap = np.linalg.norm(placed[:, :, 3, None] - holds[:, None], axis=-1).min(axis=-1)
        room[:, :, 2] = np.where((gap <= touching)[..., None], np.inf, room[:, :, 2])
        return np.asarray((room >= 0.0).all(axis=(1, 2, 3)))

    def room(self, points: Array) -> Array:
        """Distance of points of the structure's frame ``[n, 3]`` from the structure [m]."""
        return self._structure.clearance(points)

    def others(self, points: Array, samples: Array, others: Ints) -> Flags:
        """Whether swinging arms stay clear of arms that hold: grips ``others`` ``[m]`` at ``samples`` ``[m, n]``."""
        return self._arms.stay_clear(points, samples, others, ROOM - SWING_ROOM)

    @property
    def apart(self) -> Array:
        """Distances of all pairs of links but that of the necks, of a swinging arm and one that holds ``[15]`` [m]."""
        out: Array = self._arms.least - (ROOM - SWING_ROOM)
        return out
