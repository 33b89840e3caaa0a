"""Fixed joints, in accord with JointLimits, and the rows of FrameVelocityLimit."""

from __future__ import annotations

import numpy as np
import pytest

from tests.constraints.robots import NAMES, robot
from tests.evaluation import probe, random_configuration
from wbc.tasks.base import SacrificeOrder
from wbc.tasks.fixed import Fixed
from wbc.tasks.frame_velocity_limit import FrameVelocityLimit
from wbc.tasks.joint_limits import JointLimits


@pytest.mark.parametrize("name", NAMES)
def test_at_rest_only_the_named_joints_are_fixed(name: str) -> None:
    bot = robot(name)
    joints = (bot.joint_names[0], bot.joint_names[-1])
    lower, upper = probe(Fixed(joints), bot)(bot.neutral)
    fixed = np.zeros(bot.nv, dtype=bool)
    for joint in joints:
        fixed[bot.dofs(joint)] = True
    assert (lower[fixed] == 0.0).all()
    assert (upper[fixed] == 0.0).all()
    assert np.isneginf(lower[~fixed]).all()
    assert np.isposinf(upper[~fixed]).all()


def test_a_moving_joint_is_brought_to_rest_at_the_acceleration_limit() -> None:
    bot, dt = robot("ur5"), 0.005
    fixed, v, speeds = probe(Fixed(bot.joint_names), bot), np.array([1.0, -0.5, 0.049, 0.05, -0.12, 0.0]), []
    for _ in range(25):
        lower, upper = fixed(bot.neutral, v, dt)
        assert (lower == upper).all()
        speeds.append(np.abs(lower - v).max() / dt)
        v = lower
    assert max(speeds) <= 10.0 * (1 + 1e-12)
    assert (v == 0.0).all()
    assert probe(Fixed(bot.joint_names, acceleration=False), bot)(bot.neutral, np.ones(6))[1].tolist() == [0.0] * 6


@pytest.mark.parametrize("name", NAMES)
def test_within_joint_limits_from_every_viable_state(name: str) -> None:
    """Braking fully is what JointLimits always allows, to the last bit."""
    bot, rng = robot(name), np.random.default_rng(41)
    limits, fixed = probe(JointLimits(), bot), probe(Fixed(bot.joint_names), bot)
    for _ in range(8):
        q, v = random_configuration(bot, rng), np.zeros(bot.nv)
        for _ in range(30):
            lower, upper = (np.clip(b, -100.0, 100.0) for b in limits(q, v))
            v = np.where(rng.random(bot.nv) < 0.5, lower, upper)
            for i, k in enumerate(bot.position_index):
                if k >= 0:
                    q[k] += v[i] * 0.005
            rest = fixed(q, v)[0]
            low, high = limits(q, v)
            size = 1e-12 * (1.0 + np.abs(v))
            assert (low - size <= rest).all()
            assert (rest <= high + size).all()


def test_rows_and_order() -> None:
    bot = robot("talos")
    assert tuple(r.label for r in Fixed(bot.joint_names[0]).rows(bot)) == bot.dof_names
    assert Fixed.order == SacrificeOrder.HOLD


def test_limits_are_run_time_values_and_rows_are_the_limited_axes() -> None:
    bot = robot("panda")
    item = FrameVelocityLimit("panda_hand", linear=(np.inf, 0.2, 0.3), angular=(np.inf, np.inf, 1.0))
    assert [(r.label, r.unit) for r in item.rows(bot)] == [("y", "m/s"), ("z", "m/s"), ("rz", "rad/s")]
    assert [(i.name, i.size, i.unit) for i in item.inputs(bot)] == [("linear", 2, "m/s"), ("angular", 1, "rad/s")]
    full = probe(FrameVelocityLimit("panda_hand", linear=1.0, angular=1.0), bot)(bot.neutral)[0]
    matrix, _, upper = probe(item, bot)(bot.neutral)
    assert matrix == pytest.approx(full[[1, 2, 5]])
    assert upper.tolist() == [0.2, 0.3, 1.0]
    assert probe(item, bot)(bot.neutral, linear=[0.0, 4.0])[2].tolist() == [0.0, 4.0, 1.0]
