"""Declarations of the tasks on several bodies at once and of wheels, and what the wheels' rows are by Pinocchio."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin

from tests.closed_loop.eyes import cross
from tests.tasks.robots import FRAMES
from wbc.robot import Robot
from wbc.tasks import Item, JointCoupling, Manipulability, RelativePose, Rolling, Wheel
from wbc.tasks.rolling import FLAT

Declared = tuple[Item, dict[str, Any]]

#: The ground that the registry's wheels roll on: askew and away from the origin
GROUND = pin.SE3(pin.exp3(np.array([0.3, -0.4, 0.2])), np.array([0.1, 0.2, -0.3]))


def _relative_pose(robot: Robot) -> list[Declared]:
    f = FRAMES[robot.name]
    items = [
        RelativePose(f.base, f.tip),
        RelativePose(f.base, f.tip, axes=f.base),
        RelativePose(f.base, f.tip, axes="world", weights=(1, 2, 3, 4, 5, 0)),
        RelativePose(f.middle, f.tip, axes=f.base, at=(0.1, -0.2, 0.05)),
        RelativePose(f.base, f.tip, kind="position"),
        RelativePose(f.base, f.tip, kind="position", axes=f.tip),
        RelativePose(f.tip, f.base, kind="orientation"),
        RelativePose(f.tip, f.base, kind="orientation", axes=f.middle),
    ]
    return [(item, {}) for item in items]


@cache
def single_joints(robot: Robot) -> tuple[str, ...]:
    """Joints of one degree of freedom."""
    return tuple(j for j in robot.joint_names if int(robot.model.nvs[robot.model.getJointId(j)]) == 1)


def _joint_coupling(robot: Robot) -> list[Declared]:
    a, b, *_, c = single_joints(robot)
    whole = 2 if robot.name == "kinova" else 1.5
    items = [
        JointCoupling({a: 1, b: -1}),
        JointCoupling([{a: 1, b: -whole, c: -3}, {c: 1}], target=None, weights=(1, 2)),
        JointCoupling([{b: 1, c: -3}], target=0.3),
    ]
    return [(item, {}) for item in items]


def _manipulability(robot: Robot) -> list[Declared]:
    f = FRAMES[robot.name]
    # The humanoid's moving frame elsewhere is a sole; from there, as from the world, an arm is never singular
    items = [
        Manipulability(f.tip, kind="position"),
        Manipulability(f.tip, kind="orientation", form="log"),
        Manipulability(f.tip, length=0.3),
        Manipulability(f.tip, along=("z", "rx"), relative_to=f.base),
        Manipulability(f.base, along=("y",), relative_to=f.tip),
    ]
    return [(item, {}) for item in items]


def _rolling(robot: Robot) -> list[Declared]:
    """Any joint turns a wheel, as far as the rows are concerned."""
    carried = [j for j in single_joints(robot) if int(robot.model.parents[robot.model.getJointId(j)]) > 0]
    slanted = [j for j in carried if abs(wheel_axis(robot, j, robot.neutral)[2]) < 0.9]
    plain, omni, mecanum = Wheel(slanted[0], 0.1), Wheel(slanted[1], 0.2, 0.0), Wheel(slanted[-1], 0.05, -math.pi / 4)
    return [
        (Rolling((plain, omni, mecanum)), {"ground": GROUND}),
        (Rolling(plain, contact=True), {"ground": GROUND, "gain": 3.0}),
    ]


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


def contact(robot: Robot, wheel: Wheel, ground: pin.SE3, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(lowest point of a wheel's rim, horizontal direction across its axis that it rolls to)."""
    data, normal = data_of(robot), ground.rotation[:, 2]
    axis = wheel_axis(robot, wheel.joint, q)
    up = cross(axis, cross(normal, axis))
    up = up / math.sqrt(up @ up + FLAT**2)
    centre = data.oMi[robot.model.getJointId(wheel.joint)].translation
    return centre - wheel.radius * up, cross(axis, up)


def slip(robot: Robot, wheel: Wheel, ground: pin.SE3, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Velocity of the wheel's material point that touches the ground."""
    data, point = data_of(robot), contact(robot, wheel, ground, q)[0]
    pin.forwardKinematics(robot.model, data, q, v)
    twist = pin.getVelocity(robot.model, data, robot.model.getJointId(wheel.joint), pin.WORLD)
    return np.array(twist.linear + cross(twist.angular, point))


def rolling(item: Rolling, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """What of the contact points' velocities must vanish or keep them on the ground."""
    out, normal = [], GROUND.rotation[:, 2]
    for wheel in item.wheels:
        moved, forwards = slip(robot, wheel, GROUND, q, v), contact(robot, wheel, GROUND, q)[1]
        sideways = cross(normal, forwards)
        if wheel.roller is None:
            out += [forwards @ moved, sideways @ moved]
        else:
            roller = pin.AngleAxis(wheel.roller, normal).toRotationMatrix() @ forwards
            out.append(roller @ moved)
        if any(row.label == f"{wheel.joint} contact" for row in item.rows(robot)):
            out.append(normal @ moved)
    return np.array(out)


#: Class name -> declarations on a robot.
FACTORIES: dict[str, Callable[[Robot], list[Declared]]] = {
    "RelativePose": _relative_pose,
    "JointCoupling": _joint_coupling,
    "Manipulability": _manipulability,
    "Rolling": _rolling,
}

#: What the rows times v are, where they are not the derivative of a value.
RATES: dict[type, Callable[..., np.ndarray]] = {Rolling: rolling}
