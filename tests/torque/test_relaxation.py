"""States of random torque stacks whose relaxation once went wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bench.soak.torques import strong, torque_stack
from wbc import Status
from wbc.controller import core_of

DATA = Path(__file__).parent / "data"


def test_bounds_hold_where_a_search_of_the_relaxation_ends_without_numbers() -> None:
    """Bounds were frozen at NaN there, and an acceleration went 14 times beyond its limit."""
    rng = np.random.default_rng([0, True, 1, 2])
    controller = torque_stack(strong(rng), rng).compile(backend="native", command="torque")
    core, robot = core_of(controller), controller.stack.robot
    controller.reset(robot.neutral)
    given = core.tick.state[core.context.memory.report :]
    given[:] = np.load(DATA / "search_without_numbers.npz")["inputs"]
    core.tick.v_last[:] = core.tick.v_in
    step = core.again()
    assert step.status is Status.RELAXED
    assert (np.abs(step.a) <= robot.limits.acceleration * (1.0 + 1e-12)).all()
