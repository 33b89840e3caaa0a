"""Least distances of pairs of links over many configurations.

The broad phase bounds every shape by a capsule and computes the distances of their axes for all configurations at
once: less the radii, they are lower bounds of the signed distance, and the distance itself for spheres and capsules.
The narrow phase measures in the order of the bounds, until they exceed the least distance found.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from wbc.errors import NotFiniteError
from wbc.geometry import ShapeTable, distances, segment_distances
from wbc.multibody import own
from wbc.robot.sampling import joint_poses
from wbc.shapes import PlacedShape, Solid
from wbc.symbolic.joint_steps import place
from wbc.symbolic.kinematics import WORLD, frame_index, joint_of
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class LinkPart:
    """A shape of a link: where it sits on its joint, and the capsule that bounds it.

    Attributes:
        joint: number of the joint that carries it.
        placement: of the shape's centre on that joint.
        ends, radius: of the bounding capsule on that joint [m].
        exact: whether that capsule is the shape.
    """

    joint: int
    shape: Solid
    placement: own.SE3
    ends: tuple[Array, Array]
    radius: float
    exact: bool


class Links:
    """The shapes of a robot's links, for the two phases.

    Args:
        shapes: name -> link and shape, for shapes one by one; default: all shapes of a link are one body.

    Attributes:
        parts: link -> its shapes.
        index: number of a joint that carries shapes -> its place among those.
    """

    def __init__(self, robot: Robot, shapes: Mapping[str, tuple[str, PlacedShape]] | None = None) -> None:
        self.robot = robot
        self.parts: dict[str, tuple[LinkPart, ...]] = (
            {link: tuple(_part(robot, link, placed) for placed in own) for link, own in robot.shapes.items() if own}
            if shapes is None
            else {name: (_part(robot, *one),) for name, one in shapes.items()}
        )
        self._joints = sorted({part.joint for group in self.parts.values() for part in group})
        self.index = {joint: k for k, joint in enumerate(self._joints)}
        every = [part for group in self.parts.values() for part in group]
        self._table = ShapeTable([part.shape for part in every])
        self._number = {id(part): k for k, part in enumerate(every)}
        self._poses = np.zeros((len(every), 12))

    def place(self, steps: Array) -> Scenes:
        """All shapes at each of the configurations ``steps`` away from the neutral one."""
        return Scenes(self, *joint_poses(self.robot, steps, self._joints))

    def witness(self, first: str, second: str, poses: Mapping[int, Any]) -> tuple[float, Array, Array, Array]:
        """(signed distance [m], normal from first to second, nearest points) of two links.

        Raises:
            NotFiniteError: a distance that is no number.
        """
        sides = [[self._number[id(part)] for part in self.parts[link]] for link in (first, second)]
        for part in (*self.parts[first], *self.parts[second]):
            self._poses[self._number[id(part)]] = place(own.SE3(poses[part.joint]) * part.placement)
        one, other = np.repeat(sides[0], len(sides[1])), np.tile(sides[1], len(sides[0]))
        found = distances(self._table, self._poses, one, other, self.robot.characteristic_length)
        gap, normal, point = np.split(found[int(np.argmin(found[:, 0]))], [1, 4])
        if not math.isfinite(gap[0]):
            raise NotFiniteError(f"distance of {first!r} and {second!r}", float(gap[0]), "of their shapes")
        return float(gap[0]), normal, point, point + gap * normal

    def is_exact(self, *links: str) -> bool:
        """Whether the links carry spheres and capsules only."""
        return all(part.exact for link in links for part in self.parts[link])

    def at_neutral(self, pairs: Sequence[tuple[str, str]]) -> dict[tuple[str, str], float]:
        """Signed distance [m] of pairs at the neutral configuration; where it is large, a lower bound of it.

        All pairs go through the broad phase at once: this is done whenever a robot is loaded.
        """
        scene = self.place(np.zeros((1, self.robot.nv)))
        rows = [(k, a, b) for k, (i, j) in enumerate(pairs) for a in self.parts[i] for b in self.parts[j]]
        if not rows:
            return {}
        sides = [[a for _, a, _ in rows], [b for _, _, b in rows]]
        ends = [np.concatenate([scene.ends(part)[end] for part in parts]) for parts in sides for end in (0, 1)]
        bounds = segment_distances(*ends) - np.array([a.radius + b.radius for _, a, b in rows])
        least = np.full(len(pairs), np.inf)
        np.minimum.at(least, [k for k, _, _ in rows], bounds)
        return {
            pair: float(bound) if bound > 0.0 or self.is_exact(*pair) else scene.distance(*pair, 0)
            for pair, bound in zip(pairs, least, strict=True)
        }


class Scenes:
    """A robot's links at many configurations.

    Args:
        rotations, positions: of the joints ``links.index`` at each configuration [n x joints x 3 x 3, n x joints x 3].
    """

    def __init__(self, links: Links, rotations: Array, positions: Array) -> None:
        self.links = links
        self._rotations, self._positions = rotations, positions
        self._ends = {
            id(part): [rotations[:, at] @ end + positions[:, at] for end in part.ends]
            for group in links.parts.values()
            for part in group
            for at in (links.index[part.joint],)
        }

    def ends(self, part: LinkPart) -> tuple[Array, Array]:
        """The ends of a shape's bounding capsule at each configuration [n x 3 each]."""
        a, b = self._ends[id(part)]
        return a, b

    def bounds(self, first: str, second: str) -> Array:
        """Lower bound of the signed distance [m] at each configuration; equal to it where ``links.is_exact``."""
        found = [
            segment_distances(*self.ends(a), *self.ends(b)) - (a.radius + b.radius)
            for a in self.links.parts[first]
            for b in self.links.parts[second]
        ]
        return np.asarray(np.min(found, axis=0))

    def distance(self, first: str, second: str, n: int) -> float:
        """Signed distance [m] at the n-th configuration."""
        index = self.links.index
        joints = {part.joint for link in (first, second) for part in self.links.parts[link]}
        poses = {j: own.SE3(self._rotations[n, index[j]], self._positions[n, index[j]]) for j in joints}
        return self.links.witness(first, second, poses)[0]


def _part(robot: Robot, link: str, placed: PlacedShape) -> LinkPart:
    above = own.SE3.Identity() if link == WORLD else own.SE3(robot.tree.frames[frame_index(robot.tree, link)].placement)
    shape, here = placed.shape, above * placed.place
    a, b, radius = shape.capsule()
    at = here * own.SE3(np.eye(3), shape.center)
    return LinkPart(joint_of(robot.tree, link), shape, at, (here * a, here * b), radius, shape.is_round)
