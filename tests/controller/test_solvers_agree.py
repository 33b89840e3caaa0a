"""Every supported solver gives the one answer through the controller, and no error exceeds its certificate."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.backends import IN_PYTHON
from tests.controller.stacks import aim, controller, inside
from tests.judges.exact_qp import reference
from tests.judges.quadprog_qp import referee
from tests.repeats import covering
from wbc.api import Controller
from wbc.controller import Status, core_of
from wbc.qp import QPSolution

WEIGHTS = (1.0, 1e-2, 1e-4, 1e-6)
SOLVERS = (IN_PYTHON, "osqp", "qpoases")
#: Of the linear model: out of reach the two assemblies make QPs that differ by the rounding of a factorisation
SETS: dict[str, tuple[tuple[Any, ...], int, float]] = {
    "panda": (("arm", "panda", 1e-3, True, False), 14, 0.1),
    "talos": (("humanoid", False), 4, 0.0),
}


def every(builder: tuple[Any, ...]) -> dict[str, Controller]:
    """The native tick, and each solver behind the same assembly."""
    out = {"native": controller(*builder, backend="native")}
    out |= {f"vm {solver}": controller(*builder, backend="vm", solver=solver) for solver in SOLVERS}
    return out | {"native osqp": controller(*builder, backend="native", solver="osqp")}


@pytest.mark.parametrize(("name", "weight"), covering(SETS, WEIGHTS))
def test_solvers_agree_and_know_their_error(name: str, weight: float) -> None:
    builder, count, speed = SETS[name]
    controllers, rng = every(builder), np.random.default_rng(round(1 / weight))
    bot, solved = controllers["native"].stack.robot, 0
    for _ in range(count):
        q, v, own = inside(bot, rng), speed * rng.normal(size=bot.nv), int(rng.integers(1 << 30))
        steps = {}
        for label, each in controllers.items():
            each.reset(q, v)
            aim(each, np.random.default_rng(own))
            each["posture"].weight = weight
            steps[label] = each.step(q, v)
        assert len({step.status for step in steps.values()}) == 1
        if steps["native"].status is not Status.SOLVED:
            continue
        solved += 1
        judge = controllers[f"vm {IN_PYTHON}"]
        core_of(judge).tick.v_last[:] = v
        qp, guess = judge.qp(), steps[f"vm {IN_PYTHON}"]
        exact = reference(qp, QPSolution(guess.v.copy(), guess._part("multipliers").copy(), "solved")).x
        for label, step in steps.items():
            error = float(np.abs(step.v - exact).max())
            assert error < 1e-9, label
            assert error <= step.certificate.error_bound + 1e-16, label
            assert step.certificate.error_bound < 1e-6, label
        if weight >= 1e-4:  # what quadprog itself can do: it has no refinement
            assert np.abs(referee(qp) - exact).max() < 1e-6
    assert solved > count // 2


@pytest.mark.parametrize("name", SETS)
def test_solvers_agree_out_of_reach(name: str) -> None:
    """The usual stacks, whose QPs contain curvature: to the rounding of the QP itself."""
    controllers, rng = every(SETS[name][0][:1]), np.random.default_rng(4)
    bot = controllers["native"].stack.robot
    for _ in range(4):
        q, own, steps = inside(bot, rng), int(rng.integers(1 << 30)), []
        for each in controllers.values():
            each.reset(q)
            aim(each, np.random.default_rng(own))
            steps.append(each.step(q))
        assert len({step.status for step in steps}) == 1
        if steps[0].status is Status.SOLVED:
            assert max(float(np.abs(step.v - steps[0].v).max()) for step in steps) < 1e-8


def test_a_warm_start_changes_nothing() -> None:
    """Along a path the kept solvers start from the last active set; the answers are those of fresh ones."""
    warm = every(("arm", "panda"))
    fresh = controller("arm", "panda")
    bot, rng = fresh.stack.robot, np.random.default_rng(8)
    q = inside(bot, rng)
    for each in (*warm.values(), fresh):
        each.reset(q)
        aim(each, np.random.default_rng(1))
        each["posture"].weight = 1e-6
    active = set()
    for _ in range(40):
        steps = {label: each.step(q) for label, each in warm.items()}
        core_of(fresh).tick.reset()
        wanted = fresh.step(q)
        active.add(tuple(b.row for b in wanted.binding))
        for label, step in steps.items():
            assert np.abs(step.v - wanted.v).max() < 1e-8, label
        q = q + wanted.v * 0.005
    assert len(active) > 3
