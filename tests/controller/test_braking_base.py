"""What has no acceleration limit brakes together with the joints that have one, and not within one tick."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.backends import IN_PYTHON, way
from wbc.api import Stack
from wbc.controller import Policy
from wbc.tasks import Hold, JointLimits, Posture

DT, LIMIT = 0.01, 20.0


@pytest.mark.parametrize("backend", ["vm", IN_PYTHON])
def test_a_base_without_a_limit_stops_with_the_joint_that_takes_longest(backend: str) -> None:
    robot = wbc.robots.load("quadruped")
    limits = np.r_[np.full(6, np.inf), np.full(robot.nv - 6, LIMIT)]
    robot = robot.with_limits(acceleration=limits, velocity=np.r_[np.full(6, np.inf), np.full(robot.nv - 6, 10.0)])
    stack = Stack(robot, DT).add(Posture()).add(JointLimits(), name="limits")
    for name, frame in zip(("a", "b"), ("front_left_foot", "front_left_foot"), strict=True):
        stack.add(Hold(robot.frames[frame], kind="position"), name=name)
    controller = stack.compile(**way(backend))
    controller.policy = Policy(conflict="brake")
    v = np.r_[0.5, -0.2, 0.1, 0.3, -0.6, 0.2, 1.0, np.linspace(-0.5, 0.5, robot.nv - 7)]
    before, q = v.copy(), robot.neutral
    controller.reset(q, v)
    target = controller["a"].target
    controller["a"].target = pin.SE3(target.rotation, target.translation + np.array([0.1, 0.0, 0.0]))
    for tick in range(1, 6):
        step = controller.step(q)
        assert step.status == "braked"
        share = max(1.0 - tick * LIMIT * DT / 1.0, 0.0)
        np.testing.assert_allclose(
            step.v[6:], np.sign(v[6:]) * np.maximum(np.abs(v[6:]) - tick * LIMIT * DT, 0.0), atol=1e-12
        )
        np.testing.assert_allclose(step.v[:6], share * v[:6], atol=1e-12)
        assert (np.abs(step.v[:6]) < np.abs(before[:6])).all()
        before, q = step.v, robot.integrate(q, step.v, DT)
    assert np.abs(step.v).max() < 1e-12

    controller["limits"].enabled = False
    assert not controller.step(q, v).v.any()
