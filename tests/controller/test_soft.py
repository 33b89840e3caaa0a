"""Constraints that are soft by a word: they hold until a hard row contradicts, and stay above the tasks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import pytest

from tests.backends import COMPILED, IN_PYTHON, way
from tests.controller.stacks import DT, robot
from wbc.api import Controller, Stack
from wbc.controller import Status, core_of
from wbc.errors import RangeError, ShapeError
from wbc.tasks import Constraint, EndEffector, Fixed, Input, JointLimits, Posture, Row, Rows


@dataclass(frozen=True)
class Ask(Constraint):
    """v_1 = x."""

    x: float = 0.0

    def inputs(self, robot: Any) -> tuple[Input, ...]:
        return (Input("x", default=self.x),)

    def rows(self, robot: Any) -> tuple[Row, ...]:
        return (Row("ask", "rad/s"),)

    def velocity_rows(self, robot: Any, kin: Any, inputs: Any, dt: ca.SX) -> Rows:
        matrix = ca.SX(1, robot.nv)
        matrix[0, 0] = 1
        return Rows(matrix, inputs["x"], inputs["x"])


def stack(hard: bool) -> Stack:
    out = Stack(robot("panda"), DT).add(Posture(), name="posture").add(JointLimits(), name="limits")
    return out.add(Ask(0.01), name="firm").add(Ask(0.03), name="other", hard=hard)


@pytest.fixture(scope="module", params=(IN_PYTHON, COMPILED))
def tick(request: pytest.FixtureRequest) -> Controller:
    return stack(hard=False).compile(**way(request.param))


def test_soft_rows_give_way_alone(tick: Controller) -> None:
    q = robot("panda").neutral
    tick.reset(q)
    step = tick.step(q)
    assert step.status is Status.RELAXED
    assert step.v[0] == pytest.approx(0.01, abs=1e-8)
    assert [(s.item, pytest.approx(s.amount, abs=1e-7)) for s in step.relaxed] == [("other", 0.02)]
    assert {s.name for c in step.explain().conflicts for s in c.bounds} == {"firm/ask", "other/ask"}
    tick["firm"].enabled = False
    step = tick.step(q)
    tick["firm"].enabled = True
    assert step.status is Status.SOLVED
    assert step.v[0] == pytest.approx(0.03, abs=1e-8), "above the posture"
    assert "soft" in str(tick)


def test_hard_rows_of_one_class_share(tick: Controller) -> None:
    """What `hard` changes: without it both rows are of one class and each gives half."""
    q = robot("panda").neutral
    both = stack(hard=True).compile(solver=IN_PYTHON)
    both.reset(q)
    assert both.step(q).v[0] == pytest.approx(0.02, abs=1e-8)
    assert stack(True).key_data() != stack(False).key_data()
    assert np.array_equal(core_of(both).layout.parameters, core_of(tick).layout.parameters)


@pytest.mark.parametrize("item", [JointLimits(), Fixed("panda_joint1"), EndEffector("panda_hand_tcp")])
def test_what_cannot_be_soft_is_refused(item: Any) -> None:
    out = Stack(robot("panda"), DT)
    with pytest.raises(RangeError, match="hard"):
        out.add(item, hard=False)
    with pytest.raises(ShapeError, match="hard"):
        out.add(Ask(), hard="no")  # type: ignore[arg-type]
    assert len(out) == 0
