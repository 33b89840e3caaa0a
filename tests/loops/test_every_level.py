"""Mechanisms walked by every level: recordings, batches, derivatives, servos, exports, and the page's sliders."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.loops.mechanisms import MOTORS, NAMED, with_motors
from tests.repeats import covering
from wbc.robot import Robot
from wbc.servo import Servo
from wbc.validation import Array
from wbc.viewer.operation import Operation
from wbc.viewer.presets import of_robot
from wbc.viewer.reading import declared

DT = 0.005
COMMANDS = ("velocity", "acceleration", "torque")


def driven(name: str) -> Robot:
    """A named mechanism with motors, limits of speed and acceleration, and of motors."""
    robot = wbc.robots.load(with_motors(NAMED[name], MOTORS[name]), shapes="none", velocity=3.0, acceleration=50.0)
    return robot.with_limits(effort=dict.fromkeys(MOTORS[name], 100.0))


def controller_of(robot: Robot, command: str) -> wbc.Controller:
    """A posture within all limits."""
    stack = wbc.Stack(robot, DT).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
    if command == "torque":
        stack.add(wbc.tasks.TorqueLimits())
    return stack.compile(command=command)


def started(robot: Robot, command: str, ticks: int = 8) -> tuple[wbc.Controller, Array, Array]:
    """(a controller, a configuration and a velocity on the way to a posture)."""
    controller, q, v = controller_of(robot, command), robot.neutral, np.zeros(robot.nv)
    controller.reset(q)
    controller["posture"].target = robot.integrate(q, 0.5 * robot.motor_jacobian(q) @ np.ones(len(robot.motors)))
    for _ in range(ticks):
        step = controller.step(q, v)
        assert step.status == "solved"
        rate = step.v if command == "velocity" else v + 0.5 * DT * step.a
        q, v = robot.closed(pin.integrate(robot.model, q, rate * DT)), np.array(step.v)
        if command == "velocity":
            v = v - np.linalg.pinv(robot._tied(q), 1e-7) @ robot._tied(q) @ v
    assert np.abs(v).max() > 0.1
    return controller, q, v


@pytest.mark.parametrize(("name", "command"), covering(NAMED, COMMANDS))
def test_recordings_and_batches(name: str, command: str, tmp_path: Path) -> None:
    robot = driven(name)
    controller, q, v = started(robot, command)
    with controller.record(tmp_path / "run.npz"):
        steps = [controller.step(q, v) for _ in range(3)]
    assert wbc.replay(tmp_path / "run.npz").identical
    batch = controller.batch(2).step(np.array([q, q]), np.array([v, v]))
    for row in batch.v:
        assert row == pytest.approx(steps[-1].v, abs=1e-9)


@pytest.mark.parametrize(("name", "command"), covering(NAMED, COMMANDS))
def test_derivatives(name: str, command: str) -> None:
    """By the posture's target, where the same rows bind on both sides."""
    robot, h = driven(name), 1e-5
    controller, q, v = started(robot, command)
    target = robot.integrate(q, 0.01 * robot.motor_jacobian(q) @ np.ones(len(robot.motors)))

    def answer(change: Array) -> wbc.Step:
        controller.reset(q, v)
        controller["posture"].target = pin.integrate(robot.model, target, change)
        return controller.step(q, v)

    slope = answer(np.zeros(robot.nv)).derivative("posture", "target")
    found = np.transpose(
        [(answer(h * unit).command - answer(-h * unit).command)[: robot.nv] / (2.0 * h) for unit in np.eye(robot.nv)]
    )
    assert np.abs(slope - found).max() < 2e-2 * max(1.0, float(np.abs(slope).max()))


@pytest.mark.compiled
@pytest.mark.parametrize("command", COMMANDS)
def test_exports(command: str, tmp_path: Path) -> None:
    """The check that an export brings along compares its answers with those of the controller."""
    controller = started(driven("four_bar"), command)[0]
    assert (controller.export(tmp_path / "tick", states=20) / "Makefile").exists()


@pytest.mark.parametrize("name", NAMED)
def test_servos_of_positions(name: str) -> None:
    """The reference keeps the loops closed; what is sent goes on from it in a straight line within a tick."""
    robot = driven(name)
    controller, q, _ = started(robot, "velocity", 4)
    servo = Servo(controller, "position")
    servo.reset(q)
    for _ in range(60):
        sent = servo.step(servo.reference).command.values
        assert max(robot.loop_gaps(servo.reference).values()) < 1e-9
        assert max(robot.loop_gaps(sent).values()) < 1e-4
    assert np.abs(robot.difference(q, sent)).max() > 1e-3


@pytest.mark.parametrize("name", NAMED)
def test_sliders_of_the_page_move_motors(name: str) -> None:
    """Joints without motors have none, and follow."""
    robot = driven(name)
    chosen = of_robot(robot.with_limits(position_lower={MOTORS[name][0]: -1.0}, position_upper={MOTORS[name][0]: 1.0}))
    controller = chosen.stack.compile()
    operation, q = Operation(controller), chosen.start
    controller.reset(q)
    controller.step(q)
    hello = {joint["name"]: joint for joint in declared(controller)["joints"]}
    assert all(not np.isfinite(hello[robot.dof_names[dof]]["low"]) for dof in robot.passive)
    motor = hello[MOTORS[name][0]]
    assert (motor["low"], motor["high"]) == (-1.0, 1.0)
    target = q.copy()
    target[motor["place"]] += 0.2
    operation.obey({"type": "set", "item": "posture", "values": {"target": target.tolist()}})
    for _ in range(400):
        step = controller.step(q)
        assert step.status == "solved"
        q = pin.integrate(robot.model, q, step.v * chosen.stack.dt)
    assert q[motor["place"]] == pytest.approx(target[motor["place"]], abs=0.02)
    assert max(robot.loop_gaps(q).values()) < 1e-9
