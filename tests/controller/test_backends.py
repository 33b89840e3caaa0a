"""The compiled tick and the virtual machine give the same answers, status, slacks and multipliers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tests.backends import IN_PYTHON, way
from tests.controller.stacks import DT, aim, controller, inside, near_limits, quarrel, randomise
from tests.repeats import repeats
from tests.stack.small import stack as small
from wbc.api import Controller
from wbc.controller import Status, Step, core_of
from wbc.errors import SolverError

Setup = Callable[[Controller, np.random.Generator], Any]


def state(bot: Any, rng: np.random.Generator, tick: int) -> tuple[np.ndarray, np.ndarray]:
    """Every other state is one that limits may not be able to save: outside them, or too fast."""
    if tick % 2:
        return near_limits(bot, rng), rng.normal(size=bot.nv)
    return inside(bot, rng), 0.2 * rng.normal(size=bot.nv)


def pairs(builder: tuple[str, ...], setup: Setup, count: int, seed: int) -> list[tuple[Step, Step]]:
    """Steps of both back ends at the same states."""
    both = [controller(*builder, **way(backend)) for backend in ("native", IN_PYTHON)]
    rng, out = np.random.default_rng(seed), []
    for tick in range(count):
        q, v = state(both[0].stack.robot, rng, tick)
        dt, own = DT * rng.uniform(0.25, 2.0), int(rng.integers(1 << 30))
        steps = []
        for each in both:
            each.reset(q, v)
            setup(each, np.random.default_rng(own))
            steps.append(each.step(q, v, dt))
        out.append((steps[0], steps[1]))
    return out


def largest(one: Step, two: Step, part: str) -> float:
    a, b = one._part(part), two._part(part)
    return float(np.abs(a - b).max(initial=0.0))


def compare(one: Step, two: Step, tolerance: float) -> None:
    assert one.status == two.status
    assert np.abs(one.v - two.v).max() < tolerance
    for part in ("error", "factor", "margin", "margin_factor"):
        assert largest(one, two, part) < 1e-12
    assert largest(one, two, "ahead") < tolerance
    assert largest(one, two, "slack") < 2 * tolerance


CASES = {
    "panda": (("arm", "panda"), aim, repeats(30)),
    "conflicts": (("conflicts",), quarrel, repeats(60)),
    "kinova": (("everything", "kinova"), randomise, repeats(12)),
}


@pytest.mark.parametrize("case", CASES)
def test_native_tick_equals_the_virtual_machine(case: str) -> None:
    builder, setup, count = CASES[case]
    seen: Counter[Status] = Counter()
    for one, two in pairs(builder, setup, count, seed=3):
        seen[one.status] += 1
        if one.status is Status.SOLVED:
            compare(one, two, 1e-9)
            scale = max(1.0, float(np.abs(two._part("multipliers")).max(initial=0.0)))
            assert largest(one, two, "multipliers") < 1e-8 * scale
            assert [str(b) for b in one.binding if abs(b.multiplier) > 1e-9 * scale] == [
                str(b) for b in two.binding if abs(b.multiplier) > 1e-9 * scale
            ]
        else:
            # with a dozen holds on six joints the least violation is nearly singular
            compare(one, two, 1e-6 if case != "kinova" else 1e-4)
    assert seen[Status.BRAKED] == 0
    assert seen[Status.SOLVED if case == "panda" else Status.RELAXED] > count // 4


def test_certificate_of_a_relaxed_native_tick_is_about_what_was_left() -> None:
    bounds = [a.certificate.error_bound for a, _ in pairs(("conflicts",), quarrel, 60, 5) if a.status == "relaxed"]
    assert len(bounds) > 30
    assert max(bounds) < 1e-6


def test_what_only_levels_have_is_refused_by_code_that_has_none() -> None:
    tick = core_of(small().compile(backend="vm")).tick
    tick.qp()
    with pytest.raises(SolverError, match="strict levels"):
        tick.curvature()
