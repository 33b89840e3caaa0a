"""Least distances of pairs of links over many configurations.

The broad phase bounds every shape by a capsule and computes the distances of their axes for all configurations at
once: less the radii, they are lower bounds of the signed distance, and the distance itself for spheres and capsules.
The narrow phase asks Coal in the order of the bounds, until they exceed the least distance found.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

# isort: split
import coal

from wbc.robot.geometry.coal_shapes import geometry_of
from wbc.robot.geometry.segments import bounding_capsule, segment_distances
from wbc.robot.pairs.link_pairs import joint_of
from wbc.robot.sampling import joint_poses
from wbc.shapes import Capsule, PlacedShape, Sphere
from wbc.symbolic.kinematics import WORLD, frame_index
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class LinkPart:
    """A shape of a link: as Coal has it, where it sits on its joint, and the capsule that bounds it.

    Attributes:
        joint: number of the joint that carries it.
        placement: of the Coal geometry on that joint.
        ends, radius: of the bounding capsule on that joint [m].
        exact: whether that capsule is the shape.
    """

    joint: int
    geometry: Any
    placement: pin.SE3
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
        self._request = coal.DistanceRequest()
        self._request.enable_signed_distance = True

    def place(self, steps: Array) -> Scenes:
        """All shapes at each of the configurations ``steps`` away from the neutral one."""
        return Scenes(self, *joint_poses(self.robot, steps, self._joints))

    def witness(self, first: str, second: str, poses: dict[int, pin.SE3]) -> tuple[float, Array, Array, Array]:
        """(signed distance [m], normal from first to second, nearest points) of two links, by Coal."""
        least: tuple[float, Any] = (np.inf, None)
        for a in self.parts[first]:
            for b in self.parts[second]:
                result = coal.DistanceResult()
                value = coal.distance(
                    a.geometry,
                    _transform(poses[a.joint] * a.placement),
                    b.geometry,
                    _transform(poses[b.joint] * b.placement),
                    self._request,
                    result,
                )
                if value < least[0]:
                    least = (float(value), result)
        result = least[1]
        return least[0], np.array(result.normal), result.getNearestPoint1(), result.getNearestPoint2()

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
        ends = [np.hstack([scene.ends(part)[end] for part in parts]) for parts in sides for end in (0, 1)]
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
        # One row a coordinate: sums of rows are quick, sums of short columns are not
        turns, shifts = np.moveaxis(rotations, 0, -1).copy(), np.moveaxis(positions, 0, -1).copy()
        self._ends = {
            id(part): [
                _moved(turns[links.index[part.joint]], shifts[links.index[part.joint]], end) for end in part.ends
            ]
            for group in links.parts.values()
            for part in group
        }

    def ends(self, part: LinkPart) -> tuple[Array, Array]:
        """The ends of a shape's bounding capsule at each configuration [3 x n each]."""
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
        """Signed distance [m] at the n-th configuration, by Coal."""
        index = self.links.index
        joints = {part.joint for link in (first, second) for part in self.links.parts[link]}
        poses = {j: pin.SE3(self._rotations[n, index[j]], self._positions[n, index[j]]) for j in joints}
        return self.links.witness(first, second, poses)[0]


def _moved(turn: Array, shift: Array, point: Array) -> Array:
    """A point at each configuration [3 x n], for rotations [3 x 3 x n] and positions [3 x n]."""
    return np.asarray(turn[:, 0] * point[0] + turn[:, 1] * point[1] + turn[:, 2] * point[2] + shift)


def _part(robot: Robot, link: str, placed: PlacedShape) -> LinkPart:
    above = pin.SE3.Identity() if link == WORLD else robot.model.frames[frame_index(robot.model, link)].placement
    geometry = geometry_of(placed.shape)
    a, b, radius = bounding_capsule(placed)
    place = above * placed.placement * geometry.offset
    exact = isinstance(placed.shape, (Sphere, Capsule))
    return LinkPart(joint_of(robot, link), geometry.geometry, place, (above * a, above * b), radius, exact)


def _transform(pose: pin.SE3) -> Any:
    return coal.Transform3s(pose.rotation, pose.translation)
