"""A hold of six rows on four joints: what is left after it gives way is a set without room for rounding."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import wbc
from tests.backends import IN_PYTHON, way


def test_both_back_ends_find_the_optimum_of_a_thin_rest() -> None:
    robot = wbc.robots.load("panda")
    stack = wbc.Stack(robot, dt=0.005)
    stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
    stack.add(wbc.tasks.Posture(), weight=1e-3)
    stack.add(wbc.tasks.JointLimits())
    stack.add(wbc.tasks.Hold("panda_link4"), name="hold")
    stack.add(wbc.tasks.FrameVelocityLimit("panda_hand_tcp", linear=0.2, angular=0.5), name="speed")
    one_call, in_python = stack.compile(backend="auto"), stack.compile(**way(IN_PYTHON))
    rng = np.random.default_rng(0)
    home = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.7])
    for _ in range(60):
        q = pin.integrate(robot.model, home, 0.03 * rng.normal(size=robot.nv))
        shift = 0.2 * rng.normal(size=3)
        answers = []
        for controller in (one_call, in_python):
            controller.reset(home)
            target = controller["hand"].target.copy()
            target.translation += shift
            controller["hand"].target = target
            controller["hand"].gain = 5.0
            answers.append(controller.step(q))
        one, other = answers
        assert one.status == other.status == "relaxed"
        assert [(s.item, s.row) for s in one.relaxed] == [(s.item, s.row) for s in other.relaxed]
        assert np.abs(one.v - other.v).max() < 1e-6
