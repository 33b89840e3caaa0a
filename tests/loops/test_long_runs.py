"""Random ticks within limits of position, velocity and acceleration, of velocities, accelerations and torques; with
``REPEATS=200`` 10^5 of each mechanism and linkage.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.loops.mechanisms import MOTORS, NAMED, random_linkage, with_motors
from tests.loops.test_reading import CASSIE
from tests.loops.test_torques import linkage, needed, rows_at
from tests.repeats import repeats
from wbc.robot import Robot

DT = 0.005
#: Ticks of a mechanism
TICKS = repeats(500)
#: Linkages that are drawn, at most 48
LINKAGES = min(repeats(6), 48)
#: Ticks from one start towards random postures
EPISODE = 2000
#: What configurations are corrected by at most, 0.1 (1 + |v|) [rad/s]
CORRECTED = 0.1 * (1.0 + 3.0)
#: Of so many ticks MuJoCo looks at the torques of one
SPARSE = 8


def bounded(robot: Robot, seed: int) -> Robot:
    """Of 3 rad/s, of accelerations that are drawn, and of positions within the file's and 1 rad of neutral."""
    acceleration = float(np.random.default_rng(seed).choice([5.0, 20.0, 100.0]))
    index, low, high = robot.position_index, robot.limits.position_lower.copy(), robot.limits.position_upper.copy()
    has = index >= 0
    low[has] = np.maximum(low[has], robot.neutral[index[has]] - 1.0)
    high[has] = np.minimum(high[has], robot.neutral[index[has]] + 1.0)
    return robot.with_limits(velocity=3.0, acceleration=acceleration, position_lower=low, position_upper=high)


def run(robot: Robot, count: int, seed: int) -> None:
    """Every tick is solved, moves within limits, and leaves the loops closed."""
    stack = wbc.Stack(robot, DT).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
    controller, rng, index = stack.compile(), np.random.default_rng(seed), robot.position_index
    has, limits, moved = index >= 0, robot.limits, 0.0
    q, v = robot.neutral, np.zeros(robot.nv)
    for k in range(count):
        if k % EPISODE == 0:
            q, v = robot.neutral if k == 0 else robot.closed(robot.neutral), np.zeros(robot.nv)
            controller.reset(q)
        if k % 60 == 0:
            controller["posture"].target = pin.integrate(robot.model, q, 2.0 * rng.normal(size=robot.nv))
        step = controller.step(q)
        assert step.status == "solved", (k, step)
        assert np.isfinite(step.v).all()
        assert (np.abs(step.v) <= limits.velocity * (1.0 + 1e-9)).all()
        assert (np.abs(step.v - v) <= limits.acceleration * DT * (1.0 + 1e-9) + 1e-12).all()
        q, v = pin.integrate(robot.model, q, step.v * DT), np.array(step.v)
        at = q[index[has]]
        assert (at >= limits.position_lower[has] - 1e-9).all()
        assert (at <= limits.position_upper[has] + 1e-9).all()
        assert max(robot.loop_gaps(q).values()) <= 1e-9, k
        moved = max(moved, float(np.abs(step.v).max()))
    assert moved > 0.1, "nothing moved"


@pytest.mark.parametrize("name", [*NAMED, "cassie"])
def test_mechanisms(name: str) -> None:
    robot = wbc.robots.load(CASSIE / "cassie_v2.sdf" if name == "cassie" else NAMED[name], shapes="none")
    run(bounded(robot, 2), TICKS, 0)


@pytest.mark.parametrize("seed", range(LINKAGES))
def test_random_linkages(seed: int) -> None:
    run(bounded(wbc.robots.load(random_linkage(seed), shapes="none"), seed), TICKS, seed)


def run_second_order(robot: Robot, text: str, command: str, count: int, seed: int) -> None:
    """Every tick is solved and leads to where loops are closed, by a velocity that keeps them closed, within limits;
    torques are those that MuJoCo says its accelerations need.
    """
    stack = wbc.Stack(robot, DT).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
    controller, rng, limits, moved = stack.compile(command=command), np.random.default_rng(seed), robot.limits, 0.0
    motors, q, v = list(robot.motors), robot.neutral, np.zeros(robot.nv)
    for k in range(count):
        if k % EPISODE == 0:
            q, v = robot.neutral, np.zeros(robot.nv)
            controller.reset(q)
        if k % 60 == 0:
            controller["posture"].target = pin.integrate(robot.model, q, 2.0 * rng.normal(size=robot.nv))
        step = controller.step(q, v)
        assert step.status == "solved", (k, step)
        assert np.isfinite(step.a).all()
        assert (np.abs(step.v) <= limits.velocity * (1.0 + 1e-9)).all(), k
        assert (np.abs(step.a) <= limits.acceleration * (1.0 + 1e-9)).all(), k
        assert (np.abs(step.v - v) <= limits.acceleration * DT * (1.0 + 1e-9)).all(), k
        if command == "torque" and k % SPARSE == 0:
            torques, missing = needed(robot, text, q, v, step.a)
            size = max(1.0, float(np.abs(torques).max()))
            assert np.abs(missing).max() < 1e-6 * size, k
            assert np.abs(step.torque[motors] - torques).max() < 1e-6 * size, k
        reached = pin.integrate(robot.model, q, (v + 0.5 * DT * step.a) * DT)
        q, v = np.array(step.q_next), np.array(step.v)
        assert np.abs(robot.difference(reached, q)).max() < CORRECTED * DT, k
        assert max(robot.loop_gaps(q).values()) <= 1e-9, k
        assert np.abs(rows_at(robot, q) @ v).max() <= 1e-9, k
        moved = max(moved, float(np.abs(step.v).max()))
    assert moved > 0.1, "nothing moved"


@pytest.mark.parametrize("command", ["acceleration", "torque"])
@pytest.mark.parametrize("name", NAMED)
def test_mechanisms_of_second_order(name: str, command: str) -> None:
    text = with_motors(NAMED[name], MOTORS[name])
    robot = wbc.robots.load(text, shapes="none", velocity=3.0, acceleration=200.0)
    run_second_order(robot, text, command, TICKS, 0)


@pytest.mark.parametrize("seed", range(min(repeats(3), 24)))
def test_random_linkages_of_second_order(seed: int) -> None:
    text, robot = linkage(seed)
    run_second_order(robot, text, "torque" if seed % 2 else "acceleration", TICKS, seed)
