"""Strict levels under the chain of a policy: every link answers all levels, with a certificate of each."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.backends import COMPILED, IN_PYTHON, way
from tests.controller.test_policy import spread
from tests.levels import arms
from tests.models import placement
from wbc.api import Controller
from wbc.controller import Policy, Status
from wbc.controller.policy import CHAIN

Q = np.array([0.3, 0.4, -0.2, 0.6, 0.1])


@pytest.fixture(scope="module", params=(IN_PYTHON, COMPILED))
def tick(request: pytest.FixtureRequest) -> Controller:
    return arms.levels().compile(**way(request.param))


def put(tick: Controller, conflict: bool) -> None:
    """Wishes at every level; a ball that comes at the tip faster than the joints can yield, if there is to be one."""
    robot = tick.stack.robot
    here = placement(robot, "tip", Q).translation.copy()
    tick.policy = Policy()
    tick.reset(Q)
    tick["tip"].target, tick["knee"].target = here + [0.05, 0.1, 0.0], [0.2, 0.5, 0.0]
    tick["posture"].target = Q + 0.3
    tick["ball"].pose = pin.SE3(np.eye(3), here + [0.2, 0.0, 0.0])
    tick["ball"].velocity = [-20.0 if conflict else 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]


@pytest.mark.parametrize("link", CHAIN)
@pytest.mark.parametrize("conflict", [False, True])
def test_every_link_answers_all_levels(
    tick: Controller, monkeypatch: pytest.MonkeyPatch, link: str, conflict: bool
) -> None:
    put(tick, conflict)
    first = tick.step(Q)
    assert first.status is (Status.RELAXED if conflict else Status.SOLVED)
    spread(tick, monkeypatch, link)
    step = tick.step(Q)
    assert (step.status, step.answered_by) == (Status.RECOVERED, link)
    assert [level.level for level in step.levels] == [0, 2, 3, 7, None]
    assert all(level.solved for level in step.levels)
    assert max(level.disturbance for level in step.levels) <= 1e-6
    assert step.certificate.error_bound < 1e-6
    # an elastic answer ranks hard rows by price alone, and leaves what they do not need to the levels
    if link == "elastic" and conflict:
        assert step.v == pytest.approx(first.v, abs=1e-3)
    else:
        assert step.v == pytest.approx(first.v, abs=1e-6)
        assert [level.rank for level in step.levels] == [level.rank for level in first.levels]
    assert tick.step(Q).v == pytest.approx(first.v, abs=1e-9)
