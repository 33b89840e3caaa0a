"""Declaring a stack: what ``add`` takes, refuses and warns of, and rows of the mechanism that come by themselves."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.stack import small
from wbc.api import Stack
from wbc.api.stack import warn_free_base, warn_no_accelerations
from wbc.errors import (
    DuplicateNameError,
    LevelError,
    NotFiniteError,
    RangeError,
    ShapeError,
    UnknownNameError,
    WbcError,
)
from wbc.robot import Robot
from wbc.tasks import Damping, EndEffector, Fixed, FrameVelocityLimit, Hold, JointLimits, Posture
from wbc.tasks.mechanism import Mechanism


def fresh() -> Stack:
    """A stack that has an item already."""
    return Stack(small.arm(), 0.01).add(Posture())


@pytest.mark.parametrize(
    ("add", "error", "field", "says"),
    [
        pytest.param(lambda s: s.add(Posture()), DuplicateNameError, "name", "'posture'", id="default name twice"),
        pytest.param(
            lambda s: s.add(Damping(), name="posture"), DuplicateNameError, "name", "name=", id="another item's name"
        ),
        pytest.param(lambda s: s.add(JointLimits(), level=1), LevelError, "level", "valid: 0", id="level of bounds"),
        pytest.param(lambda s: s.add(Damping(), level=-1), LevelError, "level", "0 or more", id="level -1"),
        pytest.param(lambda s: s.add(Damping(), level=0.0), ShapeError, "level", "integer", id="level 0.0"),
        pytest.param(lambda s: s.add(Damping(), level=True), ShapeError, "level", "integer", id="level True"),
        pytest.param(lambda s: s.add(Damping(), level="0"), ShapeError, "level", "integer", id="level a word"),
        pytest.param(lambda s: s.add(Damping(), weight=-1), RangeError, "weight", "[0, inf]", id="negative weight"),
        pytest.param(lambda s: s.add(Damping(), weight=float("nan")), NotFiniteError, "weight", "nan", id="weight NaN"),
        pytest.param(lambda s: s.add(Damping(), weight=np.inf), NotFiniteError, "weight", "inf", id="weight inf"),
        pytest.param(lambda s: s.add(Damping(), weight=[1, 2]), ShapeError, "weight", "shape", id="weight of two"),
        pytest.param(lambda s: s.add(Damping(), weight="1"), ShapeError, "weight", "real", id="weight a word"),
        pytest.param(lambda s: s.add(Damping(), weight=None), ShapeError, "weight", "real", id="weight None"),
        pytest.param(lambda s: s.add(JointLimits(), weight=2.0), RangeError, "weight", "hard", id="constraint 2"),
        pytest.param(lambda s: s.add(JointLimits(), weight=0.0), RangeError, "weight", "hard", id="constraint 0"),
        pytest.param(lambda s: s.add(Damping), ShapeError, "item", "instance", id="a class"),
        pytest.param(lambda s: s.add(None), ShapeError, "item", "a task or a constraint", id="nothing"),
        pytest.param(lambda s: s.add("posture"), ShapeError, "item", "a task or a constraint", id="a word"),
        pytest.param(lambda s: s.add(Damping(), name=""), ShapeError, "name", "non-empty", id="an empty name"),
        pytest.param(lambda s: s.add(Damping(), name=3), ShapeError, "name", "string", id="a number for a name"),
        pytest.param(lambda s: s.add(Damping(weights=(1,))), ShapeError, "Damping.weights", "2", id="weights of rows"),
        pytest.param(lambda s: s.add(Fixed(("joint9",))), UnknownNameError, "Fixed.joints", "joint1", id="a joint"),
    ],
)
def test_refused(add: Callable[[Stack], Any], error: type[WbcError], field: str, says: str) -> None:
    stack = fresh()
    before = stack.entries, stack.key_data()
    with pytest.raises(error) as caught:
        add(stack)
    assert caught.value.field == field
    assert says in str(caught.value)
    assert (stack.entries, stack.key_data()) == before
    assert len(stack.add(Damping(), name="next")) == 2, "the next good call works"


def test_unknown_items_list_the_nearest() -> None:
    stack = fresh().add(EndEffector("tip"), name="hand").add(JointLimits(), name="limits")
    for names in (stack, stack.compile(backend="vm")):
        with pytest.raises(UnknownNameError) as caught:
            names["hnad"]
        assert caught.value.field == "item"
        assert caught.value.choices[0] == "hand"


@pytest.mark.parametrize(
    ("arguments", "error", "field"),
    [
        ({"dt": 0.0}, RangeError, "dt"),
        ({"dt": -0.01}, RangeError, "dt"),
        ({"dt": float("nan")}, NotFiniteError, "dt"),
        ({"dt": np.inf}, NotFiniteError, "dt"),
        ({"dt": "0.01"}, ShapeError, "dt"),
        ({"dt": [0.01]}, ShapeError, "dt"),
        ({"dt": None}, ShapeError, "dt"),
        ({"damping": 0.0}, RangeError, "damping"),
        ({"damping": -1e-8}, RangeError, "damping"),
        ({"damping": 9e-13}, RangeError, "damping"),
        ({"damping": 1.1}, RangeError, "damping"),
        ({"damping": float("nan")}, NotFiniteError, "damping"),
        ({"length": 0.0}, RangeError, "length"),
        ({"length": -1.0}, RangeError, "length"),
        ({"length": float("nan")}, NotFiniteError, "length"),
        ({"robot": "panda"}, ShapeError, "robot"),
        ({"robot": None}, ShapeError, "robot"),
        ({"robot": pin.Model()}, ShapeError, "robot"),
    ],
)
def test_stack_arguments_are_checked(arguments: dict[str, Any], error: type[WbcError], field: str) -> None:
    with pytest.raises(error) as caught:
        Stack(**{"robot": small.arm(), "dt": 0.01} | arguments)
    assert caught.value.field == field
    assert caught.value.value is arguments[field]


def test_a_robot_of_which_nothing_moves_has_no_stack() -> None:
    with pytest.raises(RangeError, match="nothing of it moves"):
        Stack(wbc.robots.load("panda", lock="panda_*"), 0.01)


@pytest.mark.parametrize("damping", [1e-12, 1e-8, 1.0, 1])
def test_damping_within_its_range(damping: float) -> None:
    assert Stack(small.arm(), 0.01, damping=damping).damping == damping


def test_calls_chain_and_keep_their_order() -> None:
    stack = Stack(small.arm(), np.float32(0.5))
    same = (
        stack.add(JointLimits())
        .add(EndEffector("tip"), name="hand", weight=np.int64(3))
        .add(Damping(), level=0)
        .add(FrameVelocityLimit("tip", linear=1.0), weight=1)
    )
    assert same is stack
    assert [e.name for e in stack.entries] == ["joint_limits", "hand", "damping", "frame_velocity_limit"]
    assert [e.name for e in stack.tasks] == ["hand", "damping"]
    assert [e.name for e in stack.constraints] == ["joint_limits", "frame_velocity_limit"]
    assert (stack["hand"].weight, stack["hand"].level, stack["hand"].is_task) == (3.0, 0, True)
    assert "hand" in stack
    assert "Hand" not in stack
    assert len(stack) == 4
    assert stack.dt == 0.5
    assert stack.dt_range == (0.125, 1.0)


# The mechanism


@cache
def robot(name: str) -> Robot:
    """A robot of the table, with speed limits everywhere."""
    bare = wbc.robots.load(name, shapes="none")
    return bare.with_limits(velocity=np.where(np.isfinite(bare.limits.velocity), bare.limits.velocity, 1.0))


def test_no_mechanism_without_reason() -> None:
    assert not robot("panda").couplings
    assert not robot("panda").locked_dofs
    assert len(Stack(robot("panda"), 0.005)) == 0


@pytest.mark.parametrize("name", ["tiago", "talos_full", "panda_fingers"])
def test_mechanism_comes_by_itself(name: str) -> None:
    bot = loaded(name)
    assert bot.couplings or bot.locked_dofs
    stack = Stack(bot, 0.005)
    assert [e.name for e in stack.entries] == ["mechanism"]
    assert isinstance(stack["mechanism"].item, Mechanism)
    assert len(stack["mechanism"].item.rows(bot)) == len(bot.couplings) + len(bot.locked_dofs)
    with pytest.raises(DuplicateNameError):
        stack.add(Mechanism())


def loaded(name: str) -> Robot:
    """A robot by name; ``panda_fingers`` is the arm with its two coupled fingers."""
    if name != "panda_fingers":
        return robot(name)
    return wbc.robots.load("panda", lock=(), shapes="none")


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
