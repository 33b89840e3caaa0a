"""Mimic joints and undriven directions hold in every stack without being asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.backends import COMPILED, IN_PYTHON, way
from tests.controller.stacks import DT, robot
from wbc.api import Controller, Stack
from wbc.controller import Status, core_of
from wbc.errors import DuplicateNameError
from wbc.robot import Robot
from wbc.robot.robot import Coupling
from wbc.tasks import EndEffector, FrameVelocityLimit, JointLimits, Mechanism, Posture

TIPS = {"talos_full": "gripper_left_fingertip_1_link", "tiago": "wrist_ft_tool_link"}


def coupled(bot: Robot, rng: np.random.Generator) -> np.ndarray:
    """A random configuration near neutral that the couplings allow."""
    q = pin.integrate(bot.model, bot.neutral, 0.2 * rng.uniform(-1.0, 1.0, bot.nv))
    for c in bot.couplings:
        here, there = (int(bot.position_index[i]) for i in (c.follower, c.leader))
        q[here] = c.ratio * q[there] + c.offset
    return q


def violation(bot: Robot, v: np.ndarray) -> float:
    """Largest |v_follower - ratio v_leader| and |v_i| of undriven directions."""
    off = [v[c.follower] - c.ratio * v[c.leader] for c in bot.couplings] + [v[i] for i in bot.locked_dofs]
    return float(np.abs(off).max())


def build(name: str, backend: str = IN_PYTHON) -> Controller:
    bot = wbc.robots.load(name).with_limits(acceleration=20.0)
    stack = Stack(bot, DT).add(EndEffector(TIPS[name]), name="hand").add(Posture(), name="posture", weight=1e-2)
    stack.add(JointLimits(), name="limits").add(FrameVelocityLimit(TIPS[name], linear=0.5), name="speed")
    return stack.compile(**way(backend))


@pytest.mark.parametrize("name", TIPS)
def test_rows_are_there_and_hold(name: str) -> None:
    tick = build(name)
    bot, rng = tick.stack.robot, np.random.default_rng(1)
    assert isinstance(tick.stack["mechanism"].item, Mechanism)
    assert len(core_of(tick).layout.blocks["mechanism"].rows) == len(bot.couplings) + len(bot.locked_dofs) > 0
    moved = 0.0
    for _ in range(8):
        q = coupled(bot, rng)
        tick.reset(q)
        target = tick["hand"].target
        tick["hand"].target = pin.SE3(target.rotation, target.translation + rng.normal(0.0, 0.2, 3))
        tick["posture"].target = pin.integrate(bot.model, q, 0.1 * rng.normal(size=bot.nv))  # no mechanism allows that
        step = tick.step(q)
        assert step.status is Status.SOLVED
        assert violation(bot, step.v) < 1e-9
        driven = [c.leader for c in bot.couplings] + [0]
        moved = max(moved, float(np.abs(step.v[driven]).max()))
    assert moved > 1e-3
    # without the rows the same wish would break the mechanism
    tick["mechanism"].enabled = False
    assert violation(bot, tick.step(q).v) > 1e-4


@pytest.mark.parametrize("backend", [IN_PYTHON, COMPILED])
def test_a_configuration_that_does_not_fit_is_brought_back(backend: str) -> None:
    bot = wbc.robots.load("talos_full", base="fixed") if backend == IN_PYTHON else coupled_arm()
    tick = Stack(bot, DT).add(Posture(), name="posture", weight=0.1).compile(**way(backend))
    q = coupled(bot, np.random.default_rng(2))
    c = bot.couplings[0]
    here, there = (int(bot.position_index[i]) for i in (c.follower, c.leader))
    q[here] += 0.05
    off = [abs(q[here] - c.ratio * q[there] - c.offset)]
    for _ in range(300):
        q = pin.integrate(bot.model, q, tick.step(q).v * DT)
        off.append(abs(q[here] - c.ratio * q[there] - c.offset))
    assert (np.diff(off) <= 1e-12).all()
    # 300 steps of dt with gain 5/s
    assert off[-1] / off[0] == pytest.approx((1.0 - 5.0 * DT) ** 300, rel=1e-6)


def coupled_arm() -> Robot:
    """A Panda of which the third joint mimics the first."""
    return replace(robot("panda"), couplings=(Coupling(follower=2, leader=0, ratio=-0.5, offset=0.1),))


def test_the_name_is_taken() -> None:
    stack = Stack(wbc.robots.load("tiago"), DT)
    with pytest.raises(DuplicateNameError):
        stack.add(Posture(), name="mechanism")
    assert "mechanism" not in Stack(wbc.robots.load("panda"), DT)
