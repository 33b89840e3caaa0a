"""The courses of the deadlines: the same in every turn, and a cap that is kept."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from bench import prepare
from bench.deadlines import course, run
from bench.deadlines.course import Course
from bench.problems import load
from wbc.controller import core_of

TICKS = 150


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Course:
    """The first ticks of a Panda's course, with two balls."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(course.KINDS, "panda", dataclasses.replace(course.KINDS["panda"], balls=2))
        patch.setattr(course, "TICKS", TICKS)
        patch.setattr(course, "HOLD", 50)
        return Course(load(prepare.panda(tmp_path_factory.mktemp("course"))))


@pytest.fixture(autouse=True)
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "TICKS", TICKS)


def test_targets_jump_and_balls_move(short: Course) -> None:
    changes = np.linalg.norm(np.diff(short.wanted[:, 0], axis=0), axis=1)
    assert np.flatnonzero(changes > 0.0).tolist() == [49, 99]
    assert (np.abs(np.diff(short.inputs, axis=0)).max(axis=1) > 0.0).all()


def test_a_cap_is_kept_and_walks_repeat(short: Course) -> None:
    free, one, again = (run.walk(short, cap) for cap in (None, 1, None))
    assert free == again
    assert max(free["iterations"]) > 3
    assert "capped" not in free["statuses"]
    assert max(one["iterations"]) == 1
    assert 0 < one["statuses"]["capped"] < TICKS
    assert one["error"] > free["error"] > 0.0
    assert free["margin"] < 1.0


def test_what_is_timed_is_the_same_loop(short: Course, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[np.ndarray] = []
    step = short.place
    monkeypatch.setattr(short, "place", lambda q, frame: seen.append(q) or step(q, frame))
    run.walk(short, 2)
    spent = run.durations(short, 2)
    assert len(spent) == TICKS
    assert min(spent) > 0
    c = short.controller
    np.testing.assert_allclose(core_of(c).tick.q + course.DT * c.last_command, seen[-1], atol=1e-12)
