"""A cap on iterations: the answer keeps the bounds and the rows, says so, and gets to the optimum over ticks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.controller.stacks import aim, arm, controller, inside, robot
from tests.models import placement
from wbc.api import Controller
from wbc.controller import Status, core_of
from wbc.errors import RangeError, SolverError
from wbc.qp.problem import QP
from wbc.replaying import replay


def hard(c: Controller, rng: np.random.Generator) -> np.ndarray:
    """A configuration, and in most cases the ball near the forearm and the target anywhere, so that much binds."""
    q = inside(robot("panda"), rng)
    c.reset(q)
    aim(c, rng)
    if rng.random() < 0.25:
        c["ball"].pose = pin.SE3(np.eye(3), np.array([5.0, 0.0, 0.0]))
        return q
    c["hand"].target = pin.SE3(np.eye(3), rng.uniform(-1.0, 1.0, 3))
    place = placement(robot("panda"), "panda_link5", q).translation + np.array([0.0, 0.0, 0.25])
    c["ball"].set(pose=pin.SE3(np.eye(3), place), velocity=np.zeros(6))
    return q


def at(c: Controller, q: np.ndarray) -> QP:
    """The QP of the next step."""
    other = c.clone()
    core_of(other).tick.q[:] = q
    assert core_of(other).tick.check() == 0
    return other.qp()


@pytest.mark.parametrize("cap", [1, 2, 3, 4, 5])
def test_a_capped_answer_keeps_bounds_and_misses_no_row_more_than_braking(cap: int) -> None:
    rng = np.random.default_rng(cap)
    c = arm("panda").compile(backend="native")
    c.iteration_cap = cap
    nv, seen = core_of(c).layout.nv, {Status.CAPPED: 0, Status.SOLVED: 0, Status.RELAXED: 0}
    between = 0
    for _ in range(30):
        q = hard(c, rng)
        c.reset(q, rng.normal(0.0, 0.3, nv))
        qp = at(c, q)
        step = c.step(q)
        seen[step.status] += 1
        assert step.iterations <= cap
        assert (step.v >= qp.lower[:nv]).all()
        assert (step.v <= qp.upper[:nv]).all()
        if step.status is not Status.CAPPED:
            continue
        assert np.isinf(step.certificate.error_bound)
        brake = np.clip(0.0, qp.lower[:nv], qp.upper[:nv])
        assert (qp.violation(step.v)[nv:] <= np.maximum(qp.violation(brake)[nv:], 0.0) + 1e-8).all()
        between += bool((step.v != brake).any())
    assert seen[Status.CAPPED] >= (30 if cap < 3 else 5)
    assert between > seen[Status.CAPPED] // 4, "it is braking everywhere"


def test_ticks_go_on_where_the_last_one_was_stopped() -> None:
    rng = np.random.default_rng(7)
    c = arm("panda").compile(backend="native")
    waited = 0
    for _ in range(20):
        c.iteration_cap = None
        q, v = hard(c, rng), rng.normal(0.0, 0.3, core_of(c).layout.nv)
        c.reset(q)
        best = c.step(q, v)
        if best.status is not Status.SOLVED:
            continue
        c.reset(q)
        c.iteration_cap = 2
        steps = [c.step(q, v) for _ in range(40)]
        waited += steps[0].status is Status.CAPPED
        assert steps[-1].status is Status.SOLVED
        assert np.abs(steps[-1].v - best.v).max() < 1e-9
    assert waited > 3


def test_held_feet_stay_held() -> None:
    rng = np.random.default_rng(3)
    c = controller("humanoid", backend="native")
    bot, capped = c.stack.robot, 0
    for _ in range(10):
        q = inside(bot, rng, 0.3)
        c.reset(q)
        aim(c, rng)
        c.iteration_cap = 3
        step = c.step(q)
        if step.status is Status.CAPPED:
            capped += 1
            A = at(c, q).A
            feet = [core_of(c).layout.blocks[name].span for name in ("left_foot", "right_foot")]
            assert max(float(np.abs(A[span] @ step.v).max()) for span in feet) < 1e-8
    assert capped > 2


def test_the_cap_is_off_by_default_copied_by_clones_and_recorded(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    c = arm("panda").compile(backend="native")
    assert c.iteration_cap is None
    q = hard(c, rng)
    c.iteration_cap = 1
    assert c.clone().iteration_cap == 1
    with c.record(tmp_path / "run.npz"):
        statuses = [c.step(q).status for _ in range(5)]
    assert Status.CAPPED in statuses
    assert replay(tmp_path / "run.npz").identical
    c.iteration_cap = None
    assert c.iteration_cap is None


@pytest.mark.parametrize("cap", [0, -1, 1.5, True, "3"])
def test_bad_caps_are_refused(cap: Any) -> None:
    c = controller("arm", "panda", backend="native")
    with pytest.raises(RangeError, match="iteration_cap"):
        c.iteration_cap = cap
    assert c.iteration_cap is None


def test_only_native_ticks_can_be_capped() -> None:
    c = controller("arm", "panda", backend="vm", solver="osqp")
    with pytest.raises(SolverError, match="vm with osqp"):
        c.iteration_cap = 3
    assert c.iteration_cap is None
