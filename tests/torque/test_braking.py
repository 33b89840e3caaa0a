"""Accelerations that motors have in every state: an adversary breaks limits with more, and none with these."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.pinocchio_state import PinocchioState
from tests.torque.problems import controller, robot
from wbc.api import Controller, Stack
from wbc.errors import CommandError, RangeError
from wbc.robot import Robot
from wbc.support import braking
from wbc.tasks import JointLimits, Posture, RigidGrasp, SurfaceContact, TorqueLimits


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
    state, k = PinocchioState(asked.model, found.q, found.v), asked.dof_names.index(found.decides)
    assert np.abs(state.h[k]) + np.abs(state.M[k]) @ found.acceleration == pytest.approx(0.95 * asked.limits.effort[k])
    worst, braked = thrown(asked)
    assert max(worst, braked) > 0, "the adversary breaks nothing, which is no test"
    worst, braked = thrown(asked.with_limits(acceleration=found.acceleration))
    assert worst < 1e-9
    assert braked == 0


def held(bot: Robot) -> Controller:
    """The walker holds on with two arms; the third is free."""
    made = Stack(bot, dt=0.005).add(Posture(), name="posture").add(JointLimits()).add(TorqueLimits())
    for arm in (1, 2):
        made.add(RigidGrasp(f"arm{arm}_hand", force=300.0, torque=(80.0, 90.0, 100.0)), name=f"grip {arm}")
    return made.compile(command="torque", backend="vm")


def failed(bot: Robot, ticks: int, most: int) -> int:
    """Ticks that find no answer, up to ``most``, where the free arm is thrown from end to end of its range."""
    tick, rng, limits, arm = held(bot), np.random.default_rng(0), bot.limits, np.arange(18, 24)
    q, v, count, places = bot.neutral.copy(), np.zeros(bot.nv), 0, bot.position_index[18:]
    tick.reset(q)
    tick["posture"].set(stiffness=1e3, damping=10.0)
    for k in range(ticks):
        if k % 60 == 0:
            target = q.copy()
            target[places] = np.where(rng.random(6) < 0.5, limits.position_lower[arm], limits.position_upper[arm])
            tick["posture"].target = target
        step = tick.step(q, v)
        count += step.status != "solved"
        # whatever an answer costs, and whatever it says is lacking, no more is sent than the motors have
        assert (np.abs(step.torque) <= limits.effort).all()
        q, v = pin.integrate(bot.model, q, (v + 0.0025 * step.a) * 0.005), v + 0.005 * step.a
        assert (q[places] <= limits.position_upper[arm] + 1e-9).all()
        assert (q[places] >= limits.position_lower[arm] - 1e-9).all()
        if count > most:
            break
    return count


def test_on_contacts_limits_hold_at_accelerations_that_motors_and_grips_have() -> None:
    bot = robot("walker")
    at = bot.neutral[bot.position_index[18:]]
    low, high = bot.limits.position_lower.copy(), bot.limits.position_upper.copy()
    low[18:], high[18:] = at - 0.25, at + 0.25
    asked = bot.with_limits(position_lower=low, position_upper=high, velocity=3.0, acceleration=60.0, effort=20.0)
    tick = held(asked)
    found = braking(tick, bot.neutral, samples=60)
    assert 0.02 < found.scale < 0.9
    assert np.isinf(found.acceleration[:6]).all()
    assert found.acceleration[6:] == pytest.approx(found.scale * 60.0)
    # less torque, less deceleration, in the same states
    few = braking(tick, bot.neutral, samples=20).scale
    tick["torque_limits"].set(scale=0.9)
    assert braking(tick, bot.neutral, samples=20).scale < 0.95 * few
    assert failed(asked, 120, 0), "the adversary finds nothing, which is no test"
    assert not failed(asked.with_limits(acceleration=found.acceleration), 120, 0)


@pytest.mark.parametrize(("acceleration", "speed"), [(np.inf, 1.1), (40.0, 0.28)])
def test_an_arm_at_its_stop_with_and_without_limits_of_acceleration(acceleration: float, speed: float) -> None:
    """1 mrad before it the speed is viable in both; only motors that could brake within one tick have the first."""
    bot = wbc.robots.load("talos").with_limits(acceleration=acceleration)
    made = Stack(bot, dt=0.002).add(Posture(), weight=1e-4).add(JointLimits()).add(TorqueLimits())
    for side in ("left", "right"):
        made.add(SurfaceContact(f"{side}_sole_link", half_lengths=(0.1, 0.06), friction=0.6), name=side)
    tick, joint = made.compile(command="torque", backend="vm"), bot.dof_names.index("arm_left_2_joint")
    q, v = bot.neutral.copy(), np.zeros(bot.nv)
    q[bot.position_index[joint]], v[joint] = bot.limits.position_lower[joint] + 1e-3, -speed
    tick.reset(q)
    step = tick.step(q, v)
    assert (step.status == "solved") == np.isfinite(acceleration)
    assert (np.abs(step.torque) <= bot.limits.effort).all()
    # without an answer limits of motion give way, by name
    ahead = q[bot.position_index[joint]] + (v[joint] + 0.001 * step.a[joint]) * 0.002
    assert (ahead > bot.limits.position_lower[joint]) == np.isfinite(acceleration)
    assert any(slack.item == "joint_limits" for slack in step.relaxed) != np.isfinite(acceleration)


def test_refusals() -> None:
    with pytest.raises(CommandError, match="contacts"):
        braking(robot("walker"))
    tick = controller("talos")
    with pytest.raises(CommandError, match="about which the contacts stay"):
        braking(tick)
    with pytest.raises(RangeError, match=r"wrench/.* by .* N"):
        braking(tick, tick.stack.robot.neutral, samples=9)
    tick = Stack(robot("panda"), dt=0.002).add(Posture()).compile(command="acceleration", backend="vm")
    with pytest.raises(CommandError, match="commands acceleration"):
        braking(tick, tick.stack.robot.neutral)
    with pytest.raises(RangeError, match="to carry the robot"):
        braking(robot("panda").with_limits(effort=5.0), samples=20)
    with pytest.raises(RangeError, match="finite"):
        braking(robot("panda").with_limits(effort=np.inf))
