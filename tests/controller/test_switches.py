"""Run-time switches and numbers mean what the declaration would have meant: held to stacks without the item or row."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.backends import IN_PYTHON
from tests.controller.stacks import DT, controller, everything, near_limits, randomise, robot
from wbc.api import Stack
from wbc.tasks import Obstacle


def test_written_values_read_back() -> None:
    tick, rng = controller("everything", "talos"), np.random.default_rng(1)
    written = randomise(tick, rng)
    for name, values in written.items():
        for key, value in values.items():
            back = getattr(tick[name], key)
            if isinstance(value, pin.SE3):
                assert isinstance(back, pin.SE3)
                assert back.isApprox(value, 1e-15)
            else:
                assert np.array_equal(back, value)
                assert isinstance(back, type(value))
    # what is read cannot be written into
    with pytest.raises(ValueError, match="read-only"):
        tick["hand"].target.translation[:] = 0.0
    tick["posture"].target[:] = 0.0
    tick["hand"].mask[:] = 0.0
    assert tick["hand"].target.isApprox(written["hand"]["target"], 1e-15)
    assert np.array_equal(tick["posture"].target, written["posture"]["target"])
    assert np.array_equal(tick["hand"].mask, written["hand"]["mask"])
    # and so is what was written
    mine = np.array(written["posture"]["target"])
    tick["posture"].target = mine
    mine[:] = 0.0
    assert np.array_equal(tick["posture"].target, written["posture"]["target"])


def test_default_rate_fits_the_longest_tick() -> None:
    stack = Stack(robot("panda"), dt=0.1).add(Obstacle(everything("panda")["ball"].item.shape), name="ball")
    tick = stack.compile(solver=IN_PYTHON)
    assert tick["ball"].rate * stack.dt_range[1] <= 1.0
    assert tick["ball"].rate == pytest.approx(5.0)


def test_margins_ahead_are_the_margins_of_the_next_state() -> None:
    """h(q (+) v dt), the moving ball moved on: held to the margins that the next step measures."""
    for name in ("panda", "kinova", "talos"):
        tick, rng = controller("everything", name), np.random.default_rng(7)
        bot = tick.stack.robot
        for _ in range(4):
            q, v, dt = near_limits(bot, rng), rng.normal(size=bot.nv), DT * rng.uniform(0.25, 2.0)
            randomise(tick, rng)
            step = tick.step(q, v, dt)
            for obstacle in ("ball", "floor"):
                pose, twist = tick[obstacle].pose, tick[obstacle].velocity
                turn = pin.exp3(twist[3:] * dt) @ pose.rotation
                tick[obstacle].pose = pin.SE3(turn, pose.translation + twist[:3] * dt)
            after = tick.step(pin.integrate(bot.model, q, step.v * dt), v, dt)
            for obstacle in ("ball", "floor"):
                assert step.margins_ahead[obstacle] == pytest.approx(after.margins[obstacle], abs=1e-10)
