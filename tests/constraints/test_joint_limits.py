"""JointLimits on robots: every bound against an independent formula, selection, margins, bad declarations."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.constraints.robots import NAMES, robot
from tests.evaluation import probe, random_configuration
from wbc.tasks.base import SacrificeOrder
from wbc.tasks.joint_limits import JointLimits


def braking_speed(d: float, a: float, dt: float) -> float:
    """Root of v dt + v^2 / (2 a) = d, by bisection."""
    if np.isinf(a):
        return d / dt
    low, high = 0.0, d / dt
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if middle * dt + middle**2 / (2 * a) <= d else (low, middle)
    return low


def expected(bot: object, item: JointLimits, i: int, q: np.ndarray, v: np.ndarray, dt: float) -> tuple[float, float]:
    """Bounds of one degree of freedom, cut one after the other in the order of sacrifice."""
    limits = bot.limits
    speed = limits.velocity[i] if item.velocity else np.inf
    accel = limits.acceleration[i] if item.acceleration else np.inf
    ends = np.clip([-speed, speed], v[i] - accel * dt, v[i] + accel * dt)
    k = bot.position_index[i]
    if not item.position or k < 0:
        return float(ends[0]), float(ends[1])
    asked = []
    for distance in (q[k] - limits.position_lower[i] - item.margin, limits.position_upper[i] - item.margin - q[k]):
        fastest = np.inf if np.isinf(distance) else braking_speed(abs(distance), accel, dt)
        asked.append(fastest if distance >= 0 else -min(item.return_rate * -distance, fastest))
    return float(np.clip(-asked[0], *ends)), float(np.clip(asked[1], *ends))


VARIANTS = [
    JointLimits(),
    JointLimits(margin=0.02, return_rate=2.0),
    JointLimits(acceleration=False),
    JointLimits(velocity=False),
    JointLimits(position=False),
]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("item", VARIANTS, ids=lambda i: f"{i.position:d}{i.velocity:d}{i.acceleration:d}{i.margin}")
def test_bounds_of_every_degree_of_freedom(name: str, item: JointLimits) -> None:
    bot, rng = robot(name), np.random.default_rng(5)
    limits = probe(item, bot)
    for _ in range(4):
        q, v = random_configuration(bot, rng), rng.normal(0.0, 1.0, bot.nv)
        for i, k in enumerate(bot.position_index):
            if k >= 0 and rng.random() < 0.5:
                # Close to a limit, on either side of it
                end = rng.choice([bot.limits.position_lower[i], bot.limits.position_upper[i]])
                q[k] = end + rng.normal(0.0, 0.05) if np.isfinite(end) else q[k]
        for dt in (0.001, 0.01):
            lower, upper = limits(q, v, dt)
            assert (lower <= upper).all()
            for i in range(bot.nv):
                low, high = expected(bot, item, i, q, v, dt)
                assert lower[i] == pytest.approx(low, rel=1e-9, abs=1e-12)
                assert upper[i] == pytest.approx(high, rel=1e-9, abs=1e-12)


def test_velocity_scale_and_return_rate_are_run_time_values() -> None:
    bot = robot("panda")
    limits = probe(JointLimits(acceleration=False), bot)
    lower, upper = limits(bot.neutral, velocity_scale=0.25)
    assert upper == pytest.approx(0.25 * bot.limits.velocity)
    assert lower == pytest.approx(-0.25 * bot.limits.velocity)
    q = bot.neutral.copy()
    q[0] = bot.limits.position_upper[0] + 0.01
    assert limits(q, return_rate=3.0)[1][0] == pytest.approx(-0.03)
    assert limits(q, return_rate=0.0)[1][0] == 0.0
    assert limits(q, velocity_scale=0.0)[0] == pytest.approx(np.zeros(7))


def test_selected_joints_only() -> None:
    bot = robot("talos")
    chosen = bot.joint_names[3]
    lower, upper = probe(JointLimits(joints=chosen), bot)(bot.neutral)
    limited = np.isfinite(lower) | np.isfinite(upper)
    assert np.flatnonzero(limited).tolist() == [bot.dofs(chosen).start]


@pytest.mark.parametrize("name", NAMES)
def test_a_row_for_every_degree_of_freedom(name: str) -> None:
    bot = robot(name)
    rows = JointLimits().rows(bot)
    assert tuple(r.label for r in rows) == bot.dof_names
    assert {r.unit for r in rows} <= {"rad/s", "m/s"}
    assert JointLimits().order == SacrificeOrder.ACTUATOR


def test_declarations_are_frozen_and_plain_data() -> None:
    item = JointLimits(joints=["panda_joint1"], margin=np.float32(0.5))
    with pytest.raises(dataclasses.FrozenInstanceError):
        item.margin = 1.0  # type: ignore[misc]
    assert item == JointLimits(joints="panda_joint1", margin=0.5)
    assert item.declaration(robot("panda")) != JointLimits().declaration(robot("panda"))
