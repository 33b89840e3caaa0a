"""What every tick has, of torques too: back ends, recordings, copies, exports, levels, prices, explanations, caps."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.torque.problems import DT, controller, robot, stack
from wbc.api import Controller, Stack
from wbc.errors import CommandError
from wbc.tasks import EndEffector, JointLimits, Posture, RigidGrasp, TorqueLimits, WorkspaceBox


def run(tick: Controller, ticks: int, seed: int = 4) -> np.ndarray:
    """Accelerations, wrenches and torques of some ticks towards changing targets, with dt that changes."""
    rng, bot = np.random.default_rng(seed), tick.stack.robot
    q, v, out = bot.neutral.copy(), np.zeros(bot.nv), []
    tick.reset(q)
    for k in range(ticks):
        if k % 5 == 0:
            tick["hand"].target = tick["hand"].target + rng.normal(0.0, 0.1, 3)
        dt = DT * rng.uniform(0.25, 2.0)
        step = tick.step(q, v, dt)
        forces = np.concatenate([np.zeros(0), *step.forces.values()])
        out.append(np.concatenate([step.a, forces, step.torque]))
        q, v = pin.integrate(bot.model, q, (v + 0.5 * dt * step.a) * dt), step.v
    return np.array(out)


def test_another_solver_gives_the_same() -> None:
    daqp, osqp = run(controller("walker").clone(), 8), run(controller("walker", solver="osqp").clone(), 8)
    assert np.abs(daqp - osqp).max() <= 1e-5 * max(1.0, np.abs(daqp).max())


def test_recordings_are_replayed_bit_by_bit(tmp_path: Path) -> None:
    tick = controller("walker").clone()
    with tick.record(tmp_path / "ticks.rec"):
        run(tick, 12)
    found = wbc.replay(tmp_path / "ticks.rec", trust=True)
    assert found.ticks == 12
    assert found.differing == 0, str(found)


def test_a_copy_and_a_pickled_step_say_the_same() -> None:
    tick, bot = controller("walker").clone(), robot("walker")
    tick.reset(bot.neutral)
    step = tick.step(bot.neutral, np.zeros(bot.nv))
    again = tick.clone().step(bot.neutral, np.zeros(bot.nv))
    assert (again.torque == step.torque).all()
    kept = pickle.loads(pickle.dumps(step))
    assert (kept.torque == step.torque).all()
    assert (kept.forces["grip 1"] == step.forces["grip 1"]).all()
    declared = pickle.loads(pickle.dumps(tick.stack))
    assert declared.command == "torque"
    with pytest.raises(CommandError, match="compiled for torque"):
        declared.compile(command="acceleration")


def test_derivatives_are_those_of_differences() -> None:
    tick, bot = controller("panda").clone(), robot("panda")
    q, v = bot.neutral.copy(), 0.1 * np.ones(bot.nv)
    tick.reset(q)
    tick["hand"].target = tick["hand"].target + np.array([0.02, 0.0, 0.01])
    step = tick.step(q, v)
    ends = [tick.step(q, v + s * 1e-6 * np.eye(bot.nv)[3]).a for s in (1, -1)]
    assert step.derivative("v")[:, 3] == pytest.approx((ends[0] - ends[1]) / 2e-6, abs=1e-4)


def test_levels_and_prices() -> None:
    """The hand at level 0 is not disturbed by its orientation; a soft box gives way and says so in m/s^2."""
    made = Stack(robot("panda"), dt=DT)
    made.add(EndEffector("panda_hand_tcp", kind="position"), name="hand")
    made.add(EndEffector("panda_hand_tcp", kind="orientation"), name="turn", level=1, weight=100.0)
    made.add(Posture(), level=2).add(JointLimits()).add(TorqueLimits())
    made.add(WorkspaceBox("panda_hand_tcp", (-2, -2, 0.45), (2, 2, 2)), name="box", soft=1e-3)
    tick, bot = made.compile(command="torque", backend="vm"), robot("panda")
    q, v = bot.neutral.copy(), np.zeros(bot.nv)
    tick.reset(q)
    tick["hand"].target = tick["hand"].target + np.array([0.02, 0.03, -0.05])
    tick["turn"].target = tick["turn"].target @ pin.exp3(np.array([0.5, 0.0, 0.0]))
    step = tick.step(q, v)
    assert step.status == "solved"
    assert [level.solved for level in step.levels] == [True] * len(step.levels)
    data = bot.model.createData()
    pin.forwardKinematics(bot.model, data, q, v, step.a)
    frame = bot.model.getFrameId("panda_hand_tcp")
    moved = pin.getFrameClassicalAcceleration(bot.model, data, frame, pin.LOCAL_WORLD_ALIGNED).linear
    # 4 gain^2 e from rest
    assert moved == pytest.approx(16.0 * np.array([0.02, 0.03, -0.05]), abs=1e-5)
    names = {(s.item, s.unit) for s in step.relaxed}
    assert names <= {("box", "m/s^2")}


def test_gravity_is_that_of_the_model() -> None:
    """Floating freely without gravity nothing needs a torque; on earth the arm carries itself."""
    free = robot("walker")
    tick = Stack(free, dt=DT).add(Posture()).compile(command="torque", backend="vm")
    tick.reset(free.neutral)
    assert np.abs(tick.step(free.neutral, np.zeros(free.nv)).torque).max() < 1e-9
    arm = robot("panda")
    tick = Stack(arm, dt=DT).add(Posture()).compile(command="torque", backend="vm")
    tick.reset(arm.neutral)
    found = tick.step(arm.neutral, np.zeros(arm.nv)).torque
    wanted = pin.computeGeneralizedGravity(arm.model, arm.model.createData(), arm.neutral)
    assert found == pytest.approx(wanted, abs=1e-6)


def test_a_tick_goes_on_from_its_own_velocity_where_none_is_measured() -> None:
    tick, bot = controller("panda").clone(), robot("panda")
    tick.reset(bot.neutral)
    tick["hand"].target = tick["hand"].target + 0.1
    first = tick.step(bot.neutral)
    assert tick.last_command == pytest.approx(DT * first.a)
    second = tick.step(bot.neutral)
    assert second.v == pytest.approx(DT * (first.a + second.a))


def test_joints_that_no_task_moves_come_to_rest() -> None:
    bot = robot("panda")
    made = Stack(bot, dt=DT).add(EndEffector("panda_hand_tcp", kind="position"), name="hand")
    tick = made.compile(command="acceleration", backend="vm")
    q, v = bot.neutral.copy(), np.zeros(bot.nv)
    tick.reset(q)
    v[6] = 1.0
    for _ in range(100):
        step = tick.step(q, v)
        q, v = pin.integrate(bot.model, q, 0.5 * (v + step.v) * DT), step.v
    assert abs(v[6]) == pytest.approx((1 - 20 * DT) ** 100, rel=0.02)


def test_names_that_the_stack_makes_are_not_taken() -> None:
    from wbc.errors import DuplicateNameError

    made = Stack(robot("walker"), dt=DT).add(RigidGrasp("arm1_hand"), name="grip").add(Posture(), name="grip force")
    with pytest.raises(DuplicateNameError):
        made.compile(command="torque")
    assert made.compile(backend="vm").stack.command == "velocity"


def test_random_ticks_end_without_exceptions_nan_or_torques_beyond_limits() -> None:
    rng, tick = np.random.default_rng(8), controller("walker").clone()
    bot = tick.stack.robot
    tick.reset(bot.neutral)
    limits, statuses = bot.limits.effort, set()
    for k in range(30):
        q = pin.integrate(bot.model, bot.neutral, 10.0 ** rng.uniform(-4, 0) * rng.normal(size=bot.nv))
        v = 10.0 ** rng.uniform(-4, 1) * rng.normal(size=bot.nv)
        tick["torque_limits"].scale = scale = rng.choice([1.0, 0.1, 0.0])
        tick["grip 1"].enabled = bool(rng.random() < 0.7)
        step = tick.step(q, v, DT * rng.uniform(0.25, 2.0))
        statuses.add(str(step.status))
        for numbers in (step.a, step.torque, *step.forces.values()):
            assert np.isfinite(numbers).all(), k
        assert (np.abs(step.torque[6:]) <= scale * limits[6:] + 1e-12).all()
        # limits of motion of a base that floats give way before what motors can do
        assert step.status != "solved" or (np.abs(step.a) <= bot.limits.acceleration + 1e-9).all()
    assert {"solved", "relaxed"} <= statuses


def test_stack_says_what_it_adds() -> None:
    names = [entry.name for entry in stack("walker").commanding("torque").entries]
    assert {"rest", "base", "grip 1 wrench", "grip 1 force"} <= set(names)
    assert "rest" in str(controller("walker"))
