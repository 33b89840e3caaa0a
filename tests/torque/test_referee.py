"""Accelerations, wrenches and torques against Pinocchio, numpy and quadprog."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.torque.problems import DT, NAMES, controller
from tests.torque.referee import Referee
from wbc.api import Controller

STATES = 4
#: How far targets are away [m]
SPREAD = {"panda": 0.5, "talos": 0.05, "walker": 0.5}


def near(tick: Controller, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A state near neutral; targets near what the robot does there."""
    bot = tick.stack.robot
    q = pin.integrate(bot.model, bot.neutral, 0.1 * rng.normal(size=bot.nv))
    for i, k in enumerate(bot.position_index):
        if k >= 0:
            low, high = bot.limits.position_lower[i], bot.limits.position_upper[i]
            q[k] = np.clip(q[k], low + 0.01 * (high - low), high - 0.01 * (high - low))
    v = 0.05 * rng.normal(size=bot.nv)
    tick.reset(q, v)
    for name in ("hand", "com"):
        if name in tick:
            tick[name].target = tick[name].target + SPREAD[tick.stack.robot.name] * rng.normal(size=3)
    return q, v


@pytest.mark.parametrize("name", NAMES)
def test_answers_are_those_of_another_program(name: str) -> None:
    tick, rng = controller(name).clone(), np.random.default_rng(5)
    bound = 0
    for _ in range(STATES):
        q, v = near(tick, rng)
        dt = DT * rng.uniform(0.25, 2.0)
        step = tick.step(q, v, dt)
        assert step.status == "solved", f"{step.status}, {step.relaxed}"
        referee = Referee(tick, q, v, dt)
        x, tau = referee.solve()
        forces = np.concatenate([np.zeros(0), *step.forces.values()])
        for found, wanted in ((step.torque, tau), (step.a, x[: len(v)]), (forces, x[len(v) :])):
            scale = max(1.0, float(np.abs(wanted).max(initial=0.0)))
            assert float(np.abs(found - wanted).max(initial=0.0)) <= 1e-8 * scale
        assert np.abs(step.v - (v + dt * step.a)).max() <= 1e-15
        bound += len([b for b in step.binding if b.bound != "equal"])
    assert bound > 0, "nothing was at a limit, which is no test of limits"
