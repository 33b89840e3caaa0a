"""Bounds on velocities and margins that hold a robot back from a task: no joint goes to and fro."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.backends import IN_PYTHON
from wbc.tasks import Distance, Elbow, JointLimits, PitchPlaneLimit, Posture, WorkspaceBox

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


def on_a_slow_base(calm: bool, seed: int, solver: str = "daqp") -> tuple[wbc.Controller, np.ndarray]:
    """A robot that is to come to where a far point is at a distance."""
    rng = np.random.default_rng(seed)
    name, tip = (("pr2", "r_gripper_tool_frame"), ("tiago", "arm_tool_link"))[seed % 2]
    robot = robot_of(name)
    point = tuple(rng.uniform(-3.0, 3.0, 3) + (0.0, 0.0, 0.8))
    stack = wbc.Stack(robot, 0.005, calm=calm).add(Distance(tip, point=point), name="range")
    controller = (
        stack.add(Posture(), name="posture", weight=1e-3).add(JointLimits()).compile(solver=solver, backend="vm")
    )
    q = start(robot, rng)
    controller.reset(q)
    controller["range"].target, controller["posture"].target = rng.uniform(0.05, 0.5), q
    return controller, q


def turns_on_the_way(calm: bool, seed: int) -> int:
    controller, q = on_a_slow_base(calm, seed)
    return turns(controller, rates(controller, q, 1500))


def test_joints_do_not_go_to_and_fro_where_a_base_is_slow() -> None:
    """The hand is stretched towards a point that the base brings it to: how far it can be changes sign there."""
    calm, plain = (sum(turns_on_the_way(calm, seed) for seed in range(2, 8)) for calm in (True, False))
    assert calm < 600
    assert plain > 10 * calm


@pytest.mark.parametrize("solver", ["daqp", IN_PYTHON])
def test_margins_bend(solver: str) -> None:
    """The elbow is pulled where the tip must not go with it: along the margins nothing but their curvature counts."""
    robot, rng = robot_of("tiago"), np.random.default_rng(63)
    stack, q = wbc.Stack(robot, 0.005), start(robot, rng)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    place = data.oMf[robot.model.getFrameId("arm_tool_link")].translation
    stack.add(WorkspaceBox("arm_tool_link", lower=tuple(place - 0.2), upper=tuple(place + 0.2)))
    stack.add(PitchPlaneLimit("arm_2_link", "arm_4_link", "arm_6_link", lower=-0.5, upper=1.0))
    stack.add(Elbow("arm_4_link"), name="elbow").add(JointLimits())
    controller = stack.compile(solver=solver, backend="vm")
    controller.reset(q)
    controller["elbow"].target = (-0.39, -0.16, 0.55)
    v = rates(controller, q, 3000)
    assert turns(controller, v) < 10
    assert np.abs(v[-1]).max() < 1e-3


@pytest.mark.parametrize("solver", ["daqp", IN_PYTHON])
def test_commands_move_with_what_bounds_hold_back(solver: str) -> None:
    """Derivatives against differences, and all ticks of a batch as one alone."""
    controller, q = on_a_slow_base(True, 4, solver)
    robot, unit, by = controller.stack.robot, np.eye(controller.stack.robot.nv), 1e-6

    def command(place: np.ndarray) -> np.ndarray:
        controller.reset(place)
        return controller.step(place).v

    slopes = np.array(
        [(command(robot.integrate(q, by * e, 1.0)) - command(robot.integrate(q, -by * e, 1.0))) for e in unit]
    )
    controller.reset(q)
    step = controller.step(q)
    found, batch = step.derivative("q"), controller.batch(2)
    np.testing.assert_allclose(found, slopes.T / (2.0 * by), atol=1e-5 * np.abs(found).max())
    assert np.abs(found).max() > 1.0
    together = batch.step(np.array([q, q]))
    assert batch.held_back
    np.testing.assert_array_equal(together.v, [step.v, step.v])
    np.testing.assert_allclose(together.derivative("q"), [found, found], atol=1e-9)
