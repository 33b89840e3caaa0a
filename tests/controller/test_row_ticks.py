"""Ticks along rows in one call of C: those of one call each, to the bit, up to one that has to be looked at."""

from __future__ import annotations

import numpy as np
import pytest

from tests.controller.test_measured_in_one_call import made
from tests.evaluation import random_configuration
from wbc import Controller, Status
from wbc.controller import core_of
from wbc.controller.handle import InputGroup
from wbc.controller.row_ticks import RowTicks
from wbc.errors import NotFiniteError
from wbc.multibody import pin

HAND = [("hand", "target", None)]


def begun(backend: str) -> tuple[Controller, np.ndarray]:
    """One that stands, with boxes near the hand, and configurations to be filled."""
    control = made(backend)
    q = np.empty((31, control.stack.robot.nq))
    q[0] = random_configuration(control.stack.robot, np.random.default_rng(3))
    control["cart"].set(pose=pin.SE3.Identity(), twist=np.zeros(6))
    control["box"].pose = pin.SE3(np.eye(3), np.array([0.4, 0.1, 0.4]))
    control["load"].pose = pin.SE3(np.eye(3), np.array([0.2, -0.3, 0.5]))
    control.reset(q[0])
    return control, q


@pytest.mark.parametrize("backend", ["vm", pytest.param("native", marks=pytest.mark.compiled)])
def test_ticks_in_one_call_are_those_of_one_call_each(backend: str) -> None:
    rows = np.random.default_rng(5).uniform(-0.3, 0.5, (30, 3))
    control, q = begun(backend)
    assert RowTicks(control, HAND).run(rows, q) == (30, None)
    other, single = begun(backend)
    group = InputGroup(core_of(other), HAND)
    for k, row in enumerate(rows):
        group.write(row)
        single[k + 1] = other.step(single[k]).q_next
    assert np.array_equal(q, single)
    assert core_of(control).resets == core_of(other).resets


def test_a_tick_that_is_not_solved_is_handed_over() -> None:
    control, q = begun("vm")
    rows = np.random.default_rng(5).uniform(-0.3, 0.5, (30, 3))
    ticks = RowTicks(control, HAND)
    control.iteration_cap = 1
    done, step = ticks.run(rows, q)
    assert done < len(rows)
    assert step is not None
    assert step.status is Status.CAPPED
    assert np.array_equal(q[done], step._part("q"))


def test_ticks_end_at_rest_or_where_a_row_is_none() -> None:
    control, q = begun("vm")
    ticks = RowTicks(control, HAND)
    rows = np.tile(control.stack.robot.pose(q[0], "panda_hand").translation, (30, 1))
    ticks.rest = 10.0
    assert ticks.run(rows, q) == (1, None)
    rows[3, 1] = np.nan
    with pytest.raises(NotFiniteError, match="rows"):
        ticks.run(rows, q)
