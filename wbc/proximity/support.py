"""Support functions: how far shapes reach along a direction, and what that says about the distance of two of them.

For bodies A and B and any unit direction n from A to B

    clearance(n) = -h_A(n) - h_B(-n) <= distance,     equal for the common normal,

where h_A(n) is the largest n'x of the points x of A. It is how far the two must be moved together (overlapping:
apart) along n until they touch, so it proves a normal right or wrong, whoever found it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.proximity.scene import Index
from wbc.shapes import Box, Capsule, Convex, Cylinder, HalfSpace, Shape, Sphere
from wbc.validation import Array

#: Faces that a direction is this nearly normal to count as flat to it.
FLAT = 1e-9


class Supports:
    """Support functions of some shapes, each about its ``center``.

    Every shape but a hull is a sum of a ball, a box and a disc across z, so that one formula serves all:
    h(n) = ball + box'|n| + disc sqrt(nx^2 + ny^2).
    """

    def __init__(self, shapes: Sequence[Shape], centers: Sequence[Array]) -> None:
        self.ball, self.disc = np.zeros(len(shapes)), np.zeros(len(shapes))
        self.box = np.zeros((len(shapes), 3))
        self.hulls: dict[int, Array] = {}
        for k, shape in enumerate(shapes):
            if isinstance(shape, (Sphere, Capsule)):
                self.ball[k] = shape.radius
            if isinstance(shape, (Capsule, Cylinder)):
                self.box[k, 2] = shape.length / 2
            if isinstance(shape, Cylinder):
                self.disc[k] = shape.radius
            if isinstance(shape, Box):
                self.box[k] = np.array(shape.size) / 2
            if isinstance(shape, Convex):
                self.hulls[k] = shape.points - centers[k]
            if isinstance(shape, HalfSpace):
                self.ball[k] = np.inf
        self.is_hull = np.array([k in self.hulls for k in range(len(shapes))])

    def reach(self, which: Index, direction: Array) -> Array:
        """h of the shapes ``which`` [n] along unit directions in their own axes [n x 3]; inf for a half-space."""
        out: Array = self.ball[which] + np.einsum("ij,ij->i", self.box[which], np.abs(direction))
        out += self.disc[which] * np.hypot(direction[:, 0], direction[:, 1])
        for row in np.flatnonzero(self.is_hull[which]):
            out[row] = (self.hulls[int(which[row])] @ direction[row]).max()
        return out

    def point(self, which: int, direction: Array) -> Array:
        """A point of the shape that reaches farthest along a direction in its own axes; the middle of a flat face."""
        if which in self.hulls:
            points = self.hulls[which]
            height = points @ direction
            near = height >= height.max() - FLAT * np.abs(points).max()
            return np.asarray(points[near].mean(axis=0))
        out: Array = self.ball[which] * direction
        out += self.box[which] * np.sign(np.where(np.abs(direction) > FLAT, direction, 0.0))
        width = float(np.hypot(direction[0], direction[1]))
        if width > FLAT:
            out[:2] += self.disc[which] * direction[:2] / width
        return out


def clearance(
    supports: Supports, which: tuple[Index, Index], rotations: tuple[Array, Array], offset: Array, normal: Array
) -> Array:
    """clearance(n) of pairs [m].

    Args:
        which: numbers of the shapes A and B, n each.
        rotations: of A and of B in the world, n x 3 x 3 each.
        offset: from the centre of A to that of B in the world, n x 3.
        normal: unit directions from A to B in the world, n x 3.
    """
    first = supports.reach(which[0], np.einsum("ikj,ik->ij", rotations[0], normal))
    second = supports.reach(which[1], -np.einsum("ikj,ik->ij", rotations[1], normal))
    return np.asarray(np.einsum("ij,ij->i", offset, normal) - first - second)
