"""Axes, cameras, distances and momentum in their loops on robots in turn, and that wrong formulas are noticed."""

from __future__ import annotations

from functools import cache

import pytest

from tests.closed_loop.loop import Loop
from tests.closed_loop.machines import TASK_ROBOTS
from tests.closed_loop.pointing import CHECKS, CLASSES, build, pointing_loop
from tests.closed_loop.pointing_mutations import MUTATIONS
from tests.repeats import covering


@pytest.mark.parametrize(("check", "name"), covering(CHECKS, TASK_ROBOTS))
def test_loop(check: str, name: str) -> None:
    CHECKS[check].run(pointing_loop(name))


@cache
def mutated() -> Loop:
    return build("panda", {CHECKS[check].item: cls for check, cls in MUTATIONS.items()})


@pytest.mark.parametrize("check", MUTATIONS)
def test_wrong_formula_is_noticed(check: str) -> None:
    with pytest.raises(AssertionError, match=r"\{'"):
        CHECKS[check].run(mutated())


def test_every_class_is_mutated() -> None:
    assert {cls.__bases__[0] for cls in MUTATIONS.values()} == CLASSES
