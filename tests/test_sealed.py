"""Attributes that objects with state do not have, or that say what they were made with, cannot be set."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import Any

import pytest

import wbc
from tests.refusals import assert_refused
from wbc.errors import FixedAttributeError, UnknownAttributeError
from wbc.servo import Servo
from wbc.tasks import EndEffector, JointLimits


@pytest.fixture(scope="module")
def stack() -> wbc.Stack:
    stack = wbc.Stack(wbc.robots.load("panda"), dt=0.005)
    return stack.add(EndEffector("panda_hand_tcp"), name="hand").add(JointLimits())


MADE: dict[str, Callable[[wbc.Stack], Any]] = {
    "stack": lambda stack: stack,
    "stack pickled": lambda stack: pickle.loads(pickle.dumps(stack)),
    "stack copied": copy.copy,
    "controller": lambda stack: stack.compile(),
    "clone": lambda stack: stack.compile().clone(),
    "batch": lambda stack: stack.compile().batch(2),
    "inverse kinematics": lambda stack: stack.inverse_kinematics(),
    "planner": lambda stack: stack.planner(),
    "servo": lambda stack: Servo(stack.compile(), "position"),
}


@pytest.mark.parametrize("name", MADE)
def test_only_what_has_a_setter_is_set(stack: wbc.Stack, name: str) -> None:
    thing = MADE[name](stack)
    before = dict(vars(thing))
    kind = type(thing).__name__
    assert_refused(lambda: setattr(thing, "polcy", 1.0), UnknownAttributeError, f"{kind}.polcy")
    for known in [key for key in dir(thing) if key[0] != "_"]:
        has_setter = getattr(getattr(type(thing), known, None), "fset", None) is not None
        if not has_setter and known not in type(thing)._changing:
            assert_refused(lambda known=known: setattr(thing, known, 1.0), FixedAttributeError, f"{kind}.{known}")
    assert vars(thing) == before


def test_what_has_a_setter_goes_through_it(stack: wbc.Stack) -> None:
    controller = stack.compile()
    controller.iteration_cap, controller.may_change = 20, False
    controller.policy = wbc.Policy(conflict="brake")
    assert (controller.iteration_cap, controller.may_change, controller.policy.conflict) == (20, False, "brake")
