"""Whether a swinging arm stays clear: of the structure, of the other arms, and of the rest of its own body."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.arm_clearance import ROOM, ArmClearance
from wbc.walking.grips import Grips, Ints
from wbc.walking.structure import Structure

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
        walker: its capsules and clearance. grips: those of the arms that hold. arms: for points and distances of arms.
    """

    def __init__(self, walker: Walker, structure: Structure, grips: Grips, arms: ArmClearance) -> None:
        self._structure, self._grips, self._arms, self._data = structure, grips, arms, walker.data

    def structure(self, points: Array, bodies: Array, holds: Array) -> Flags:
        """Whether upper arms, forearms and hands are clear of the structure; a hand near a hold may touch.

        Args:
            points: ``[m, n, 6, 3]``. bodies: ``[m, n, 4, 4]``, where the bodies are.
            holds: places of the holds that the hands leave and come to ``[m, 2, 3]`` [m].

        Returns:
            ``[m]``.
        """
        data = self._data
        turn, origin = bodies[..., :3, :3], bodies[..., :3, 3]
        placed = np.einsum("mnij,mnkj->mnki", turn, points[:, :, 2:]) + origin[:, :, None]
        part = np.array(ALONG)[:, None]
        start, end = placed[:, :, :3, None], placed[:, :, 1:, None]
        along = start + part * (end - start)
        radii = np.array([data.upper_arm_radius, data.forearm_radius, data.hand_radius])  # type: ignore[union-attr]
        room = self._structure.clearance(along) - radii[:, None] - data.clearance - ROOM_BELOW  # type: ignore[union-attr]
        room[:, :, 2] = np.where(self._near(placed[:, :, 3], holds)[..., None], np.inf, room[:, :, 2])
        out: Flags = (room >= 0.0).all(axis=(1, 2, 3))
        return out

    def room(self, points: Array) -> Array:
        """Distance of points of the structure's frame ``[n, 3]`` from the structure [m]."""
        return self._structure.clearance(points)

    def others(self, points: Array, samples: Array, others: Ints) -> Flags:
        """Whether swinging arms stay clear of arms that hold: grips ``others`` ``[m]`` at ``samples`` ``[m, n]``."""
        count, steps = samples.shape
        postures = self._grips.between(others[:, None], samples)
        held = np.empty_like(points)
        for arm in np.unique(self._grips.arm[others]):
            rows = self._grips.arm[others] == arm
            held[rows] = self._arms.points(int(arm), postures[rows])
        near = self._arms.near(points.reshape(-1, 6, 3), held.reshape(-1, 6, 3), ROOM - SWING_ROOM)
        out: Flags = ~np.any(near.reshape(count, steps), axis=1)
        return out

    def _near(self, hands: Array, holds: Array) -> Flags:
        """Whether hands ``[m, n, 3]`` are so near to their holds that they may touch what these stand on."""
        gap = np.linalg.norm(hands[:, :, None] - holds[:, None], axis=-1).min(axis=-1)
        # As high as it is far, less what it is across, which the curve keeps small
        out: Flags = gap <= self._data.exempt_distance + 2 * ROOM_BELOW  # type: ignore[union-attr]
        return out
