"""Whether a swinging arm stays clear of the structure."""

from __future__ import annotations

import ctypes

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.arms.puma import limb_of
from wbc.walking.holds.structure import Structure
from wbc.walking.native import compiled
from wbc.walking.native.compiled import plain_surface

#: Parts of a link at which its distance from the structure is measured
ALONG = (0.25, 0.5, 0.75, 1.0)

Flags = NDArray[np.bool_]


class SwingClearance:
    """Checks of arms, given by their points in the body's frame along a curve.

    Args:
        walker: its limbs, clearance and margins.

    Attributes:
        least: distance of the links that joints move, the hand last, from the structure ``[links]`` [m]. touching: a
            hand that is so near to one of its holds may touch [m].
    """

    def __init__(self, walker: Walker, structure: Structure) -> None:
        self._structure, self._limb = structure, limb_of(walker)
        tolerances, more = walker.tolerances, walker.margins.surface_clearance
        moving = self._limb.links[self._limb.still :]
        self._from, self._to = ([link[end] for link in moving] for end in (0, 1))
        self.least: Array = np.array(self._limb.radii[self._limb.still :]) + tolerances.clearance + more
        self.touching: float = tolerances.exempt_distance + 2 * more

    def structure(self, points: Array, bodies: Array, holds: Array) -> Flags:
        """Whether links are clear of the structure; a hand near a hold may touch.

        Args:
            points: ``[m, n, points, 3]``. bodies: ``[m, n, 4, 4]``, where the bodies are.
            holds: positions of the holds that the hands leave and come to ``[m, 2, 3]`` [m].

        Returns:
            ``[m]``.
        """
        least, touching, library = self.least, self.touching, compiled.library_for(self._limb)
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
        placed = np.einsum("mnij,mnkj->mnki", turn, points) + origin[:, :, None]
        part = np.array(ALONG)[:, None]
        start, end = placed[:, :, self._from, None], placed[:, :, self._to, None]
        along = start + part * (end - start)
        free = self._structure.clearance(along) - least[:, None]
        # As high as it is far, less what it is across, which the curve keeps small
        gap = np.linalg.norm(placed[:, :, self._to[-1], None] - holds[:, None], axis=-1).min(axis=-1)
        free[:, :, -1] = np.where((gap <= touching)[..., None], np.inf, free[:, :, -1])
        return np.asarray((free >= 0.0).all(axis=(1, 2, 3)))

    def height(self, points: Array) -> Array:
        """Distance of points of the structure's frame ``[n, 3]`` from the structure [m]."""
        return self._structure.clearance(points)
