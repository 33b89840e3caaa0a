"""What is easily forgotten is said once: an item after ``compile``, a base that nothing limits."""

from __future__ import annotations

import pytest

import wbc.robots
from wbc.api import Stack
from wbc.api.stack import warn_free_base, warn_no_accelerations
from wbc.tasks import Damping, FrameVelocityLimit, Hold, JointLimits, Posture


@pytest.mark.parametrize("command", ["velocity", "torque"])
def test_an_item_after_compile_is_said_while_a_controller_lives(command: str, caplog: pytest.LogCaptureFixture) -> None:
    stack = Stack(wbc.robots.load("double_pendulum"), 0.01).add(Posture())
    controller = stack.compile(backend="vm", command=command)
    assert not caplog.messages
    stack.add(Damping())
    (said,) = caplog.messages
    assert said == "'damping' was added after compile(): controllers that exist do not have it; compile again"
    assert "damping" not in controller


def test_a_base_that_nothing_limits_is_said_once_with_a_line_that_works(caplog: pytest.LogCaptureFixture) -> None:
    warn_free_base.cache_clear()
    robot = wbc.robots.load("quadruped")
    for _ in range(2):
        Stack(robot, 0.01).add(Posture()).add(JointLimits()).compile(backend="vm")
    (said,) = caplog.messages
    assert "quadruped: nothing limits how fast its base moves" in said
    line = said.split("robot = robot.")[1].split(" in m/s")[0]
    limited = eval(f"robot.{line}", {"robot": robot})
    foot = robot.frames["front_left_foot"]
    warn_free_base.cache_clear()
    caplog.clear()
    Stack(limited, 0.01).add(Posture()).add(JointLimits()).compile(backend="vm")
    Stack(robot, 0.01).add(Posture()).add(FrameVelocityLimit(foot, linear=1.0)).compile(backend="vm")
    assert not caplog.messages


def test_held_frames_without_limits_of_accelerations_are_said_once(caplog: pytest.LogCaptureFixture) -> None:
    warn_no_accelerations.cache_clear()
    robot = wbc.robots.load("quadruped")
    hold = Hold(robot.frames["front_left_foot"])
    for _ in range(2):
        Stack(robot, 0.01).add(Posture()).add(hold, name="foot").add(JointLimits()).compile(backend="vm")
    (said,) = caplog.messages
    assert "quadruped: nothing limits accelerations, so beside 'foot'" in said
    warn_no_accelerations.cache_clear()
    caplog.clear()
    limited = eval(said.split("robot = ")[1].split(" in rad")[0], {"robot": robot})
    Stack(limited, 0.01).add(Posture()).add(hold).add(JointLimits()).compile(backend="vm")
    Stack(robot, 0.01).add(Posture()).add(hold, soft=1.0).compile(backend="vm")
    Stack(wbc.robots.load("double_pendulum"), 0.01).add(Posture()).compile(backend="vm")
    assert [m for m in caplog.messages if "accelerations" in m] == []
