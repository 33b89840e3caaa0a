"""What motors and drives are limited to: torques, how fast they change, and what a tick without an answer lacks."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin
import pytest

from tests.torque.problems import DT, robot
from wbc.api import Controller, Stack
from wbc.robot.transmission import Transmission
from wbc.tasks import DriveTorqueLimits, EndEffector, JointLimits, Posture, TorqueLimits

WRIST = Transmission(
    ("panda_joint6", "panda_joint7"),
    {"left": {"panda_joint6": 1.0, "panda_joint7": 0.5}, "right": {"panda_joint6": 1.0, "panda_joint7": -0.5}},
)


@cache
def controller() -> Controller:
    made = Stack(robot("panda"), dt=DT).add(EndEffector("panda_hand_tcp", kind="position"), name="hand")
    made.add(Posture(), name="posture", weight=1e-2).add(JointLimits())
    made.add(TorqueLimits(slew=400.0), name="motors").add(DriveTorqueLimits(WRIST, torque=(2.0, 1.0)), name="wrist")
    return made.compile(command="torque", backend="vm")


def test_torques_change_no_faster_and_drives_give_no_more_than_they_can() -> None:
    """The hand is thrown about; without the slew rate torques jump."""
    tick, bot, rng = controller().clone(), robot("panda"), np.random.default_rng(0)
    q, v = bot.neutral.copy(), np.zeros(bot.nv)
    tick.reset(q)
    tick["hand"].set(stiffness=400.0, damping=40.0)
    last, fastest, most, free = None, 0.0, np.zeros(2), 0.0
    for k in range(36):
        if k % 6 == 0:
            tick["hand"].target = rng.uniform((0.2, -0.4, 0.2), (0.6, 0.4, 0.8))
        dt = DT * rng.uniform(0.25, 2.0)
        if k == 24:
            tick["motors"].slew = np.full(7, 1e6)
        step = tick.step(q, v, dt)
        if last is not None:
            rate = float(np.abs(step.torque - last).max() / dt)
            fastest, free = (max(fastest, rate), free) if k < 24 else (fastest, max(free, rate))
            assert tick["motors"].last == pytest.approx(last)
        last = step.torque
        most = np.maximum(most, np.abs(WRIST.inverse.T @ step.torque[[5, 6]]))
        q, v = pin.integrate(bot.model, q, (v + 0.5 * dt * step.a) * dt), step.v
    assert 399.0 < fastest < 400.0 + 1e-6
    assert free > 1000.0
    assert most == pytest.approx([2.0, 1.0], rel=1e-9)


def test_a_slew_rate_of_motors_without_limits_is_that_of_none() -> None:
    bot = robot("panda").with_limits(effort=np.inf)
    made = Stack(bot, dt=DT).add(Posture()).add(JointLimits()).add(TorqueLimits(slew=10.0), name="motors")
    tick = made.compile(command="torque", backend="vm")
    tick.reset(bot.neutral)
    assert tick.step(bot.neutral, np.zeros(7)).status == "solved"
    assert "slew" not in tick["motors"].names


def test_a_reset_forgets_the_last_torques() -> None:
    tick, bot = controller().clone(), robot("panda")
    tick.reset(bot.neutral)
    first = tick.step(bot.neutral, np.zeros(7)).torque
    tick.reset(bot.neutral)
    tick["hand"].target = tick["hand"].target + np.array([0.0, 0.3, 0.0])
    assert np.abs(tick.step(bot.neutral, np.zeros(7)).torque - first).max() > 1.0
    assert (tick["motors"].last == 1e30).all()


def test_motors_that_cannot_carry_the_arm_are_named_in_newton_metres() -> None:
    """The tick brakes with what the motors can give, and says what is missing to hold the arm against its weight."""
    bot = robot("panda").with_limits(acceleration=0.1)
    made = Stack(bot, dt=DT).add(JointLimits()).add(TorqueLimits(), name="motors").add(Posture())
    tick = made.add(DriveTorqueLimits(WRIST, torque=0.5), name="wrist").compile(command="torque", backend="vm")
    tick.reset(bot.neutral)
    tick["motors"].scale = 0.05
    step = tick.step(bot.neutral, np.zeros(7))
    assert step.status == "braked"
    needed = pin.computeGeneralizedGravity(bot.model, bot.model.createData(), bot.neutral)
    lacking = np.abs(needed) - 0.05 * bot.limits.effort
    wanted = {f"motors/{bot.dof_names[i]}": lacking[i] for i in np.flatnonzero(lacking > 0.0)}
    assert wanted
    found = {f"{s.item}/{s.row}": s.amount for s in step.relaxed if s.item == "motors"}
    assert found == pytest.approx(wanted, rel=1e-6)
    assert all(s.unit == "N m" for s in step.relaxed)
    assert (np.abs(step.torque) <= 0.05 * bot.limits.effort).all()
    assert (np.abs(WRIST.inverse.T @ step.torque[[5, 6]]) <= 0.5 + 1e-12).all()
    assert "motors/panda_joint4 by 17.7 N m" in str(step)
