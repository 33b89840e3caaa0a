"""Functions of a stack with and without what occurs in them twice: native code is made of the former."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

from tests.controller.stacks import humanoid, robot
from wbc import Stack
from wbc.stack import program, sources
from wbc.stack.layout import Layout
from wbc.tasks import EndEffector, JointLimits, Posture, WorkspaceBox


def arm() -> Stack:
    stack = Stack(robot("panda"), 0.005)
    stack.add(EndEffector("panda_hand_tcp"), name="hand")
    stack.add(Posture(), name="posture", weight=1e-3)
    stack.add(JointLimits(), name="limits")
    stack.add(WorkspaceBox("panda_hand_tcp", lower=(-0.3, -0.3, 0.2), upper=(0.3, 0.3, 0.6)), name="box")
    return stack


@pytest.mark.parametrize("made", [arm, humanoid])
def test_shared_expressions_give_the_same_bits(made: Callable[[], Stack]) -> None:
    stack = made()
    plain = program.build(stack, Layout(stack)).functions
    shared = {name: sources._shared(function) for name, function in plain.items()}
    assert shared["rows"].n_instructions() < plain["rows"].n_instructions()
    rng = np.random.default_rng(0)
    for name, function in shared.items():
        for _ in range(5):
            given = [ca.DM(rng.uniform(0.1, 1.0, function.size_in(k))) for k in range(function.n_in())]
            for one, other in zip(function.call(given), plain[name].call(given), strict=True):
                assert one.sparsity() == other.sparsity()
                assert np.array(one.nonzeros()).tobytes() == np.array(other.nonzeros()).tobytes()
