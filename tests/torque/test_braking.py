"""Accelerations that motors have in every state: an adversary breaks limits with more, and none with these."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.torque.problems import robot
from wbc.controller import Stack
from wbc.errors import CommandError, RangeError
from wbc.robot import Robot
from wbc.support import braking
from wbc.tasks import JointLimits, Posture, TorqueLimits


def weak(acceleration: float) -> Robot:
    bot = robot("panda")
    return bot.with_limits(acceleration=acceleration, velocity=2.0)


def thrown(bot: Robot) -> tuple[float, int]:
    """How far joints pass their limits [rad], and ticks that brake, thrown from end to end of their ranges."""
    made = Stack(bot, dt=0.01).add(Posture(), name="posture").add(JointLimits()).add(TorqueLimits())
    tick = made.compile(command="torque", backend="vm")
    rng, worst, braked, limits = np.random.default_rng(0), 0.0, 0, bot.limits
    q, v = bot.neutral.copy(), np.zeros(bot.nv)
    tick.reset(q)
    tick["posture"].set(stiffness=1e3, damping=10.0)
    for k in range(360):
        if k % 120 == 0:
            tick["posture"].target = np.where(rng.random(bot.nv) < 0.5, limits.position_lower, limits.position_upper)
        step = tick.step(q, v)
        braked += step.status == "braked"
        a = pin.aba(bot.model, bot.model.createData(), q, v, step.torque)
        q, v = pin.integrate(bot.model, q, (v + 0.005 * a) * 0.01), v + 0.01 * a
        worst = max(worst, float(np.maximum(q - limits.position_upper, limits.position_lower - q).max()))
    return worst, braked


def test_limits_hold_at_accelerations_that_the_motors_have_and_not_at_others() -> None:
    asked = weak(100.0)
    found = braking(asked, samples=400)
    assert 0.005 < found.scale < 0.9
    assert found.acceleration == pytest.approx(found.scale * asked.limits.acceleration)
    # the state that decides: with all torque on one side nothing is left
    M = pin.crba(asked.model, asked.model.createData(), found.q)
    M = np.triu(M) + np.triu(M, 1).T
    h = pin.nonLinearEffects(asked.model, asked.model.createData(), found.q, found.v)
    k = asked.dof_names.index(found.decides)
    assert np.abs(h[k]) + np.abs(M[k]) @ found.acceleration == pytest.approx(0.95 * asked.limits.effort[k])
    worst, braked = thrown(asked)
    assert max(worst, braked) > 0, "the adversary breaks nothing, which is no test"
    worst, braked = thrown(asked.with_limits(acceleration=found.acceleration))
    assert worst < 1e-9
    assert braked == 0


def test_refusals() -> None:
    with pytest.raises(CommandError, match="contacts"):
        braking(robot("walker"))
    with pytest.raises(RangeError, match="to carry the robot"):
        braking(robot("panda").with_limits(effort=5.0), samples=20)
    with pytest.raises(RangeError, match="finite"):
        braking(robot("panda").with_limits(effort=np.inf))
