"""Margins of accelerations in discrete time: they stay positive and decay no faster than their rate says."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin

from tests.constraints.robots import with_test_shapes
from tests.torque.problems import robot
from wbc.api import Controller, Stack
from wbc.shapes import Sphere
from wbc.tasks import EndEffector, Obstacle, Posture, WorkspaceBox

DT = 0.005


@cache
def controller() -> Controller:
    bot = with_test_shapes(robot("panda"))
    stack = Stack(bot, dt=DT)
    stack.add(EndEffector("panda_hand_tcp", kind="position"), name="hand")
    stack.add(Posture(), name="posture", weight=1e-3)
    stack.add(WorkspaceBox("panda_hand_tcp", (-0.6, -0.4, 0.1), (0.6, 0.4, 0.9)), name="box")
    stack.add(Obstacle(Sphere(0.1), margin=0.02), name="ball")
    return stack.compile(command="acceleration", backend="vm")


def test_a_hand_that_is_driven_at_walls_and_a_moving_ball_stays_clear() -> None:
    tick, rng = controller(), np.random.default_rng(2)
    bot = tick.stack.robot
    q, v = bot.neutral.copy(), np.zeros(bot.nv)
    tick.reset(q)
    tick["hand"].set(stiffness=64.0, damping=16.0)
    least, near, ball = np.inf, 0, np.array([0.4, 0.3, 0.5])
    for k in range(300):
        if k % 100 == 0:
            tick["hand"].target = rng.uniform((-0.8, -0.6, -0.1), (0.8, 0.6, 0.8))
        speed = 0.1 * np.array([np.sin(0.02 * k), np.cos(0.03 * k), 0.0])
        dt = DT * rng.uniform(0.25, 2.0)
        tick["ball"].set(pose=pin.SE3(np.eye(3), ball), velocity=np.r_[speed, np.zeros(3)])
        step = tick.step(q, v, dt)
        ahead = np.concatenate(list(step.margins_ahead.values()))
        q, v = pin.integrate(bot.model, q, (v + 0.5 * dt * step.a) * dt), step.v
        ball = ball + speed * dt
        here = np.concatenate(list(step.margins.values()))
        least, near = min(least, float(ahead.min())), near + bool(here.min() < 0.01)
    assert near > 5, "nothing came near"
    assert least > -1e-3
