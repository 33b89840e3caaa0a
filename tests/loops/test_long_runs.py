"""Random ticks within limits of position, velocity and acceleration; with ``REPEATS=200`` 10^5 of each mechanism."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.loops.mechanisms import NAMED, random_linkage
from tests.loops.test_reading import CASSIE
from tests.repeats import repeats
from wbc.robot import Robot

DT = 0.005
#: Ticks of a mechanism
TICKS = repeats(500)
#: Linkages that are drawn, at most 48
LINKAGES = min(repeats(6), 48)
#: Ticks from one start towards random postures
EPISODE = 2000


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
