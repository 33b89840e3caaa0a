"""Weights that change smoothly: tasks join, leave and change rank without a jerk and without recompiling."""

from __future__ import annotations

import numpy as np
import pytest

import wbc
from tests.controller.stacks import DT, robot
from tests.refusals import assert_refused
from wbc.api import Controller, Stack
from wbc.controller import core_of
from wbc.errors import RangeError, UnknownAttributeError
from wbc.tasks import JointLimits, Posture


@pytest.fixture(scope="module")
def tick() -> Controller:
    """Two postures that want one joint to move at +1 and -1 rad/s; nothing bounds accelerations."""
    stack = Stack(robot("panda"), DT, calm=False)
    stack.add(Posture(gain=1.0), name="up").add(Posture(gain=1.0), name="down", weight=0.0)
    stack.add(JointLimits(acceleration=False, position=False), name="limits")
    controller = stack.compile(backend="vm")
    q = robot("panda").neutral
    controller["up"].target, controller["down"].target = q + np.eye(7)[0], q - np.eye(7)[0]
    return controller


@pytest.fixture(autouse=True)
def _fresh(tick: Controller) -> None:
    tick.reset(robot("panda").neutral)
    tick["up"].weight, tick["down"].weight = 1.0, 0.0


def run(tick: Controller, ticks: int) -> np.ndarray:
    q = robot("panda").neutral
    return np.array([tick.step(q).v[0] for _ in range(ticks)])


def test_a_task_joins_and_another_leaves_smoothly(tick: Controller) -> None:
    before = run(tick, 1)
    assert before[0] == pytest.approx(1.0, abs=1e-6)
    tick["up"].ramp(0.0, 0.5)
    tick["down"].ramp(1.0, 0.5)
    speeds = run(tick, 101)
    assert speeds[-1] == pytest.approx(-1.0, abs=1e-6)
    assert (np.diff(speeds) <= 1e-9).all()
    # switching would change it by 2 in one tick
    assert np.abs(np.diff(np.concatenate((before, speeds)))).max() < 0.35
    assert tick["up"].weight == 0.0
    assert tick["down"].weight == 1.0


def test_ramps_end_exactly_and_cost_nothing_afterwards(tick: Controller) -> None:
    tick["down"].ramp(3.0, 2 * DT)
    assert run(tick, 1).size == 1
    assert 0.0 < tick["down"].weight < 3.0
    assert core_of(tick).waits
    run(tick, 1)
    assert tick["down"].weight == 3.0
    assert not core_of(tick).waits
    assert run(tick, 1)[0] == pytest.approx(-0.5, abs=1e-6)
    tick["down"].ramp(1.0, 0.0)
    assert run(tick, 1)[0] == pytest.approx(0.0, abs=1e-6)


def test_setting_the_weight_or_another_ramp_ends_one(tick: Controller) -> None:
    tick["down"].ramp(5.0, 1.0)
    run(tick, 2)
    tick["down"].weight = 1.0
    run(tick, 3)
    assert tick["down"].weight == 1.0
    tick["down"].ramp(5.0, 1.0)
    tick["down"].ramp(2.0, DT)
    run(tick, 3)
    assert tick["down"].weight == 2.0


def test_another_dt_and_refused_steps(tick: Controller) -> None:
    q = robot("panda").neutral
    tick["down"].ramp(1.0, 4 * DT)
    tick.step(q, dt=2 * DT)
    middle = tick["down"].weight
    assert middle == pytest.approx(np.sqrt(1e-6), rel=1e-9)
    with pytest.raises(wbc.WbcError):
        tick.step(q * np.nan)
    assert tick["down"].weight == middle
    tick.step(q, dt=2 * DT)
    assert tick["down"].weight == 1.0


def test_bad_ramps_are_refused(tick: Controller) -> None:
    assert_refused(lambda: tick["down"].ramp(-1.0, 1.0), RangeError, "down.ramp.weight")
    assert_refused(lambda: tick["down"].ramp(1.0, -1.0), RangeError, "down.ramp.seconds")
    assert_refused(lambda: tick["limits"].ramp(1.0, 1.0), UnknownAttributeError, "")
    assert not core_of(tick).ramps


def test_a_clone_goes_on_with_the_ramps(tick: Controller) -> None:
    tick["up"].ramp(0.0, 20 * DT)
    tick["down"].ramp(1.0, 20 * DT)
    run(tick, 8)
    twin = tick.clone()
    assert twin["down"].weight == tick["down"].weight != 0.0
    weights = [(run(each, 20)[-1], each["up"].weight, each["down"].weight) for each in (twin, tick)]
    assert weights[0] == weights[1]
    assert weights[0][1:] == (0.0, 1.0)
