"""Solids of the growing problems: link shapes of the robots, and clutter around them that a path stays clear of."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import coal
import numpy as np
import pinocchio as pin

from bench.problems import Array, Solid
from bench.solids import placement, shape
from tests.distances import coal_pose, coal_shape
from wbc.robot import Robot
from wbc.shapes import Capsule, Sphere

#: Pairs of links of a Unitree G1 that reach each other: arms with the trunk, the legs and each other, legs together
G1_PAIRS = [
    ("left_wrist_yaw_link", "torso_link"), ("right_wrist_yaw_link", "torso_link"),
    ("left_wrist_pitch_link", "torso_link"), ("right_wrist_pitch_link", "torso_link"),
    ("left_elbow_link", "torso_link"), ("right_elbow_link", "torso_link"),
    ("left_wrist_yaw_link", "pelvis_contour_link"), ("right_wrist_yaw_link", "pelvis_contour_link"),
    ("left_wrist_yaw_link", "left_hip_yaw_link"), ("right_wrist_yaw_link", "right_hip_yaw_link"),
    ("left_wrist_yaw_link", "right_hip_yaw_link"), ("right_wrist_yaw_link", "left_hip_yaw_link"),
    ("left_wrist_yaw_link", "head_link"), ("right_wrist_yaw_link", "head_link"),
    ("left_wrist_yaw_link", "right_wrist_yaw_link"), ("left_wrist_yaw_link", "right_elbow_link"),
    ("left_elbow_link", "right_wrist_yaw_link"), ("left_elbow_link", "right_elbow_link"),
    ("left_knee_link", "right_knee_link"), ("left_ankle_pitch_link", "right_ankle_pitch_link"),
]  # fmt: skip

#: Link of a Panda -> sides and centre of a box on it [m]
PANDA_BOXES = {
    "panda_link3": ([0.12, 0.12, 0.16], [0.04, 0.03, -0.06]),
    "panda_link4": ([0.12, 0.14, 0.12], [-0.04, 0.04, 0.02]),
    "panda_link5": ([0.10, 0.12, 0.28], [0.0, 0.03, -0.13]),
    "panda_link6": ([0.16, 0.10, 0.12], [0.05, 0.0, 0.0]),
    "panda_hand": ([0.06, 0.22, 0.14], [0.0, 0.0, 0.05]),
}
#: Sizes of the clutter: radius, sides [m]
BALL, CRATE = 0.05, [0.08, 0.10, 0.12]
#: Clearance that the path keeps from all clutter [m]
CLEAR = 0.03


def capsules(robot: Robot) -> list[Solid]:
    """The spheres and capsules of all links that joints move."""
    out = []
    for link, shapes in robot.shapes.items():
        for placed in shapes if robot.model.frames[robot.model.getFrameId(link)].parentJoint else ():
            shape, numbers = placed.shape, pin.SE3ToXYZQUAT(placed.placement).tolist()
            assert isinstance(shape, Capsule | Sphere), shape
            size = [shape.radius, shape.length] if isinstance(shape, Capsule) else [shape.radius]
            kind = type(shape).__name__.lower()
            out.append(Solid(link, kind, [float(s) for s in size], numbers[:3], numbers[3:]))
    return out


def link_boxes(robot: Robot) -> list[Solid]:
    """A box on each of five links."""
    assert robot.name == "panda"
    return [Solid(link, "box", size, place) for link, (size, place) in PANDA_BOXES.items()]


def spheres_around(robot: Robot, own: Sequence[Solid], path: Sequence[Array], count: int) -> list[Solid]:
    """Spheres, the nearest to the path first."""
    return _around(robot, own, path, count, lambda place, turn: Solid("", "sphere", [BALL], place))


def boxes_around(robot: Robot, own: Sequence[Solid], path: Sequence[Array], count: int) -> list[Solid]:
    """Boxes at random angles, the nearest to the path first."""
    return _around(robot, own, path, count, lambda place, turn: Solid("", "box", CRATE, place, turn))


def _around(
    robot: Robot, own: Sequence[Solid], path: Sequence[Array], count: int,
    make: Callable[[list[float], list[float]], Solid],
) -> list[Solid]:  # fmt: skip
    """Candidates at random within reach, those nearer than :data:`CLEAR` left out."""
    rng, pairs = np.random.default_rng(3), [(k, len(own)) for k in range(len(own))]
    found: list[tuple[float, Solid]] = []
    while len(found) < count:
        turn = rng.normal(size=4)
        solid = make(rng.uniform([-0.9, -0.9, 0.0], [0.9, 0.9, 1.2]).tolist(), (turn / np.linalg.norm(turn)).tolist())
        least = min(float(clearances(robot, [*own, solid], pairs, q).min()) for q in path[::10])
        if least > CLEAR:
            found.append((least, solid))
    return [solid for _, solid in sorted(found, key=lambda one: one[0])]


def clearances(robot: Robot, solids: Sequence[Solid], pairs: Sequence[tuple[int, int]], q: Array) -> Array:
    """Distance of each pair at a configuration, by Coal [m]."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    return distances(robot.model, data, solids, pairs)


def distances(model: pin.Model, data: pin.Data, solids: Sequence[Solid], pairs: Sequence[tuple[int, int]]) -> Array:
    """The same with placements of frames that are computed already."""
    return np.array([result.min_distance for result in measured(model, data, solids, pairs)])


def measured(
    model: pin.Model, data: pin.Data, solids: Sequence[Solid], pairs: Sequence[tuple[int, int]]
) -> list[coal.DistanceResult]:
    """Coal's answer for each pair, nearest points in the world."""
    used = sorted({k for pair in pairs for k in pair})
    places, shapes = {}, {}
    for k in used:
        solid = solids[k]
        place = data.oMf[model.getFrameId(solid.link)] * placement(solid) if solid.link else placement(solid)
        places[k] = coal_pose(place)
        shapes[k] = coal_shape(shape(solid))
    out, request = [], coal.DistanceRequest()
    for a, b in pairs:
        out.append(coal.DistanceResult())
        coal.distance(shapes[a], places[a], shapes[b], places[b], request, out[-1])
    return out
