"""Collision constraints in their loops, on robots in turn, and mutations that the loops notice."""

from __future__ import annotations

from functools import cache

import pytest

from tests.closed_loop import collisions
from tests.closed_loop.collision_mutations import MUTATIONS
from tests.closed_loop.collisions import SELF, THINGS
from tests.closed_loop.loop import Loop
from tests.closed_loop.machines import CONSTRAINT_ROBOTS, FEWER, STARTS
from tests.repeats import covering


@cache
def loop(name: str) -> Loop:
    return collisions.loop_of(name)


@cache
def mutated() -> Loop:
    return collisions.loop_of("panda", MUTATIONS)


def check(loop: Loop, item: str, starts: int) -> None:
    run = collisions.folded if item in SELF else collisions.pressed
    run(loop, item, starts)


# Loops of spheres and segments are compiled; as expressions they take twice as long
@pytest.mark.compiled
@pytest.mark.parametrize(("item", "name"), covering([*THINGS, *SELF], CONSTRAINT_ROBOTS))
def test_shapes_keep_clear(item: str, name: str) -> None:
    check(loop(name), item, STARTS if item == "rod" and name != "talos" else FEWER)


def test_rows_for_corners_keep_arms_from_rocking() -> None:
    """With one row a sensed pair two arms side by side roll over each other, deeper than the whole margin."""
    with pytest.raises(AssertionError, match=r"\{'deepest': (np.float64\()?-0.0[1-9]"):
        check(collisions.one_row_a_pair(), "self, sensed", 8)


@pytest.mark.parametrize("item", MUTATIONS)
def test_wrong_formula_is_noticed(item: str) -> None:
    with pytest.raises(AssertionError, match=r"\{'"):
        check(mutated(), item, 15)
