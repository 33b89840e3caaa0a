"""Velocity and torque level draw the same path, and tasks decay as their stiffness and damping say."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import cKDTree

from tests.torque.problems import robot
from wbc.api import Controller, Stack
from wbc.tasks import EndEffector, Posture
from wbc.tasks.frames import frame_pose

DT = 0.005
FRAME = "panda_hand_tcp"


@cache
def controller(command: str) -> Controller:
    stack = Stack(robot("panda"), dt=DT, calm=False)
    stack.add(EndEffector(FRAME), name="hand")
    stack.add(Posture(), name="posture", weight=1e-4)
    return stack.compile(command=command, backend="vm")


@cache
def drawn(command: str) -> tuple[np.ndarray, float]:
    """Path of the hand to a pose [ticks, 3], and the time integral of the distance [m s]."""
    tick, bot = controller(command), robot("panda")
    q, v = bot.neutral.copy(), np.zeros(bot.nv)
    tick.reset(q)
    goal = frame_pose(bot, FRAME, q) * pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.5])), np.array([0.1, 0.2, 0.1]))
    tick["hand"].target = goal
    path, integral = [], 0.0
    for _ in range(600):
        step = tick.step(q) if command == "velocity" else tick.step(q, v)
        speed = step.v if command == "velocity" else 0.5 * (v + step.v)
        q, v = pin.integrate(bot.model, q, speed * DT), step.v
        path.append(frame_pose(bot, FRAME, q).translation)
        integral += DT * step.residuals["hand"].norm("m")
    return np.array(path), integral


@pytest.mark.parametrize("command", ["acceleration", "torque"])
def test_same_path_as_velocities(command: str) -> None:
    (wanted, time), (found, same) = drawn("velocity"), drawn(command)
    length = float(np.linalg.norm(np.diff(wanted, axis=0), axis=1).sum())
    assert cKDTree(wanted).query(found)[0].max() < 0.01 * length
    assert same == pytest.approx(time, rel=0.01)


def test_stiffness_and_damping_are_those_of_the_error() -> None:
    """From rest, e(t) = e0 (1 + w t) exp(-w t) with w = sqrt(stiffness) where damping = 2 w."""
    tick, bot = controller("acceleration"), robot("panda")
    tick["hand"].set(stiffness=36.0, damping=12.0)
    try:
        q, v = bot.neutral.copy(), np.zeros(bot.nv)
        tick.reset(q)
        goal = frame_pose(bot, FRAME, q)
        goal.translation += np.array([0.0, 0.05, 0.0])
        tick["hand"].target = goal
        for _ in range(100):
            step = tick.step(q, v)
            q, v = pin.integrate(bot.model, q, 0.5 * (v + step.v) * DT), step.v
        wanted = 0.05 * (1 + 6.0 * 0.5) * np.exp(-6.0 * 0.5)
        found = goal.translation - frame_pose(bot, FRAME, q).translation
        assert np.linalg.norm(found) == pytest.approx(wanted, rel=0.03)
    finally:
        tick["hand"].set(stiffness=16.0, damping=8.0)


def test_a_moving_target_is_followed_without_lag_where_its_acceleration_is_given() -> None:
    tick, bot = controller("acceleration"), robot("panda")
    worst = {}
    for given in (True, False):
        q, v = bot.neutral.copy(), np.zeros(bot.nv)
        tick.reset(q)
        start = frame_pose(bot, FRAME, q)
        worst[given] = 0.0
        for k in range(300):
            t, w, size = k * DT, 6.0, 0.05
            goal = pin.SE3(start.rotation, start.translation + np.array([0.0, size * (1 - np.cos(w * t)), 0.0]))
            rate, second = np.zeros(6), np.zeros(6)
            rate[1], second[1] = size * w * np.sin(w * t), size * w * w * np.cos(w * t)
            tick["hand"].set(target=goal, feedforward=rate, acceleration=second if given else np.zeros(6))
            step = tick.step(q, v)
            q, v = pin.integrate(bot.model, q, 0.5 * (v + step.v) * DT), step.v
            worst[given] = max(worst[given], step.residuals["hand"].norm("m"))
    tick["hand"].set(feedforward=np.zeros(6), acceleration=np.zeros(6))
    assert worst[True] < 0.1 * worst[False]
    assert worst[True] < 6e-3
