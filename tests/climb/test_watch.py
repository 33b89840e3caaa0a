"""Planning says how far it is, and ends at its time or at what a report raises."""

from __future__ import annotations

import itertools
import re
from types import SimpleNamespace

import numpy as np
import pytest

from tests.climb.walkers import over
from wbc.climb import watch
from wbc.climb.first import first_stance
from wbc.climb.goal import BodyPlace
from wbc.climb.grids import cylinder_grid
from wbc.climb.machines import climber
from wbc.climb.motion import MoveError, Mover
from wbc.climb.plan import ContactPlan
from wbc.climb.planning import ClimbOptions, plan_climb
from wbc.climb.request import ClimbRequest, PathRequest
from wbc.climb.search import NoStancesError, StanceSearch
from wbc.errors import RangeError


def planned(options: ClimbOptions) -> ContactPlan:
    """A walker on its cylinder, six footholds ahead."""
    robot, scene = climber("walker"), cylinder_grid()
    start = first_stance(robot, scene, robot.with_body(robot.rest, over(13, 8)))
    return plan_climb(robot, scene, start, BodyPlace(over(13, 14).translation), options)


@pytest.fixture
def counting(monkeypatch: pytest.MonkeyPatch) -> None:
    """A clock on which a second passes whenever it is looked at."""
    seconds = itertools.count()
    monkeypatch.setattr(watch, "time", SimpleNamespace(monotonic=lambda: float(next(seconds))))


@pytest.mark.usefixtures("counting")
def test_it_says_how_far_it_is() -> None:
    told = list[str]()
    plan = planned(ClimbOptions(told=told.append))
    assert any("moves looked at" in text and "m to go" in text for text in told)
    assert told[-1].startswith("motion ")
    assert len(plan.moves) > 1


@pytest.mark.usefixtures("counting")
def test_a_search_ends_at_the_time_of_the_plan() -> None:
    with pytest.raises(NoStancesError, match=r"limit of moves or time .* stances were reached") as refused:
        planned(ClimbOptions(seconds=5.0))
    assert refused.value.cause == "limit"
    assert np.isfinite(refused.value.nearest)


def test_ways_whose_moves_are_refused_end_at_the_time_of_the_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    over = list[bool]()

    def refused_late(_: Mover, *__: object) -> None:
        over.append(True)
        raise MoveError("move 1", 0.0, "links touch")

    monkeypatch.setattr(Mover, "moved", refused_late)
    monkeypatch.setattr(watch.PlanWatch, "passed", property(lambda _: len(over) >= 2))
    with pytest.raises(NoStancesError, match=r"2 ways over stances were found.*links touch") as refused:
        planned(ClimbOptions(seconds=5.0))
    assert refused.value.cause == "limit"


def test_a_search_that_ends_after_refused_moves_says_which(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused_move(_: Mover, *__: object) -> None:
        raise MoveError("move 1", 0.0, "links touch")

    monkeypatch.setattr(Mover, "moved", refused_move)
    monkeypatch.setattr(StanceSearch, "forbid", lambda search, *_: search._queue.clear())
    told = re.compile("1 ways .* a move without a motion.*links touch.*every stance that can be come to was seen")
    with pytest.raises(NoStancesError, match=told) as refused:
        planned(ClimbOptions())
    assert refused.value.cause == "reach"


def test_what_a_report_raises_ends_it() -> None:
    def interrupted(_: str) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        planned(ClimbOptions(told=interrupted))


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan")])
def test_a_time_is_above_0(seconds: float) -> None:
    with pytest.raises(RangeError, match="seconds"):
        ClimbOptions(seconds=seconds)
    with pytest.raises(RangeError, match="planning-time"):
        ClimbRequest(PathRequest(planning_time=seconds))
