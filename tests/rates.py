"""What the rows of items times v are, by Pinocchio, where they are not the derivative of a value."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin

from tests.closed_loop.eyes import cross
from tests.models import placement
from tests.tasks.robots import velocity
from wbc import tasks
from wbc.robot import Robot
from wbc.tasks.rolling import FLAT

AXIS, AROUND, OFFSET = (0.0, -1.0, 2.0), (1.0, 1.0, 0.0), (0.1, -0.2, 0.05)
#: What the cameras look at, in their reference
SEEN = (0.3, -1.5, 0.7)
#: A plane like any other, for what slides
TILTED = pin.SE3(pin.exp3(np.array([0.4, -0.7, 0.2])), np.array([0.3, 0.1, 0.5]))
#: The ground that wheels roll on: askew and away from the origin
GROUND = pin.SE3(pin.exp3(np.array([0.3, -0.4, 0.2])), np.array([0.1, 0.2, -0.3]))


def relative_twist(robot: Robot, frame: str, base: str, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Twist of a frame as seen from a moving base, at the frame's origin, world axes."""
    own, carrier = velocity(robot, frame, q, v), velocity(robot, base, q, v)
    arm = placement(robot, frame, q).translation - placement(robot, base, q).translation
    return own - np.concatenate([carrier[:3] + np.cross(carrier[3:], arm), carrier[3:]])


def damping(item: tasks.Damping, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    return v


def frame_velocity(item: tasks.FrameVelocityLimit, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    twist = relative_twist(robot, item.frame, item.relative_to, q, v)
    turn = placement(robot, item.axes, q).rotation.T
    seen = np.concatenate([turn @ twist[:3], turn @ twist[3:]])
    labels = ("x", "y", "z", "rx", "ry", "rz")
    return np.array([seen[labels.index(row.label)] for row in item.rows(robot)])


def hold(item: tasks.Hold, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    twist = velocity(robot, item.frame, q, v)
    if item.kind == "axis":
        return np.concatenate([twist[:3], (placement(robot, item.frame, q).rotation.T @ twist[3:])[:2]])
    return {"pose": twist, "position": twist[:3], "orientation": twist[3:]}[item.kind]


def line_contact(item: tasks.LineContact, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    twist = velocity(robot, item.frame, q, v)
    return np.concatenate([twist[:3], (placement(robot, item.frame, q).rotation.T @ twist[3:])[1:]])


def sliding(item: tasks.SlidingContact, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    return np.array([TILTED.rotation[:, 2] @ velocity(robot, item.frame, q, v)[:3]])


def rolling_contact(item: tasks.RollingContact, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Velocity of the wheel's material at the point of its rim that is nearest to the ground's plane, downwards."""
    pose, twist, normal = placement(robot, item.frame, q), velocity(robot, item.frame, q, v), TILTED.rotation[:, 2]
    axis = pose.rotation @ np.array(item.axis)
    ends = np.linalg.svd(axis[None])[2][1:]
    angle = np.arctan2(ends[1] @ normal, ends[0] @ normal)
    length = np.hypot(ends[0] @ normal, ends[1] @ normal)
    up = (np.cos(angle) * ends[0] + np.sin(angle) * ends[1]) * length / np.hypot(length, FLAT)
    slip = twist[:3] + np.cross(twist[3:], -item.radius * up)
    along = np.cross(axis, up)
    return np.array([along @ slip, np.cross(normal, along) @ slip, normal @ slip])


def contact(item: tasks.RigidGrasp, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    return velocity(robot, item.frame, q, v)[: item.components]


def mechanism(item: tasks.Mechanism, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    mimics = [v[c.follower] - c.ratio * v[c.leader] for c in robot.couplings]
    return np.array(mimics + [v[i] for i in robot.locked_dofs])


def plane(item: tasks.PitchPlane, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Angular velocity of the body that carries the axis, along the line between the offset pitch axes."""
    model, data = robot.model, robot.model.createData()
    pin.forwardKinematics(model, data, q, v)
    joint = model.getJointId(item.axis)
    local = np.array(pin.getJointJacobian(model, pin_jacobians(model, q), joint, pin.WORLD))[3:, robot.dofs(item.axis)]
    axis = local[:, 0]
    spin = pin.getVelocity(model, data, model.parents[joint], pin.WORLD).angular
    line = placement(robot, item.wrist, q).translation - placement(robot, item.shoulder, q).translation
    line = line - axis * (axis @ line)
    return np.array([spin @ line / np.linalg.norm(line)])


def pin_jacobians(model: pin.Model, q: np.ndarray) -> pin.Data:
    data = model.createData()
    pin.computeJointJacobians(model, data, q)
    return data


def axes(item: tasks.AxisAlign | tasks.LookAt) -> np.ndarray:
    """Columns b1, b2 and the axis, in the frame; for a z axis without ``around`` they are those of the frame."""
    if item.around is None:
        assert item.axis == (0.0, 0.0, 1.0)
        return np.eye(3)
    axis = np.array(AXIS) / np.linalg.norm(AXIS)
    across = np.array(AROUND) - axis * (axis @ AROUND)
    first = across / np.linalg.norm(across)
    return np.column_stack([first, np.cross(axis, first), axis])


def line_of_sight(item: tasks.LookAt, robot: Robot, q: np.ndarray, target: Any) -> np.ndarray:
    """From the camera to the target, in the world [m]."""
    camera = placement(robot, item.frame, q).act(np.array(item.offset))
    return np.array(placement(robot, item.relative_to, q).act(np.array(target)) - camera)


def spin_across(item: tasks.AxisAlign, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """The relative angular velocity about b1 and b2."""
    spin = velocity(robot, item.frame, q, v)[3:] - velocity(robot, item.relative_to, q, v)[3:]
    return (placement(robot, item.frame, q).rotation @ axes(item)).T[:2] @ spin


def spin_past_sight(item: tasks.LookAt, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """The angular velocity about b1 and b2 less that of the line of sight, from its values 4e-6 s apart."""
    step = 2e-6
    before, after = (line_of_sight(item, robot, pin.integrate(robot.model, q, t * v), SEEN) for t in (-step, step))
    here = line_of_sight(item, robot, q, SEEN)
    turning = np.cross(here, (after - before) / (2 * step)) / (here @ here)
    spin = velocity(robot, item.frame, q, v)[3:] - turning
    return (placement(robot, item.frame, q).rotation @ axes(item)).T[:2] @ spin


def momentum(item: tasks.Momentum, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    h = np.array(pin.computeCentroidalMomentum(robot.model, robot.model.createData(), q, v).vector)
    return {"both": h, "linear": h[:3], "angular": h[3:]}[item.kind]


@cache
def single_joints(robot: Robot) -> tuple[str, ...]:
    """Joints of one degree of freedom."""
    return tuple(j for j in robot.joint_names if int(robot.model.nvs[robot.model.getJointId(j)]) == 1)


@cache
def data_of(robot: Robot) -> pin.Data:
    """Pinocchio's workspace of a robot, which takes longer to make than to use."""
    return robot.model.createData()


def wheel_axis(robot: Robot, joint: str, q: np.ndarray) -> np.ndarray:
    """Axis of a joint in the world, from the motion of its body when only it turns."""
    v, data = np.zeros(robot.nv), data_of(robot)
    v[robot.dofs(joint)] = 1.0
    pin.forwardKinematics(robot.model, data, q, v)
    return np.array(pin.getVelocity(robot.model, data, robot.model.getJointId(joint), pin.WORLD).angular)


def slip(robot: Robot, wheel: tasks.Wheel, ground: pin.SE3, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Velocity of the wheel's material point that touches the ground."""
    data, point = data_of(robot), touching(robot, wheel, ground, q)[0]
    pin.forwardKinematics(robot.model, data, q, v)
    twist = pin.getVelocity(robot.model, data, robot.model.getJointId(wheel.joint), pin.WORLD)
    return np.array(twist.linear + cross(twist.angular, point))


def rolling(item: tasks.Rolling, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """What of the contact points' velocities must vanish or keep them on the ground."""
    out, normal = [], GROUND.rotation[:, 2]
    for wheel in item.wheels:
        moved, forwards = slip(robot, wheel, GROUND, q, v), touching(robot, wheel, GROUND, q)[1]
        sideways = cross(normal, forwards)
        if wheel.roller is None:
            out += [forwards @ moved, sideways @ moved]
        else:
            roller = pin.AngleAxis(wheel.roller, normal).toRotationMatrix() @ forwards
            out.append(roller @ moved)
        if any(row.label == f"{wheel.joint} contact" for row in item.rows(robot)):
            out.append(normal @ moved)
    return np.array(out)


def touching(robot: Robot, wheel: tasks.Wheel, ground: pin.SE3, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(lowest point of a wheel's rim, horizontal direction across its axis that it rolls to)."""
    data, normal = data_of(robot), ground.rotation[:, 2]
    axis = wheel_axis(robot, wheel.joint, q)
    up = cross(axis, cross(normal, axis))
    up = up / math.sqrt(up @ up + FLAT**2)
    centre = data.oMi[robot.model.getJointId(wheel.joint)].translation
    return centre - wheel.radius * up, cross(axis, up)


def wheel(robot: Robot) -> tuple[str, tuple[float, ...]]:
    """A frame with its origin on the axis of the last revolute joint that has one, and the axis; like a wheel's."""
    model = robot.model
    for frame in reversed(list(model.frames)):
        joint = frame.parentJoint
        if joint == 0 or model.nvs[joint] != 1 or not model.joints[joint].shortname().startswith("JointModelR"):
            continue
        index = model.getFrameId(frame.name)
        jacobian = pin.computeFrameJacobian(model, model.createData(), robot.neutral, index, pin.LOCAL)
        screw = np.array(jacobian[:, model.idx_vs[joint]])
        if np.linalg.norm(screw[:3]) < 1e-9:
            return str(frame.name), tuple(screw[3:].tolist())
    raise AssertionError(robot.name)
