"""Layouts with 10 to 60 % of the holds removed at random: what the reference proves possible is planned."""

from __future__ import annotations

from functools import partial

import pytest

from bench.walk.layout_tables import layout_goals
from bench.walk.layouts import judged, layout
from bench.walk.machine import Machine
from bench.walk.reference import Reference
from tests.repeats import repeats
from wbc.robots import Walker
from wbc.walking import Structure
from wbc.walking.checker import Rules, check_walk
from wbc.walking.loop.stack import WalkStack

#: Layouts, and how many a test judges; `wbc bench walk` judges 1000
COUNT, AT_ONCE = repeats(1), 1


@pytest.fixture(scope="module")
def reference(machine: Walker) -> Reference:
    return Reference(machine)


@pytest.mark.parametrize("first", range(0, COUNT, AT_ONCE))
def test_every_possible_layout_is_planned(
    machine: Walker,
    structure: Structure,
    stack: WalkStack,
    reference: Reference,
    first: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Between ticks other tests look: the checker takes as long as all the rest here
    monkeypatch.setattr("bench.walk.machine.check_walk", partial(check_walk, rules=Rules(sub_samples=1)))
    it = Machine(machine, stack)
    it.reference = reference
    asked = [layout(seed, structure) for seed in range(first, min(first + AT_ONCE, COUNT))]
    # The first of all is walked too, and judged by the checker
    records = [judged(it, one, walked=one.seed == 0) for one in asked]
    assert [goal.text for goal in layout_goals(records) if not goal.met] == []
    assert all(record["planned"] for record in records if record["verdict"] == "possible")
