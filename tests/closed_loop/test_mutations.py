"""A wrong formula passes its own derivative; the loop, measured from outside, must notice it."""

from __future__ import annotations

from functools import cache
from typing import Any

import pytest

from tests.closed_loop import cases, constraints, mutations, tasks
from tests.closed_loop.collision_mutations import MUTATIONS as COLLISIONS
from tests.closed_loop.constraints import constraint_items
from tests.closed_loop.coordination_mutations import MUTATIONS as COORDINATION
from tests.closed_loop.limit_mutations import MUTATIONS as LIMITS
from tests.closed_loop.loop import Loop
from tests.closed_loop.machines import machine
from tests.closed_loop.mechanism import build, mechanism
from tests.closed_loop.pointing_mutations import MUTATIONS as POINTING
from tests.closed_loop.subjects import task_items
from tests.constraints.items_forces import FACTORIES as FORCES
from wbc.stack import declaration
from wbc.tasks import registry

ROBOT = "panda"


def by_item(changed: dict[str, type], known: dict[str, cases.Case]) -> dict[str, Any]:
    return {known[case].item: cls for case, cls in changed.items()}


@cache
def mutated_tasks() -> Loop:
    items = task_items(ROBOT, machine(ROBOT), by_item(mutations.TASKS, cases.TASKS))
    return Loop(machine(ROBOT), items, tasks.DT, ROBOT, "vm")


@cache
def mutated_constraints() -> Loop:
    items = constraint_items(ROBOT, machine(ROBOT), by_item(mutations.CONSTRAINTS, cases.CONSTRAINTS))
    return Loop(machine(ROBOT), items, constraints.DT, ROBOT, "vm")


@pytest.mark.parametrize("case", mutations.TASKS)
def test_task(case: str) -> None:
    with pytest.raises(AssertionError, match=r"\{'"):
        cases.TASKS[case].check(mutated_tasks())


@pytest.mark.parametrize("case", mutations.CONSTRAINTS)
def test_constraint(case: str) -> None:
    with pytest.raises(AssertionError, match=r"\{'"):
        cases.CONSTRAINTS[case].check(mutated_constraints())


def test_mechanism(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(declaration, "Mechanism", mutations.RatioTurned)
    loop = build("panda", "vm")
    with pytest.raises(AssertionError, match=r"\{'"):
        mechanism(loop)


def test_every_shipped_class_is_mutated_and_no_mutation_is_shipped() -> None:
    shipped = {cls for cls in registry().values() if cls.__module__.startswith("wbc.tasks")}
    changed = [*mutations.TASKS.values(), *mutations.CONSTRAINTS.values(), *mutations.MECHANISM.values()]
    changed += POINTING.values()
    changed += LIMITS.values()
    changed += COLLISIONS.values()
    changed += COORDINATION
    # contacts and what else is about forces: tests/torque
    forces = {registry()[name] for name in FORCES}
    assert {cls.__bases__[0] for cls in changed} == shipped - forces
    assert not set(changed) & set(registry().values())
