"""Every task and constraint in its loop, on robots in turn, from random starts."""

from __future__ import annotations

from functools import cache

import pytest

from tests.closed_loop import cases
from tests.closed_loop.coordination_mutations import CLASSES as COORDINATION
from tests.closed_loop.limits import GUARDS
from tests.closed_loop.loop import Loop
from tests.closed_loop.machines import CONSTRAINT_ROBOTS, TASK_ROBOTS
from tests.closed_loop.mechanism import ROBOTS as COUPLED
from tests.closed_loop.mechanism import build, mechanism
from tests.closed_loop.pointing import CLASSES as POINTING
from tests.constraints.items_forces import FACTORIES as FORCES
from tests.repeats import covering
from wbc.tasks import Mechanism, SelfCollision, registry


def test_every_shipped_class_has_a_case() -> None:
    shipped = {cls for cls in registry().values() if cls.__module__.startswith("wbc.tasks")}
    shared = {case.cls for case in (cases.TASKS | cases.CONSTRAINTS).values()}
    guards = {guard.cls for guard in GUARDS.values()}
    # contacts and what else is about forces: tests/torque
    forces = {registry()[name] for name in FORCES}
    assert shipped == shared | forces | {Mechanism, SelfCollision} | POINTING | COORDINATION | guards


@pytest.mark.parametrize(("case", "name"), covering(cases.TASKS, TASK_ROBOTS))
def test_task(case: str, name: str) -> None:
    cases.TASKS[case].check(cases.task_loop(name))


@pytest.mark.parametrize(("case", "name"), covering(cases.CONSTRAINTS, CONSTRAINT_ROBOTS))
def test_constraint(case: str, name: str) -> None:
    cases.CONSTRAINTS[case].check(cases.constraint_loop(name))


@cache
def coupled_loop(name: str) -> Loop:
    return build(name)


@pytest.mark.parametrize("name", COUPLED)
def test_mechanism(name: str) -> None:
    mechanism(coupled_loop(name))
