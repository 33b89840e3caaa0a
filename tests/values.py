"""What the values of items are, by Pinocchio and numpy: errors of tasks, margins, and what rows of positions hold."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from tests.models import placement
from tests.rates import axes, line_of_sight
from wbc import tasks
from wbc.robot import Robot
from wbc.symbolic.manipulability import FLOOR

Array = np.ndarray
#: Value of an item in a configuration, with these run-time values
Value = Callable[[Any, Robot, Array, Mapping[str, Any]], Array]


def log3(rotation: Array) -> Array:
    """Rotation vector [rad], up to half a turn."""
    return np.asarray(pin.log3(rotation))


def turn_to(robot: Robot, named: str, frame: str, base: str, q: Array) -> Array:
    """Rotation from the world into the axes that an item counts in."""
    chosen = {"frame": frame, "reference": base}.get(named, named)
    return np.asarray(placement(robot, chosen, q).rotation.T)


def seen(robot: Robot, frame: str, offset: Any, base: str, q: Array) -> Array:
    """A point of a frame as another one sees it [m]."""
    return np.array(placement(robot, base, q).actInv(placement(robot, frame, q).act(np.array(offset))))


def angle(a: Array, b: Array) -> float:
    """Angle between two directions [rad]."""
    return math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b))


def shortest(direction: Array, axis: Array) -> Array:
    """Rotation vector of the shortest turn that takes a direction to an axis [rad]."""
    normal = np.cross(direction, axis)
    return np.asarray(angle(direction, axis) * normal / np.linalg.norm(normal))


def end_effector(item: tasks.EndEffector, robot: Robot, q: Array, given: Mapping[str, Any]) -> Array:
    here, base = (placement(robot, name, q) for name in (item.frame, item.relative_to))
    turn, target, parts = turn_to(robot, item.axes, item.frame, item.relative_to, q), given["target"], []
    if item.kind != "orientation":
        goal = target.translation if item.kind == "pose" else target
        parts.append(turn @ (here.translation - base.act(np.array(goal))))
    if item.kind != "position":
        goal = target.rotation if item.kind == "pose" else target
        parts.append(turn @ log3(here.rotation @ (base.rotation @ goal).T))
    return np.concatenate(parts)


def elbow(item: tasks.Elbow, robot: Robot, q: Array, given: Mapping[str, Any]) -> Array:
    point = seen(robot, item.frame, item.offset, "world", q)
    return turn_to(robot, item.axes, item.frame, "world", q) @ (point - given["target"])


def posture(item: tasks.Posture, robot: Robot, q: Array, given: Mapping[str, Any]) -> Array:
    off = np.array(pin.difference(robot.model, given["target"], q))
    if item.joints is None:
        return off[robot.base_nv :]
    return off[np.concatenate([np.arange(robot.nv)[robot.dofs(joint)] for joint in item.joints])]


def center_of_mass(item: tasks.CenterOfMass, robot: Robot, q: Array, given: Mapping[str, Any]) -> Array:
    mean = np.array(pin.centerOfMass(robot.model, robot.model.createData(), q))
    return turn_to(robot, item.axes, "world", "world", q) @ (mean - given["target"])


def damping(item: tasks.Damping, robot: Robot, q: Array, given: Mapping[str, Any]) -> Array:
    return np.zeros(robot.nv)


def axis_align(item: tasks.AxisAlign, robot: Robot, q: Array, given: Mapping[str, Any]) -> Array:
    rows, target = placement(robot, item.frame, q).rotation @ axes(item), np.array(given["target"])
    direction = placement(robot, item.relative_to, q).rotation @ target
    return np.asarray(rows[:, :2].T @ shortest(direction, rows[:, 2]))


def look_at(item: tasks.LookAt, robot: Robot, q: Array, given: Mapping[str, Any]) -> Array:
    rows = placement(robot, item.frame, q).rotation @ axes(item)
    return np.asarray(rows[:, :2].T @ shortest(line_of_sight(item, robot, q, given["target"]), rows[:, 2]))


def distance(item: tasks.Distance, robot: Robot, q: Array, given: Mapping[str, Any]) -> Array:
    between = seen(robot, item.frame, item.offset, item.other, q) - given["point"]
    return np.array([np.linalg.norm(between) - given["target"]])


def momentum(item: tasks.Momentum, robot: Robot, q: Array, given: Mapping[str, Any]) -> Array:
    return -np.asarray(given["lag"])


def relative_pose(item: tasks.RelativePose, robot: Robot, q: Array, given: Mapping[str, Any]) -> Array:
    """The point of the object as either hand holds it, and the turn between these images."""
    a, b = (placement(robot, name, q) for name in (item.frame_a, item.frame_b))
    held = pin.SE3(np.eye(3), np.array(given["at"]))
    first, second = a * held, b * pin.SE3(given["target"].homogeneous).inverse() * held
    turn = first.rotation @ log3(first.rotation.T @ second.rotation)
    own = pin.exp3(turn / 2.0) @ first.rotation
    into = own.T if item.axes == "midway" else turn_to(robot, item.axes, item.frame_b, item.frame_a, q)
    rows = np.concatenate([into @ (second.translation - first.translation), into @ turn])
    return np.asarray(rows[{"pose": slice(0, 6), "position": slice(0, 3), "orientation": slice(3, 6)}[item.kind]])


def joint_coupling(item: tasks.JointCoupling, robot: Robot, q: Array, given: Mapping[str, Any]) -> Array:
    """A row with a joint that turns without end is an angle."""
    model, out = robot.model, []
    for relation, target in zip(item.coefficients, np.atleast_1d(given["target"]), strict=True):
        at = {joint: int(model.idx_qs[model.getJointId(joint)]) for joint, _ in relation}
        endless = {joint: int(model.nqs[model.getJointId(joint)]) == 2 for joint in at}
        turned = {j: math.atan2(q[k + 1], q[k]) if endless[j] else float(q[k]) for j, k in at.items()}
        total = sum(factor * turned[joint] for joint, factor in relation) - target
        out.append(math.atan2(math.sin(total), math.cos(total)) if any(endless.values()) else total)
    return np.array(out)


def manipulability(item: tasks.Manipulability, robot: Robot, q: Array, given: Mapping[str, Any]) -> Array:
    """From singular values of the Jacobian as the other frame sees it."""
    model, data = robot.model, robot.model.createData()
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    tip, base = placement(robot, item.frame, q), placement(robot, item.relative_to, q)
    jacobian = pin.getFrameJacobian(model, data, model.getFrameId(item.frame), pin.LOCAL_WORLD_ALIGNED).copy()
    if item.relative_to != "world":
        carried = pin.getFrameJacobian(model, data, model.getFrameId(item.relative_to), pin.LOCAL_WORLD_ALIGNED)
        jacobian[:3] -= carried[:3] - pin.skew(tip.translation - base.translation) @ carried[3:]
        jacobian[3:] -= carried[3:]
    jacobian = np.kron(np.eye(2), base.rotation.T) @ jacobian
    jacobian[:3] /= item.length or robot.characteristic_length
    labels = ("x", "y", "z", "rx", "ry", "rz")
    kinds = {"pose": labels, "position": labels[:3], "orientation": labels[3:]}
    rows = [labels.index(label) for label in item.along or kinds[item.kind]]
    w = float(np.prod(np.sqrt(np.linalg.svd(jacobian[rows], compute_uv=False) ** 2 + FLOOR**2)))
    return np.array([math.log(w / given["target"]) if item.form == "log" else w - given["target"]])


def workspace_box(item: tasks.WorkspaceBox, robot: Robot, q: Array, given: Mapping[str, Any]) -> Array:
    return between(seen(robot, item.frame, item.offset, item.relative_to, q), given)


def between(value: Array, given: Mapping[str, Any]) -> Array:
    """Margins of those limits that there are."""
    low = [value - given["lower"]] if "lower" in given else []
    return np.concatenate([*low, *([given["upper"] - value] if "upper" in given else [])])


def limit(item: tasks.Limit, robot: Robot, q: Array, given: Mapping[str, Any]) -> Array:
    """Of a task that has a value here."""
    value = VALUES[type(item.task).__name__](item.task, robot, q, given)
    labels = [row.label for row in item.task.rows(robot)]
    return between(value[[labels.index(label) for label in item.only or labels]], given)


def polyhedron(item: tasks.WorkspacePolyhedron, robot: Robot, q: Array, given: Mapping[str, Any]) -> Array:
    normals = np.array(item.normals) / np.linalg.norm(item.normals, axis=1)[:, None]
    point = seen(robot, item.frame, item.offset, item.relative_to, q)
    return np.asarray(normals @ given["pose"].actInv(point) - given["offsets"])


def cone(theta: float, alpha: float) -> float:
    """Margin of an angle against a half angle [rad]."""
    return alpha - theta if theta > alpha else (alpha * alpha - theta * theta) / (2.0 * alpha)


def axis_cone(item: tasks.AxisCone, robot: Robot, q: Array, given: Mapping[str, Any]) -> Array:
    own, base = (placement(robot, name, q).rotation for name in (item.frame, item.relative_to))
    return np.array([cone(angle(own @ np.array(item.axis), base @ given["direction"]), given["half_angle"])])


def gaze_cone(item: tasks.GazeCone, robot: Robot, q: Array, given: Mapping[str, Any]) -> Array:
    point = placement(robot, item.point_frame, q).act(np.array(given["point"]))
    ray = placement(robot, item.frame, q).actInv(point) - np.array(item.apex)
    return np.array([np.linalg.norm(ray) * cone(angle(ray, np.array(item.axis)), given["half_angle"])])


def hold(item: tasks.Hold, robot: Robot, q: Array, given: Mapping[str, Any]) -> Array:
    """How far a held frame is from its place."""
    here, there = placement(robot, item.frame, q), given["target"]
    off = here.translation - there.translation
    if item.kind == "axis":
        turn = here.rotation.T @ shortest(here.rotation[:, 2], there.rotation[:, 2])
        return np.concatenate([off, -turn[:2]])
    rows = np.concatenate([off, log3(here.rotation @ there.rotation.T)])
    return rows[{"pose": slice(0, 6), "position": slice(0, 3), "orientation": slice(3, 6)}[item.kind]]


def mechanism(item: tasks.Mechanism, robot: Robot, q: Array, given: Mapping[str, Any]) -> Array:
    """How far joints are from what they follow; undriven directions and joints without end have no place."""
    at, places = robot.position_index, []
    for c in robot.couplings:
        lead, follow = (float(q[at[k]]) for k in (c.leader, c.follower))
        places.append(follow - c.ratio * lead - c.offset if min(at[c.leader], at[c.follower]) >= 0 else 0.0)
    return np.array(places + [0.0] * len(robot.locked_dofs))


#: Class name -> value; what is not here has a file of its own, see :data:`ELSEWHERE`
VALUES: dict[str, Value] = {
    "EndEffector": end_effector, "Elbow": elbow, "Posture": posture, "CenterOfMass": center_of_mass,
    "Damping": damping, "AxisAlign": axis_align, "LookAt": look_at, "Distance": distance, "Momentum": momentum,
    "RelativePose": relative_pose, "JointCoupling": joint_coupling, "Manipulability": manipulability,
    "WorkspaceBox": workspace_box, "WorkspacePolyhedron": polyhedron, "AxisCone": axis_cone, "GazeCone": gaze_cone,
    "Hold": hold, "Mechanism": mechanism, "Limit": limit,
}  # fmt: skip
#: Class name -> file of tests that holds its values
ELSEWHERE = {
    "Expression": "tasks/test_expression.py", "PitchPlane": "tasks/test_pitch_plane.py",
    "PitchPlaneLimit": "tasks/test_plane_reference.py",
    "Obstacle": "constraints/test_pairs.py", "SelfCollision": "constraints/test_self_collision.py",
    "SupportRegion": "torque/test_support.py",
}  # fmt: skip


def has_value(item: tasks.Item) -> bool:
    """Whether this file knows it; of a limit that of its task."""
    return type(item).__name__ in VALUES and (not isinstance(item, tasks.Limit) or has_value(item.task))
