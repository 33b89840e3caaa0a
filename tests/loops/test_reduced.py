"""Loops are taken out of a tick's QP: its answers are those of a solver in Python that has all variables and rows."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.loops.mechanisms import NAMED
from tests.loops.test_torques import DT, driven, linkage, moving
from tests.repeats import covering, repeats
from wbc.robot import Robot
from wbc.stack.layout import Layout
from wbc.stack.program import build
from wbc.stack.tables import give_order, late_rows

COMMANDS = ("velocity", "acceleration", "torque")
#: Torques by accelerations: entries of mass matrices of the mechanisms, and forces in their loops, are below
TORQUES = 1e3


def compare(robot: Robot, command: str, seed: int, states: int) -> None:
    """Commands and multipliers of both, where rows bind and where none does."""
    stack = wbc.Stack(robot, DT).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
    own, whole = (stack.compile(command=command, solver=solver) for solver in ("daqp", "python"))
    rng, bound = np.random.default_rng(seed), 0
    for _ in range(states):
        q, v = moving(robot, rng)
        target = pin.integrate(robot.model, q, float(rng.choice([0.02, 3.0])) * rng.normal(size=robot.nv))
        steps = []
        for controller in (own, whole):
            controller.reset(q)
            controller["posture"].target = target
            steps.append(controller.step(q, 0.1 * v))
        one, other = (np.array(step.command) for step in steps)
        assert steps[0].status == steps[1].status == "solved"
        errors = [step.certificate.error_bound for step in steps]
        assert errors[0] <= 1e-7
        # Of velocities both make up for what loops bend by to 1e-10 of a length or rad in 2 ms, and levers differ
        most = 1e-6 if command == "velocity" else sum(errors)
        assert np.abs(one - other).max() <= most * (1.0 if command != "torque" else TORQUES), (one, other)
        assert {row.row for row in steps[0].binding} == {row.row for row in steps[1].binding}
        bound += steps[0].iterations > 0
    assert bound, "no row bound"


@pytest.mark.parametrize(("name", "command"), covering([name for name in NAMED if name != "parallelogram"], COMMANDS))
def test_answers_of_mechanisms(name: str, command: str) -> None:
    compare(driven(name).with_limits(acceleration=10.0), command, 0, repeats(12))


@pytest.mark.parametrize("seed", range(repeats(3)))
def test_answers_of_random_linkages(seed: int) -> None:
    compare(linkage(seed)[1].with_limits(acceleration=10.0), COMMANDS[seed % 3], seed, 12)


@pytest.mark.parametrize("command", ["velocity", "torque"])
def test_joints_of_one_loop_give_first(command: str) -> None:
    """Balls of a delta's rods are moved by one loop each, its plate by all; its motors are what is left. Rows with
    forces come after those of motions.
    """
    robot = driven("delta")
    stack = wbc.Stack(robot, DT).add(wbc.tasks.Posture()).commanding(command)
    layout = Layout(stack)
    at = build(stack, layout).rows.sparsity_out("at")
    names = [robot.dof_names[dof].split(".")[0].rstrip("012") for dof in give_order(stack, layout, at)]
    assert names[:9] == ["ball"] * 9
    assert names[12:] == ["motor"] * 3
    late = late_rows(layout, at)
    assert sum(late) == (len(robot.unactuated) if command == "torque" else 0)


def test_more_joints_without_motors_than_rows_of_loops() -> None:
    """Twelve and nine of a delta: its torques are those of the problem without its rows, and no search is needed."""
    robot = driven("delta")
    assert len(robot.unactuated) > len(robot.loops.rows)
    controller = wbc.Stack(robot, DT).add(wbc.tasks.Posture(), name="posture").compile(command="torque")
    rng = np.random.default_rng(0)
    for _ in range(6):
        q, v = moving(robot, rng)
        controller.reset(q)
        step = controller.step(q, 0.1 * v)
        assert (step.status, step.iterations) == ("solved", 0)


@pytest.mark.parametrize("name", [*(name for name in NAMED if name != "parallelogram"), *range(repeats(4))])
def test_the_last_command_is_a_guess_only(name: str | int) -> None:
    """Without limits of acceleration a command follows from q: after the command that led there, from rest, and after a
    velocity that opens loops.
    """
    robot = driven(name) if isinstance(name, str) else linkage(name)[1]
    stack = wbc.Stack(robot, DT).add(wbc.tasks.Posture(), name="posture")
    stack.add(wbc.tasks.JointLimits(acceleration=False))
    controller, other = stack.compile(), stack.compile()
    rng = np.random.default_rng(0)
    q, target = moving(robot, rng)[0], moving(robot, rng)[0]
    controller.reset(q)
    controller["posture"].target = other["posture"].target = target
    for _ in range(repeats(12)):
        step = controller.step(q)
        assert step.status == "solved"
        assert max(robot.loop_gaps(pin.integrate(robot.model, q, step.v * DT)).values()) <= 1e-9
        for v in (np.zeros(robot.nv), rng.uniform(-0.9, 0.9, robot.nv)):
            other.reset(q)
            again = other.step(q, v)
            assert again.status == "solved"
            assert np.abs(again.v - step.v).max() <= 1e-6
        q = pin.integrate(robot.model, q, step.v * DT)
