"""The whole QP (H, g, A, bounds, errors, margins) of the linear model against an independent assembly by numpy. What is
added to it out of reach is judged by tests/calm.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.controller.referee import Referee
from tests.controller.stacks import DT, NAMES, controller, everything, near_limits, randomise
from wbc.controller import core_of

STATES = 6


def check(name: str) -> float:
    """Largest relative difference over random states, targets, rates, weights, masks and switches."""
    tick, rng, worst = controller("linear", name, backend="vm"), np.random.default_rng(11), 0.0
    bot, referee = tick.stack.robot, Referee(everything(name))
    for _ in range(STATES):
        q, v, dt = near_limits(bot, rng), rng.normal(0.0, 1.0, bot.nv), DT * rng.uniform(0.25, 2.0)
        written = randomise(tick, rng)
        step = tick.step(q, v, dt)
        # the step has moved the last command on: the QP of the step is the one about v
        core_of(tick).tick.v_last[:] = v
        found = tick.qp()
        wanted = referee.qp(q, v, dt, written)
        errors = np.concatenate([r.values for r in step.residuals.values()])
        margins = np.concatenate(list(step.margins.values()))
        for a, b in zip((found.H, found.g, found.A, found.lower, found.upper, errors, margins), wanted, strict=True):
            assert a.shape == b.shape
            assert (np.isinf(a) == np.isinf(b)).all()
            assert (np.sign(a[np.isinf(a)]) == np.sign(b[np.isinf(b)])).all()
            finite = np.isfinite(b)
            scale = max(1.0, float(np.abs(b[finite]).max(initial=0.0)))
            worst = max(worst, float(np.abs(a[finite] - b[finite]).max(initial=0.0)) / scale)
    return worst


@pytest.mark.parametrize("name", NAMES)
def test_whole_qp_on_the_virtual_machine(name: str) -> None:
    assert check(name) < 1e-9
