"""Balls and corners whose hull is what a link touches with."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from wbc.multibody import pin
from wbc.robot.geometry.meshes import spread_directions
from wbc.shapes.solid import Solid
from wbc.validation import Array

#: Directions in which balls are sampled [1]
DIRECTIONS = 1500
#: How much less exact than the one before a hull is tried that has too many corners [1]
COARSER = 1.5


@dataclass(frozen=True)
class LinkBalls:
    """Balls whose hull is what a link touches with; corners of meshes have the radius 0.

    Attributes:
        centers: in the frame of the joint that carries them [balls, 3] [m]. radii: [balls] [m].
    """

    centers: Array
    radii: Array

    @classmethod
    def of(cls, shape: Solid) -> LinkBalls:
        """Those of a shape in its own frame: the ends of a ball or a capsule, else corners of its surface."""
        *ends, radius = shape.capsule() if shape.is_round else (*shape.triangles().reshape(-1, 3), 0.0)
        return cls(np.array(ends), np.full(len(ends), radius))

    @classmethod
    def joined(cls, parts: Iterable[LinkBalls]) -> LinkBalls:
        """All of them as one, of none where there are none."""
        every = [cls(np.zeros((0, 3)), np.zeros(0)), *parts]
        return cls(np.concatenate([own.centers for own in every]), np.concatenate([own.radii for own in every]))

    @property
    def middle(self) -> Array:
        """Of the box around them."""
        radii = self.radii[:, None]
        return np.asarray(0.5 * ((self.centers - radii).min(axis=0) + (self.centers + radii).max(axis=0)))

    def moved(self, placement: pin.SE3) -> LinkBalls:
        """The same in another frame, in which this one is placed so."""
        return LinkBalls(self.centers @ np.asarray(placement.rotation).T + placement.translation, self.radii)

    def corners(self, count: int, exact: float) -> Array:
        """Points whose hull is that of the balls; at most ``count``, to ``exact`` [m] where so many can be."""
        ways = spread_directions(DIRECTIONS) * np.array([1.0, -1.0, 1.0])
        far = (self.centers @ ways.T + self.radii[:, None]).argmax(axis=0)
        points = self.centers[far] + ways * self.radii[far, None]
        # All corners and what stands out of them of the balls, where that is not too much
        every = np.unique(np.concatenate([self.centers[self.radii == 0.0], points[self.radii[far] > 0.0]]), axis=0)
        chosen = every
        with contextlib.suppress(QhullError):
            while len(chosen) > count:
                chosen, exact = every[ConvexHull(every, qhull_options=f"W{exact}").vertices], COARSER * exact
        return chosen
