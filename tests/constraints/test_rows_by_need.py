"""Few rows for many sensed pairs: the command is that of rows for all, or the log says that they do not suffice."""

from __future__ import annotations

import logging
from functools import cache

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.closed_loop.eyes import Gaps
from tests.evaluation import random_configuration
from tests.repeats import repeats
from wbc.api import Stack
from wbc.controller import Status, core_of
from wbc.robot import Robot
from wbc.tasks import EndEffector, JointLimits, Posture
from wbc.tasks.self_collision import SelfCollision

DT, MARGIN = 0.01, 0.01


@cache
def panda(acceleration: float) -> Robot:
    return wbc.robots.load("panda", shapes="fit").with_limits(acceleration=acceleration)


def stack(bot: Robot, closest: int) -> Stack:
    made = Stack(bot, DT).add(Posture(), name="rest", weight=1e-3).add(JointLimits(), name="limits")
    made.add(EndEffector("panda_hand", kind="position"), name="hand")
    return made.add(SelfCollision(margin=MARGIN, method="sensed", closest=closest, corners=1), name="self")


@pytest.mark.parametrize(("acceleration", "backend"), [(np.inf, "vm"), (8.0, "vm")])
def test_the_command_is_that_of_rows_for_all_pairs(acceleration: float, backend: str) -> None:
    """Hands pulled into the robot, tick by tick: three rows for 44 pairs do what 44 do."""
    bot, rng = panda(acceleration), np.random.default_rng(5)
    few, every = (stack(bot, closest).compile(backend=backend) for closest in (3, 1000))
    again = 0
    for _ in range(repeats(3)):
        q, v = random_configuration(bot, rng), np.zeros(bot.nv)
        goal = rng.uniform(-0.2, 0.2, 3)
        for control in (few, every):
            control.reset(q)
            control["hand"].target, control["hand"].gain = goal, 10.0
        for _ in range(30):
            mine, wanted = few.step(q, v), every.step(q, v)
            assert mine.status == wanted.status
            if wanted.status is Status.SOLVED:
                assert mine.v == pytest.approx(wanted.v, abs=1e-5)
            q, v = pin.integrate(bot.model, q, DT * wanted.v), wanted.v
        again += core_of(few).resets
    assert again > repeats(3), "some ticks were found again with other rows"


def test_too_few_rows_are_said_and_nothing_overlaps(caplog: pytest.LogCaptureFixture) -> None:
    """One row for 44 pairs: where two push at once the robot brakes."""
    bot, rng, closest = panda(np.inf), np.random.default_rng(6), 1
    control = stack(bot, closest).compile(backend="vm")
    shapes = [((a, p), (b, s)) for (a, _, p), (b, _, s) in SelfCollision()._shape_pairs(bot)]
    gaps, status = Gaps(bot, shapes), []
    with caplog.at_level(logging.WARNING, logger="wbc"):
        for _ in range(repeats(6)):
            q = random_configuration(bot, rng)
            while gaps(q).min() < 2 * MARGIN:
                q = random_configuration(bot, rng)
            control.reset(q)
            control["hand"].target = rng.uniform(-0.2, 0.2, 3)
            for _ in range(60):
                step = control.step(q)
                q = pin.integrate(bot.model, q, DT * step.v)
                status.append(step.status)
                assert gaps(q).min() > 0.5 * MARGIN
                assert np.isfinite(step.margins["self"]).all()
    assert Status.BRAKED in status
    assert caplog.text.count("more pairs push at once than have rows; give them a larger closest") == 1


def test_an_item_whose_only_row_is_measured() -> None:
    bot = panda(8.0)
    made = Stack(bot, DT).add(Posture()).add(SelfCollision(method="sensed", closest=1, corners=0), name="self")
    assert made.compile(backend="vm").step(bot.neutral).margins["self"].shape == (1,)
