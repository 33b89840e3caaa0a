"""Ticks of measured pairs in one call of C: those in which Python asks for each part, to the bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from tests.constraints.test_rows_by_need import DT, panda
from tests.evaluation import random_configuration
from tests.repeats import repeats
from wbc import Controller, Stack, replay
from wbc.controller import core_of
from wbc.errors import NotFiniteError
from wbc.shapes import Box
from wbc.tasks import EndEffector, JointLimits, MovingFrame, Obstacle, Posture, SelfCollision


def made(backend: str) -> Controller:
    """Few rows for the own pairs, a box in the world that moves and one in a moving frame."""
    stack = Stack(panda(8.0), DT).add(Posture(), name="rest", weight=1e-3).add(JointLimits(), name="limits")
    stack.add(EndEffector("panda_hand", kind="position"), name="hand").add(MovingFrame(), name="cart")
    stack.add(SelfCollision(margin=0.01, method="sensed", closest=3, corners=1), name="self")
    for name, frame in (("box", None), ("load", "cart")):
        stack.add(Obstacle(Box((0.1, 0.2, 0.3)), margin=0.01, closest=2), name=name, relative_to=frame)
    return stack.compile(backend=backend)


def path(control: Controller, whole: bool, rng: np.random.Generator) -> list[bytes]:
    """Hands pulled into the robot among boxes that move, appear and vanish; a dt that is given asks for each part."""
    bot, out = control.stack.robot, []
    for _ in range(repeats(3)):
        q, goal, place = random_configuration(bot, rng), rng.uniform(-0.2, 0.2, 3), rng.uniform(0.3, 0.6, 3)
        control["cart"].set(pose=pin.SE3.Identity(), twist=rng.normal(size=6) * 0.1)
        control.reset(q)
        for k in range(25):
            moved = pin.SE3(pin.exp3(0.1 * k * np.ones(3)), place + 0.01 * k)
            control["cart"].pose, control["load"].pose = moved, moved.inverse()
            control["box"].enabled = k % 7 != 3
            control.set(box={"pose": moved, "velocity": 0.01 / DT * np.repeat([1.0, 0.0], 3)}, hand=goal)
            step = control.step(q, hand=goal, **({} if whole else {"dt": DT}))
            out.append(step._data)
            q = pin.integrate(bot.model, q, DT * step.v)
    return out


def test_both_ways_are_one() -> None:
    one, other = made("auto"), made("auto")
    assert path(one, True, np.random.default_rng(7)) == path(other, False, np.random.default_rng(7))
    assert core_of(one).resets == core_of(other).resets > repeats(3), "some ticks were found again with other rows"


def test_ticks_that_were_found_again_are_recorded_as_they_ended(tmp_path: Path) -> None:
    control = made("vm")
    with control.record(tmp_path / "run.npz"):
        path(control, True, np.random.default_rng(7))
    assert core_of(control).resets > repeats(3)
    assert replay(tmp_path / "run.npz").identical


def test_what_is_refused_is_not_measured() -> None:
    control = made("vm")
    control["cart"].pose = pin.SE3.Identity()
    control.step(control.stack.robot.neutral)
    before = control.pairs("self")
    with pytest.raises(NotFiniteError):
        control.step(np.full(control.stack.robot.nq, np.nan))
    assert control.pairs("self") == before
