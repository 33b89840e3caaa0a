"""Checks Coal's normals with support functions, and declares one where none is right.

Coal is wrong in places where shapes lie inside each other: a ball whose centre lies on the axis of a capsule, capsules
whose axes cross, a ball in a cylinder, EPA on cylinders now and then; the distance is then too large or -1.8e308. So
every pair that overlaps, or is closer than TRUST, is checked:

    distance - clearance(normal) <= TRUST,      clearance as in :mod:`wbc.proximity.support`.

A pair that fails takes the first direction of greatest clearance out of the declared ones (:func:`declared`) and of
Coal's answers with B turned a little, and that clearance as its distance. So does an overlapping pair whose opposite
normal holds as well (balls about one centre), and a ball in a cylinder, where a normal can hold next to a better one.
"""

from __future__ import annotations

import numpy as np

# isort: split
import pinocchio as pin

# isort: split
import coal

from wbc.proximity.measured import Measured
from wbc.proximity.scene import TIE, TRUST, Index
from wbc.proximity.support import Supports, clearance
from wbc.shapes import Cylinder, HalfSpace, Sphere
from wbc.validation import Array

#: How far from 1 the square of a unit normal may be.
UNIT = 1e-6
#: Directions more nearly parallel than this have no cross product.
PARALLEL = 1e-6
#: How far B is turned to get Coal out of a degenerate place [rad].
TURN = 1e-4


class Judge:
    """Checks the results of a sensing in place.

    Attributes:
        doubtful: pairs whose last result is a declared one.
        supports: support functions of the bodies.
    """

    def __init__(self, sensing: Measured) -> None:
        self.sensing, scene = sensing, sensing.scene
        self.trust = TRUST * scene.robot.characteristic_length
        self.tie = TIE * scene.robot.characteristic_length
        self.doubtful = np.zeros(len(scene.first), dtype=bool)
        shapes = [body.shape for body in scene.bodies]
        self.supports = Supports(shapes, scene.centers)
        kinds = [(type(shapes[a]), type(shapes[b])) for a, b in zip(scene.first, scene.second, strict=True)]
        #: clearances of half-spaces have one direction only, and Coal's closed forms have it
        self._bounded = np.array([HalfSpace not in pair for pair in kinds])
        self._blunt = np.array([set(pair) == {Cylinder, Sphere} for pair in kinds])

    def check(self, measured: Index) -> None:
        """Check the pairs just measured; those of them that fail are mended."""
        found = self.sensing
        self.doubtful[measured] = False
        # NaN fails every comparison
        suspect = measured[~(found.distances[measured] > self.trust) & self._bounded[measured]]
        if not len(suspect):
            return
        normal = found.normals[suspect]
        proven = self._clearance(suspect, normal)
        holds = found.distances[suspect] - proven <= self.trust
        holds &= np.abs(np.einsum("ij,ij->i", normal, normal) - 1.0) < UNIT
        both_ways = proven - self._clearance(suspect, -normal) <= self.tie
        doubtful = ~holds | both_ways
        for row in (doubtful | self._blunt[suspect]).nonzero()[0]:
            self._mend(int(suspect[row]), bool(doubtful[row]))

    def _clearance(self, pairs: Index, normal: Array) -> Array:
        found = self.sensing
        a, b = found.scene.first[pairs], found.scene.second[pairs]
        turned = (found.rotations[a], found.rotations[b])
        return clearance(self.supports, (a, b), turned, found.centers[b] - found.centers[a], normal)

    @np.errstate(over="ignore", invalid="ignore")
    def _mend(self, pair: int, doubtful: bool) -> None:
        """Give a pair the best direction there is; Coal's own stays where it is not in doubt and as good."""
        found = self.sensing
        a, b = int(found.scene.first[pair]), int(found.scene.second[pair])
        turns, centers = found.rotations, found.centers
        own = np.array(found.normals[pair])
        choices = [*declared(turns[a], turns[b], centers[b] - centers[a]), *self._turned(a, b), own]
        directions = np.array([n for n in choices if np.isfinite(n).all() and abs(n @ n - 1.0) < UNIT])
        values = self._clearance(np.full(len(directions), pair), directions)
        if not doubtful and values.max() - values[-1] <= self.trust:
            return
        best = int(np.argmax(values >= values.max() - self.tie))
        normal, value = directions[best], float(values[best])
        first = turns[a] @ self.supports.point(a, turns[a].T @ normal) + centers[a]
        second = turns[b] @ self.supports.point(b, -turns[b].T @ normal) + centers[b]
        found.distances[pair], found.normals[pair] = value, normal
        found.points[pair] = (first + second - value * normal) / 2
        self.doubtful[pair] = True

    def _turned(self, a: int, b: int) -> list[Array]:
        """Coal's normals with B turned a little about each axis, and with the bodies in the other order."""
        found, out = self.sensing, []
        first, second = (coal.Transform3s(found.rotations[k], found.centers[k]) for k in (a, b))
        for axis in np.eye(3):
            turned = coal.Transform3s(found.rotations[b] @ pin.exp3(TURN * axis), found.centers[b])
            out.append(found.distance(a, first, b, turned)[1])
        return [*out, -found.distance(b, second, a, first)[1]]


def declared(first: Array, second: Array, offset: Array) -> list[Array]:
    """Directions from A to B for pairs that have no normal of their own, most wanted first.

    The line from the centre of A to that of B; the axes z, y, x of A, then of B; what is left of the line across the
    axes z of A and of B; the cross products of an axis of A and one of B; then the opposites in the same order.

    Args:
        first, second: axes of A and of B in the world, as columns.
        offset: from the centre of A to that of B [m].
    """
    axes = [*first.T[::-1], *second.T[::-1]]
    across = [offset - (offset @ z) * z for z in (first[:, 2], second[:, 2])]
    crossed = [np.cross(u, w) for u in first.T for w in second.T]
    length = np.linalg.norm(offset)
    lines = [line / length for line in (offset, *across)] if length > 0.0 else []
    found = [*lines[:1], *axes, *lines[1:], *crossed]
    lengths = [float(np.linalg.norm(n)) for n in found]
    out = [n / size for n, size in zip(found, lengths, strict=True) if size > PARALLEL]
    return [*out, *(-n for n in out)]
