"""Run-time switches and numbers mean what the declaration would have meant: held to stacks without the item or row."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.backends import COMPILED, IN_PYTHON, way
from tests.controller.stacks import DT, FRAMES, controller, everything, near_limits, randomise, robot
from wbc.api import Stack
from wbc.tasks import EndEffector, Obstacle, Posture


@pytest.mark.parametrize("backend", [IN_PYTHON, COMPILED])
def test_weights_gains_and_rates_equal_those_declared(backend: str) -> None:
    """One controller with numbers set at run time, one that was declared with them."""
    bot, f = robot("panda"), FRAMES["panda"]
    one, two = Stack(bot, DT), Stack(bot, DT)
    for stack, w, gain, weights in ((one, 1.0, None, None), (two, 0.25, 3.5, (1, 2, 0, 0.5, 1, 3))):
        stack.add(EndEffector(f.tip, weights=weights, gain=gain), name="hand", weight=w)
        stack.add(Posture(), name="posture", weight=1e-3 * w)
    changed, declared = one.compile(**way(backend)), two.compile(**way(backend))
    changed["hand"].weight, changed["hand"].gain, changed["posture"].weight = 0.25, 3.5, 0.25e-3
    changed["hand"].mask = (1, 2, 0, 0.5, 1, 3)
    target = pin.SE3(pin.exp3(np.array([0.1, 0.2, -0.3])), np.array([0.4, 0.2, 0.6]))
    rng = np.random.default_rng(0)
    for each in (changed, declared):
        each["hand"].target = target
    for _ in range(10):
        q = near_limits(bot, rng)
        for each in (changed, declared):
            each["posture"].target = bot.neutral
        assert np.array_equal(changed.step(q).v, declared.step(q).v)


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
