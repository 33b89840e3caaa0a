"""The tick that is compiled once for all stacks, and functions with shared expressions: the bits of other code."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

import wbc
from tests.controller.stacks import humanoid, robot
from wbc import Stack
from wbc.controller import core_of
from wbc.robot import Robot
from wbc.stack import program, sources
from wbc.stack.layout import Layout
from wbc.tasks import CenterOfMass, EndEffector, JointLimits, Obstacle, Posture, WorkspaceBox
from wbc.tick.generic import GenericTick


def stack(levels: bool, soft: bool) -> wbc.Stack:
    made = wbc.Stack(wbc.robots.load("panda"), dt=0.005)
    made.add(EndEffector("panda_hand_tcp"), name="hand")
    made.add(CenterOfMass(), name="mass", weight=0.1)
    made.add(Posture(), name="posture", weight=1e-2, level=1 if levels else 0)
    made.add(JointLimits())
    made.add(Obstacle(wbc.shapes.Box((0.2, 0.2, 0.2)), links=["panda_hand"]), name="box", soft=10.0 if soft else None)
    return made


def reports(controller: wbc.Controller, robot: Robot) -> list[np.ndarray]:
    """Of ticks towards a pose that is far, with the box in the way."""
    controller["hand"].target = robot.pose(robot.random(5), "panda_hand_tcp")
    controller["box"].pose = robot.pose(robot.random(5), "panda_link7")
    # Rows of one entry that are unlike each other
    controller["posture"].mask = np.linspace(0.4, 1.0, 7)
    q, out = robot.random(3), []
    for _ in range(8):
        q = robot.integrate(q, controller.step(q).v, 0.005)
        out.append(core_of(controller).tick.report.copy())
    return out


@pytest.mark.parametrize(("levels", "soft"), [(True, False), (False, True)])
def test_the_bits_of_a_tick_that_is_compiled_for_one_stack(levels: bool, soft: bool) -> None:
    declared = stack(levels, soft)
    one, shared = declared.compile(backend="native"), declared.compile(backend="vm")
    assert isinstance(core_of(shared).tick, GenericTick)
    np.testing.assert_array_equal(reports(shared, declared.robot), reports(one, declared.robot))


def test_controllers_of_other_sizes_take_turns() -> None:
    first, second = stack(False, False), wbc.Stack(wbc.robots.load("ur5"), dt=0.01)
    second.add(EndEffector("tool0"), name="hand")
    second.add(Posture(), name="posture", weight=1e-2)
    alone, mixed, other = first.compile(backend="vm"), first.compile(backend="vm"), second.compile(backend="vm")
    want = reports(alone, first.robot)
    step = core_of(mixed).call

    def interrupted() -> int:
        other.step(second.robot.neutral)
        return step()

    core_of(mixed).call = interrupted
    np.testing.assert_array_equal(reports(mixed, first.robot), want)


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
