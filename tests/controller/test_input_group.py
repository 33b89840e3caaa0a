"""Inputs that are written together: the same numbers as one by one, and nothing where one is not finite."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbc
from wbc.api import Controller
from wbc.controller import core_of
from wbc.controller.handle import InputGroup
from wbc.errors import NotFiniteError


@pytest.fixture
def controller() -> Controller:
    stack = wbc.Stack(wbc.robots.load("ur5"), dt=0.01)
    stack.add(wbc.tasks.EndEffector("tool0"), name="hand")
    stack.add(wbc.tasks.Posture(), name="posture", weight=1e-3)
    return stack.compile(backend="vm")


def test_a_group_is_written_as_its_inputs_are(controller: Controller) -> None:
    pose, rate, angles = pin.SE3.Random(), np.arange(6.0), np.array([0.1, 0.2])
    group = InputGroup(
        core_of(controller),
        [("hand", "target", None), ("hand", "feedforward", None), ("posture", "target", slice(1, 3))],
    )
    controller.reset(np.full(6, 0.5))
    group.write(np.concatenate([pose.homogeneous[:3].ravel(order="F"), rate, angles]))
    assert controller["hand"].target.isApprox(pose)
    assert (controller["hand"].feedforward == rate).all()
    assert (controller["posture"].target == [0.5, 0.1, 0.2, 0.5, 0.5, 0.5]).all()
    controller.reset(np.zeros(6))
    assert controller["hand"].target.isApprox(pose), "it no longer follows the first configuration"


def test_numbers_that_are_not_finite_change_nothing(controller: Controller) -> None:
    group = InputGroup(core_of(controller), [("hand", "feedforward", None), ("posture", "feedforward", None)])
    group.write(np.ones(12))
    before = core_of(controller).tick.p.copy()
    with pytest.raises(NotFiniteError, match=r"hand\.feedforward, posture\.feedforward"):
        group.write(np.array([2.0] * 11 + [np.nan]))
    assert (core_of(controller).tick.p == before).all()
