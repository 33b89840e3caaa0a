"""Hands on one object, coupled joints, wheels and manipulability in their loops, and wrong formulas of them."""

from __future__ import annotations

import itertools
from functools import cache
from typing import Any

import pytest

from tests.closed_loop import coordination_mutations as wrong
from tests.closed_loop import couplings, dexterity, hands, rolling, tasks
from tests.closed_loop.loop import Loop
from tests.closed_loop.machines import TASK_ROBOTS
from tests.repeats import covering
from tests.wheels import VEHICLES
from wbc.tasks import Rolling

#: What is checked of two hands
HANDS = list(itertools.product(hands.SUBJECTS, [tasks.decay, tasks.tracking]))


@cache
def hands_loop(name: str) -> Loop:
    return hands.build(name)


@cache
def coupled(name: str) -> Loop:
    return couplings.build(name)


@cache
def dexterous(name: str) -> Loop:
    return dexterity.build(name)


@pytest.mark.parametrize(
    ("name", "check", "robot"),
    [(*case, robot) for case, robot in covering(HANDS, hands.ROBOTS)],
)
def test_two_hands(name: str, check: Any, robot: str) -> None:
    check(hands_loop(robot), name, subjects=hands.SUBJECTS)


@pytest.mark.parametrize(("check", "robot"), covering([tasks.decay, tasks.tracking], TASK_ROBOTS))
def test_coupled_joints(check: Any, robot: str) -> None:
    check(coupled(robot), "gear", subjects=couplings.SUBJECTS)


@pytest.mark.parametrize(("name", "robot"), covering(dexterity.SUBJECTS, TASK_ROBOTS))
def test_manipulability_goes_to_its_target(name: str, robot: str) -> None:
    tasks.decay(dexterous(robot), name, subjects=dexterity.SUBJECTS)


@pytest.mark.parametrize("robot", TASK_ROBOTS)
def test_manipulability_follows_a_moving_target(robot: str) -> None:
    tasks.tracking(dexterous(robot), "positions", subjects=dexterity.SUBJECTS)


@pytest.mark.parametrize("robot", TASK_ROBOTS)
def test_manipulability_climbs_to_a_maximum_at_rest(robot: str) -> None:
    dexterity.climb(dexterous(robot), "positions")


@pytest.mark.parametrize("name", VEHICLES)
def test_wheels_roll(name: str) -> None:
    rolling.roll(rolling.build(name), name)


#: Module, robot and classes in the place of the right ones
MUTATED: dict[str, tuple[Any, str, dict[str, type]]] = {
    "hands": (
        hands,
        "baxter",
        {"object": wrong.GraspTurnedBack, "pivot": wrong.WithinTheHand, "parallel": wrong.TargetsWithoutRate},
    ),
    "couplings": (couplings, "kinova", {"gear": wrong.SignForgotten}),
    "dexterity": (
        dexterity,
        "panda",
        {"positions": wrong.LengthForgotten, "poses, log": wrong.SquareRootForgotten},
    ),
}
#: Mutations that only a moving target shows
MOVING = (wrong.TargetsWithoutRate,)

ROLLED: dict[type[Rolling], str] = {wrong.RollersMirrored: "tiago_pro", wrong.ContactAbove: "tiago"}


@cache
def mutated(key: str) -> Loop:
    module, robot, classes = MUTATED[key]
    return module.build(robot, classes)


@pytest.mark.parametrize(("key", "name"), [(key, name) for key, (_, _, classes) in MUTATED.items() for name in classes])
def test_wrong_formula_of_a_task_is_noticed(key: str, name: str) -> None:
    module, _, classes = MUTATED[key]
    check = tasks.tracking if classes[name] in MOVING else tasks.decay
    with pytest.raises(AssertionError, match=r"\{'"):
        check(mutated(key), name, subjects=module.SUBJECTS)


@pytest.mark.parametrize("cls", ROLLED, ids=lambda cls: cls.__name__)
def test_wrong_wheels_are_noticed(cls: type[Rolling]) -> None:
    with pytest.raises(AssertionError, match=r"\{'"):
        rolling.roll(rolling.build(ROLLED[cls], cls), ROLLED[cls])


def test_every_mutation_is_run() -> None:
    run = {cls for _, _, classes in MUTATED.values() for cls in classes.values()} | set(ROLLED)
    assert run == set(wrong.MUTATIONS)
