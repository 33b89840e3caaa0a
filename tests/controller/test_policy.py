"""Answers without a certificate are never given: the chain, the policy, and what a step says of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.backends import COMPILED, IN_PYTHON, way
from tests.controller.stacks import DT, FRAMES, arm, robot
from tests.controller.test_sacrifice import within_actuators
from tests.models import placement
from tests.refusals import assert_refused
from tests.repeats import covering
from wbc.api import Controller
from wbc.controller import Policy, Status, core_of
from wbc.controller.policy import CHAIN
from wbc.errors import DuplicateNameError, ShapeError, SolverError, UnknownNameError
from wbc.qp.solvers import daqp as daqp_module
from wbc.tasks import Hold
from wbc.tick.buffers import UNSOUND


@pytest.fixture(scope="module", params=(IN_PYTHON, COMPILED))
def tick(request: pytest.FixtureRequest) -> Controller:
    return conflicting(request.param)


def conflicting(backend: str) -> Controller:
    stack = arm(obstacle=False).add(Hold(FRAMES["panda"].tip, kind="position"), name="grip")
    return stack.compile(**way(backend))


@pytest.fixture(autouse=True)
def _fresh(tick: Controller) -> None:
    bot = robot("panda")
    tick.policy = Policy()
    tick.reset(bot.neutral)
    here = placement(bot, FRAMES["panda"].tip, bot.neutral)
    tick["grip"].target, tick["grip"].gain, tick["grip"].enabled = here, 1.0, False
    here.translation[:] += [0.1, 0.2, -0.1]
    tick["hand"].target = here


def contradict(tick: Controller) -> None:
    """The grip is to move faster than anything can."""
    target = tick["grip"].target.copy()
    target.translation[:] += [0.0, 3.0, 0.0]
    tick["grip"].target, tick["grip"].enabled = target, True


def unsound(tick: Controller, times: int) -> Any:
    """The next answers of the tick as if their certificates failed."""
    real, left = core_of(tick).call, [times]

    def call() -> int:
        flag = real()
        left[0] -= 1
        return flag | UNSOUND if left[0] >= 0 else flag

    return call


def spread(tick: Controller, monkeypatch: pytest.MonkeyPatch, link: str) -> None:
    """Only one link of the chain, after an answer that is not certified."""
    tick.policy = Policy(chain=(link,))
    monkeypatch.setattr(core_of(tick), "call", unsound(tick, 1))


@pytest.mark.parametrize(("link", "conflict"), covering(CHAIN, [False, True]))
def test_every_link_gives_a_certified_answer(
    tick: Controller, monkeypatch: pytest.MonkeyPatch, link: str, conflict: bool
) -> None:
    bot, v = robot("panda"), np.full(7, 0.1)
    if conflict:
        contradict(tick)
    first = tick.step(bot.neutral, v)
    assert first.status is (Status.RELAXED if conflict else Status.SOLVED)
    assert first.answered_by == ""
    spread(tick, monkeypatch, link)
    step = tick.step(bot.neutral, v)
    assert (step.status, step.answered_by) == (Status.RECOVERED, link)
    assert bool(step.relaxed) == conflict
    assert step.certificate.error_bound < 1e-6
    assert step.certificate.violation < 1e-6
    # an elastic answer ranks rows by price alone
    tolerance = 1e-2 if link == "elastic" and conflict else 1e-6
    assert step.v == pytest.approx(first.v, abs=tolerance)
    within_actuators(step, v, DT, bot)
    assert "recovered" in repr(step)
    assert f"recovered (by {link})" in str(step.explain())
    # nothing lingers
    last = tick.step(bot.neutral, v)
    assert last.v == pytest.approx(first.v, abs=1e-9)
    assert last.answered_by == ""
    assert np.array_equal(tick.last_command, last.v)


def test_an_empty_chain_brakes(tick: Controller, monkeypatch: pytest.MonkeyPatch) -> None:
    bot, v = robot("panda"), np.array([1.0, -0.5, 0.02, 0.8, -1.2, 0.0, 0.3])
    tick.policy = Policy(chain=())
    monkeypatch.setattr(core_of(tick), "call", unsound(tick, 1))
    step = tick.step(bot.neutral, v)
    assert (step.status, step.answered_by) == (Status.BRAKED, "braking")
    limit = bot.limits.acceleration * DT
    assert step.v == pytest.approx(v - np.clip(v, -limit, limit), abs=1e-12)
    assert np.isinf(step.certificate.error_bound)
    assert step.binding == step.relaxed == ()


def test_a_solver_that_gives_up_is_followed_by_another(monkeypatch: pytest.MonkeyPatch) -> None:
    """DAQP may take one iteration: no verdict, and OSQP answers; without it the elastic tick cannot, and it brakes."""
    bot = robot("panda")
    good = conflicting(IN_PYTHON)
    monkeypatch.setattr(daqp_module, "SETTINGS", {**daqp_module.SETTINGS, "iter_limit": 1})
    bad = conflicting(IN_PYTHON)
    steps = []
    for each in (good, bad):
        each.policy = Policy(chain=("cold", "daqp", "osqp", "elastic"))
        each.reset(bot.neutral, np.zeros(7))
        each["hand"].target = pin.SE3(np.eye(3), np.array([0.6, 0.4, 0.2]))
        each["grip"].enabled = False
        steps.append(each.step(bot.neutral))
    assert steps[0].status is Status.SOLVED
    assert (steps[1].status, steps[1].answered_by) == (Status.RECOVERED, "osqp")
    assert steps[1].v == pytest.approx(steps[0].v, abs=1e-6)
    bad.policy = Policy(chain=("cold", "daqp", "elastic"))
    step = bad.step(bot.neutral, np.zeros(7))
    assert (step.status, step.answered_by) == (Status.BRAKED, "braking")
    assert not step.v.any()


def test_a_braking_policy_comes_to_rest_in_conflicts(tick: Controller) -> None:
    bot, v, q = robot("panda"), np.array([1.0, -0.5, 0.02, 0.8, -1.2, 0.0, 0.3]), robot("panda").neutral
    contradict(tick)
    tick.policy = Policy(conflict="brake")
    for _ in range(60):
        step = tick.step(q, v)
        assert (step.status, step.answered_by) == (Status.BRAKED, "policy")
        within_actuators(step, v, DT, bot)
        assert (np.abs(step.v) <= np.abs(v)).all()
        v, q = step.v.copy(), q + step.v * DT
    assert not v.any()
    assert step.explain().conflicts
    tick["grip"].enabled = False
    assert tick.step(q).status is Status.SOLVED


def test_recovered_and_braked_ticks_replay(tick: Controller, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    contradict(tick)
    tick.policy = Policy(conflict="brake", chain=("osqp", "cold"))
    q, v = robot("panda").neutral, np.full(7, 0.5)
    with tick.record(tmp_path / "run.npz"):
        for _ in range(3):
            v = tick.step(q, v).v
        with pytest.raises(SolverError, match="records"):
            tick.policy = Policy()
    found = wbc.replay(tmp_path / "run.npz")
    assert found.identical, str(found)
    (tick_then, *_) = wbc.replaying.replayed(wbc.Recording(tmp_path / "run.npz"))
    assert tick_then.step.answered_by == "policy"
    assert tick.clone().policy == tick.policy


def test_bad_policies_are_refused(tick: Controller) -> None:
    assert_refused(lambda: Policy(conflict="elastc"), UnknownNameError, "did you mean 'elastic'")
    assert_refused(lambda: Policy(chain=("osq",)), UnknownNameError, "did you mean 'osqp'")
    assert_refused(lambda: Policy(chain=("cold", "cold")), DuplicateNameError, "")
    assert_refused(lambda: Policy(chain="cold"), ShapeError, "")
    with pytest.raises(ShapeError):
        tick.policy = "brake"  # type: ignore[assignment]
    assert tick.policy == Policy()
