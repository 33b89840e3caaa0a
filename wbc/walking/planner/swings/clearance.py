"""Whether an arm that moves stays clear of the structure, for motions that are no swings between two holds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.around import around

Flags = NDArray[np.bool_]


class SwingClearance:
    """Checks of arms, given by their points in the body's frame along a curve.

    Args:
        walker: its limbs, clearance and margins.

    Attributes:
        touching: a hand that is so near to one of its holds may touch [m].
    """

    def __init__(self, walker: Walker, structure: Structure) -> None:
        self._around = around(walker, structure)
        self.touching: float = self._around.near_hold

    def structure(self, points: Array, bodies: Array, holds: Array) -> Flags:
        """Whether links are clear of the structure; a hand near a hold may touch.

        Args:
            points: ``[m, n, points, 3]``. bodies: ``[m, n, 4, 4]``, where the bodies are.
            holds: positions of the holds that the hands leave and come to ``[m, 2, 3]`` [m].

        Returns:
            ``[m]``.
        """
        limb, it = self._around.limb, self._around
        turn, origin = bodies[..., :3, :3], bodies[..., :3, 3]
        placed = np.einsum("mnij,mnkj->mnki", turn, points) + origin[:, :, None]
        gap = np.linalg.norm(placed[:, :, limb.links[-1][1], None] - holds[:, None], axis=-1).min(axis=-1)
        clear = np.ones(len(points), dtype=np.bool_)
        for link in range(limb.still, len(limb.links)):
            a, b = (placed[:, :, end] for end in limb.links[link])
            free = it.structure.segment_clearance(a, b) - it.from_surface[link]
            if link == len(limb.links) - 1:
                free = np.where(gap <= self.touching, np.inf, free)
            clear &= (free >= 0.0).all(axis=1)
        return clear

    def height(self, points: Array) -> Array:
        """Distance of points of the structure's frame ``[n, 3]`` from the structure [m]."""
        return self._around.height(points)
