"""Limits on frames and tasks in their loops, on robots in turn, and mutations that the loops notice."""

from __future__ import annotations

from functools import cache

import pytest

from tests.closed_loop import limits
from tests.closed_loop.limit_mutations import MUTATIONS
from tests.closed_loop.loop import Loop
from tests.closed_loop.machines import CONSTRAINT_ROBOTS, FEWER, machine
from tests.repeats import covering


@cache
def loop(name: str) -> Loop:
    return Loop(machine(name), limits.limit_items(name, machine(name)), limits.DT, name)


@cache
def mutated() -> Loop:
    items = limits.limit_items("panda", machine("panda"), MUTATIONS)
    return Loop(machine("panda"), items, limits.DT, "panda", "vm")


@pytest.mark.parametrize(("guard", "name"), covering(limits.GUARDS, CONSTRAINT_ROBOTS))
def test_limit_holds_and_is_reached(guard: str, name: str) -> None:
    limits.check(loop(name), guard)


@pytest.mark.parametrize("guard", MUTATIONS)
def test_wrong_formula_is_noticed(guard: str) -> None:
    with pytest.raises(AssertionError, match=r"\{'"):
        limits.check(mutated(), guard, starts=FEWER)
