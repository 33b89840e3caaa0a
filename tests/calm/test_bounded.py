"""Bounds on velocities and margins that hold a robot back: no joint goes to and fro, and it comes to rest."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.backends import IN_PYTHON
from wbc.tasks import AxisCone, Distance, Elbow, JointLimits, PitchPlaneLimit, Posture, WorkspaceBox

#: Largest rate of a base [m/s, rad/s]
BASE_RATE = 0.5
#: A joint turns where its rate changes by so much of its largest one, and back in the next tick
TURN = 0.3


def robot_of(name: str) -> wbc.Robot:
    robot = wbc.robots.load(name)
    return robot.with_limits(velocity={robot.joint_names[0]: [BASE_RATE] * robot.base_nv}) if robot.base_nv else robot


def rates(controller: wbc.Controller, q: np.ndarray, ticks: int) -> np.ndarray:
    """Commands ``[ticks, nv]``."""
    out = []
    for _ in range(ticks):
        step = controller.step(q)
        q = step.q_next
        out.append(step.v)
    return np.array(out)


def turns(controller: wbc.Controller, v: np.ndarray) -> int:
    """Ticks in which a joint goes to and fro."""
    limits = controller.stack.robot.limits.velocity
    change = np.diff(v, axis=0) / np.where(np.isfinite(limits), limits, 1.0)
    least = np.minimum(np.abs(change[1:]), np.abs(change[:-1]))
    return int(((change[1:] * change[:-1] < 0.0) & (least > TURN)).any(axis=1).sum())


def start(robot: wbc.Robot, rng: np.random.Generator) -> np.ndarray:
    moved = rng.uniform(-0.4, 0.4, robot.nv)
    moved[: robot.base_nv] = 0.0
    return robot.integrate(robot.neutral, moved, 1.0)


def to_a_distance(calm: bool, seed: int) -> int:
    """Turns of a robot on a slow base on its way to a place from which a far point is at a distance."""
    rng = np.random.default_rng(seed)
    name, tip = (("pr2", "r_gripper_tool_frame"), ("tiago", "arm_tool_link"))[seed % 2]
    robot = robot_of(name)
    point = tuple(rng.uniform(-3.0, 3.0, 3) + (0.0, 0.0, 0.8))
    stack = wbc.Stack(robot, 0.005, calm=calm).add(Distance(tip, point=point), name="range")
    controller = stack.add(Posture(), weight=1e-3).add(JointLimits()).compile(backend="vm")
    q = start(robot, rng)
    controller.reset(q)
    controller["range"].target = rng.uniform(0.05, 0.5)
    return turns(controller, rates(controller, q, 1500))


def test_joints_do_not_go_to_and_fro_where_a_base_is_slow() -> None:
    """The hand is stretched towards a point that the base brings it to: how far it can be changes sign there."""
    seeds = range(2, 8)
    assert max(to_a_distance(True, seed) for seed in seeds) < 60
    assert sum(to_a_distance(False, seed) for seed in seeds) > 10 * sum(to_a_distance(True, seed) for seed in seeds)


@pytest.mark.parametrize("solver", ["daqp", IN_PYTHON])
@pytest.mark.parametrize("scene", ["cone", "box"])
def test_margins_that_are_pulled_at_bend(scene: str, solver: str) -> None:
    """A task pulls along a margin at which the robot is, and posture alone says where: all come to rest."""
    name, tip = ("pr2", "r_gripper_tool_frame") if scene == "cone" else ("tiago", "arm_tool_link")
    robot, rng = robot_of(name), np.random.default_rng(63)
    stack, q = wbc.Stack(robot, 0.005), start(robot, rng)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    place = data.oMf[robot.model.getFrameId(tip)].translation
    if scene == "cone":
        stack.add(AxisCone(tip, half_angle=0.5), name="cone")
        stack.add(Distance(tip, point=tuple(place + (0.5, -0.3, 0.4))), name="pull").add(Posture(), weight=1e-3)
    else:
        stack.add(WorkspaceBox(tip, lower=tuple(place - 0.2), upper=tuple(place + 0.2)), name="box")
        stack.add(PitchPlaneLimit("arm_2_link", "arm_4_link", "arm_6_link", lower=-0.5, upper=1.0), name="plane")
        stack.add(Elbow("arm_4_link"), name="pull")
    controller = stack.add(JointLimits()).compile(backend="vm", solver=solver)
    controller.reset(q)
    controller["pull"].target = 0.2 if scene == "cone" else place + (0.2, 0.3, 0.2)
    v = rates(controller, q, 3000)
    assert turns(controller, v) < 60
    assert turns(controller, v[500:]) <= 2
    assert np.abs(v[-1]).max() < 1e-3
