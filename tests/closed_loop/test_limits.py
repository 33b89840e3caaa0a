"""Limits on frames and tasks in their loops, on three robots, and mutations that the loops notice."""

from __future__ import annotations

from functools import cache

import pytest

from tests.closed_loop import limits
from tests.closed_loop.limit_mutations import MUTATIONS
from tests.closed_loop.loop import Loop
from tests.closed_loop.machines import CONSTRAINT_ROBOTS, FEWER, machine


@cache
def loop(name: str) -> Loop:
    return Loop(machine(name), limits.limit_items(name, machine(name)), limits.DT, name)


@cache
def mutated() -> Loop:
    items = limits.limit_items("panda", machine("panda"), MUTATIONS)
    return Loop(machine("panda"), items, limits.DT, "panda", "vm")


@pytest.mark.parametrize("name", CONSTRAINT_ROBOTS)
@pytest.mark.parametrize("guard", limits.GUARDS)
def test_limit_holds_and_is_reached(guard: str, name: str) -> None:
    limits.check(loop(name), guard)


@pytest.mark.parametrize("guard", MUTATIONS)
def test_wrong_formula_is_noticed(guard: str) -> None:
    with pytest.raises(AssertionError, match=r"\{'"):
        limits.check(mutated(), guard, starts=FEWER)
