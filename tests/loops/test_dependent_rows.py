"""Linkages whose rows depend on each other wherever they are closed, and only there: two places on the axis of a hinge,
three cranks under one coupler, Bennett's bars. As many rows hold as are independent where they are closed.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.loops.mechanisms import MOTORS, NAMED, SPECIAL, bennett, with_motors
from tests.loops.test_reading import SDF
from tests.loops.test_torques import compare, needed, stack_of
from tests.repeats import covering, repeats
from wbc.errors import UnsupportedJointError
from wbc.robot import Loop, Robot
from wbc.simulation import mujoco_model

DT = 0.005
#: Name -> (rows, those that are independent where loops are closed) of a linkage
HELD = {"parallelogram": (4, 3), "bennett": (4, 2), "sarrus": (5, 4), "delta": (9, 9)}
#: What a tick leaves of loops that it closes [m, rad]
CLOSED = 1e-9


def driven(name: str) -> Robot:
    """A mechanism with motors and limits."""
    text = with_motors((NAMED | SPECIAL)[name], MOTORS[name])
    return wbc.robots.load(text, shapes="none", velocity=3.0, acceleration=200.0)


@pytest.mark.parametrize("name", HELD)
def test_rows_are_counted_where_loops_are_closed(name: str) -> None:
    (linkage,) = driven(name).loops.linkages
    assert (len(linkage.rows), linkage.held) == HELD[name]


@pytest.mark.parametrize(
    ("name", "command", "far"),
    covering(["parallelogram", "bennett", "sarrus"], ["velocity", "acceleration", "torque"], [1e-6, 1e-4]),
)
def test_a_linkage_that_stands_open_closes_and_moves(name: str, command: str, far: float) -> None:
    """Where loops are open by what a sensor is off, more rows are independent than motions may be held by."""
    robot, rng = driven(name), np.random.default_rng(0)
    controller = wbc.Stack(robot, DT).add(wbc.tasks.Posture(gain=5.0), name="posture").add(wbc.tasks.JointLimits())
    loop = controller.compile(command=command)
    goal = robot.integrate(robot.neutral, robot.motor_jacobian(robot.neutral) @ [0.3])
    q, v = pin.integrate(robot.model, robot.neutral, far * rng.normal(size=robot.nv)), np.zeros(robot.nv)
    loop.reset(q)
    loop["posture"].target = goal
    assert max(robot.loop_gaps(q).values()) > 0.1 * far
    for _ in range(300):
        step = loop.step(q) if command == "velocity" else loop.step(q, v)
        assert step.status == "solved", step
        q, v = np.array(pin.integrate(robot.model, q, step.v * DT)), np.array(step.v)
        if command != "velocity":
            q = np.array(step.q_next)
        assert max(robot.loop_gaps(q).values()) <= CLOSED
    assert np.abs(robot.difference(q, goal)).max() < 0.02


def test_lengths_that_are_rounded_hold_a_linkage_and_that_is_said(caplog: pytest.LogCaptureFixture) -> None:
    """Bennett's bars with six digits: no joint moves."""
    text = re.sub(r"-?\d+\.\d+(e-\d+)?", lambda found: f"{float(found[0]):.6f}", bennett())
    robot = wbc.robots.load(text)
    (linkage,) = robot.loops.linkages
    assert linkage.held == robot.nv
    assert "the linkage of end0, end1 cannot move" in caplog.text


@pytest.mark.parametrize(("name", "frame"), [("parallelogram", "coupler"), ("bennett", "link2")])
def test_inverse_kinematics_ends_where_all_rows_hold(name: str, frame: str) -> None:
    robot = driven(name)
    stack = wbc.Stack(robot, DT).add(wbc.tasks.EndEffector(frame, kind="position"), name="hand")
    for seed in range(3):
        solution = stack.solve(robot.neutral, {"hand": robot.pose(robot.random(seed), frame).translation})
        assert solution.solved
        assert max(robot.loop_gaps(solution.q).values()) <= CLOSED


@pytest.mark.parametrize("seed", range(repeats(3)))
def test_torques_of_bennetts_linkages(seed: int) -> None:
    """Of any twists and lengths, against MuJoCo."""
    rng = np.random.default_rng(seed)
    twist, first = rng.uniform(0.3, 1.2), rng.uniform(0.6, 2.4)
    text = with_motors(bennett(twist, twist + rng.uniform(0.2, 0.9), rng.uniform(0.1, 0.5), first), ("joint0",))
    compare(wbc.robots.load(text, velocity=3.0, acceleration=200.0), text, seed, 4)


def test_a_hinge_that_closes_a_loop_is_one_in_mujoco(tmp_path: Path) -> None:
    path = tmp_path / "bars.sdf"
    path.write_text(SDF)
    robot = wbc.robots.load(path, acceleration=200.0).with_actuated(["motor"])
    model = mujoco_model(robot)
    assert [model.equality(k).name for k in range(model.neq)] == ["pin", "pin axis"]
    q = robot.random(0)
    step = stack_of(robot).compile(command="torque").step(q, np.zeros(robot.nv))
    torques, missing = needed(robot, "", q, np.zeros(robot.nv), step.a)
    assert np.abs(missing).max() < 1e-6
    assert step.torque[[0]] == pytest.approx(torques, rel=1e-6)
    with pytest.raises(UnsupportedJointError, match=r"slide.*pin"):
        mujoco_model(robot.with_loops().with_loops(Loop("pin", "pin:a", "pin:b", "slide")))
