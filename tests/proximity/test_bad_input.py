"""Bad pairs, counts, buffers and robots: typed errors that name what was wrong."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.models import X, add_chain, robot as bare, spherical_seven
from tests.proximity.world import buffers, robot
from wbc.errors import (
    DuplicateNameError,
    NotFiniteError,
    RangeError,
    RotationError,
    ShapeError,
    UnknownNameError,
    UnsupportedJointError,
    WbcError,
)
from wbc.proximity import MAX_PAIRS, Body, PairSensor, distances
from wbc.shapes import Box, HalfSpace, Sphere

HERE = pin.SE3.Identity()
HAND = Body("hand", "panda_hand", HERE, Sphere(0.1))
BLOCK = Body("block", "world", HERE, Box((0.1, 0.1, 0.1)))
BALL = Body("ball", "obstacle", HERE, Sphere(0.1))


@pytest.mark.parametrize(
    ("fields", "kind", "field"),
    [
        ((1, "world", HERE, Sphere(0.1)), ShapeError, "Body.name"),
        (("a", None, HERE, Sphere(0.1)), ShapeError, "Body.frame"),
        (("a", "world", HERE, 0.1), ShapeError, "Body.shape"),
        (("a", "world", np.eye(3), Sphere(0.1)), ShapeError, "Body.placement"),
        (("a", "world", 2 * np.eye(4), Sphere(0.1)), RotationError, "Body.placement"),
        (("a", "world", pin.SE3(np.eye(3), np.array([np.nan, 0, 0])), Sphere(0.1)), NotFiniteError, "Body.placement"),
    ],
)
def test_bad_bodies(fields: tuple[Any, ...], kind: type[WbcError], field: str) -> None:
    with pytest.raises(kind) as caught:
        Body(*fields)
    assert caught.value.field == field


@pytest.mark.parametrize(
    ("pairs", "kind", "field"),
    [
        ([], RangeError, "pairs"),
        (7, ShapeError, "pairs"),
        ([HAND, BLOCK], ShapeError, "pairs[0]"),
        ([(HAND, BLOCK), (HAND,)], ShapeError, "pairs[1]"),
        ([(HAND, HAND)], ShapeError, "pairs[0]"),
        ([(Body("a", "world", HERE, HalfSpace()), Body("b", "panda_hand", HERE, HalfSpace()))], ShapeError, "pairs[0]"),
        ([(HAND, Body("b", "panda_hnd", HERE, Sphere(0.1)))], UnknownNameError, "pairs[0].frame"),
        ([(HAND, BLOCK)] * (MAX_PAIRS + 1), RangeError, "pairs"),
        ([(HAND, BLOCK), (Body("g", "panda_link8", HERE, Sphere(0.1)), HAND)], RangeError, "pairs[1]"),
        ([(BLOCK, BALL)], RangeError, "pairs[0]"),
    ],
)
def test_bad_pairs(pairs: Any, kind: type[WbcError], field: str) -> None:
    bot = robot("panda")
    with pytest.raises(kind) as caught:
        PairSensor(bot, pairs, 2, buffers(bot, 2))
    assert caught.value.field == field
    if kind is UnknownNameError:
        assert caught.value.choices[0] == "panda_hand"


@pytest.mark.parametrize("count", [0, -1, 1.5, True, "2"])
def test_bad_counts(count: Any) -> None:
    bot = robot("panda")
    with pytest.raises(RangeError, match="count"):
        PairSensor(bot, [(HAND, BLOCK)], count, buffers(bot, 1))


def test_bad_buffers_stay_as_they_are() -> None:
    bot = robot("panda")
    for name in ("distance", "drift", "line", "side", "pose"):
        numbers = buffers(bot, 2)
        before = {k: v.copy() for k, v in numbers.items()}
        numbers[name] = np.zeros(5)
        with pytest.raises(ShapeError, match=name):
            PairSensor(bot, [(HAND, BALL)], 2, numbers)
        del numbers[name]
        with pytest.raises(UnknownNameError) as caught:
            PairSensor(bot, [(HAND, BALL)], 2, numbers)
        assert caught.value.value == name
        assert all(np.array_equal(numbers[k], before[k], equal_nan=True) for k in numbers)


def test_a_frame_cannot_be_the_robots_and_the_obstacles() -> None:
    bot = spherical_seven().with_frame("obstacle", "tip")
    tip = Body("tip", "F5", HERE, Sphere(0.1))
    with pytest.raises(DuplicateNameError):
        PairSensor(bot, [(tip, BALL)], 1, buffers(bot, 1))


def test_bad_configurations_of_distances() -> None:
    bot = robot("panda")
    for q, kind in ((np.zeros(3), ShapeError), (np.full(bot.nq, np.inf), NotFiniteError)):
        with pytest.raises(kind):
            distances(bot, [(HAND, BLOCK)], q)
    with pytest.raises(RotationError):
        distances(bot, [(HAND, BLOCK)], bot.neutral, np.diag([2.0, 1.0, 1.0, 1.0]))


def test_bad_configurations_write_nothing() -> None:
    bot = robot("panda")
    numbers = buffers(bot, 1)
    made = PairSensor(bot, [(HAND, BLOCK)], 1, numbers)
    made.sense(bot.neutral)
    before = {key: value.copy() for key, value in numbers.items()}
    for q, kind in ((np.zeros(3), ShapeError), ("here", ShapeError), ([np.nan] * bot.nq, NotFiniteError)):
        with pytest.raises(kind):
            made.sense(q)  # type: ignore[arg-type]
        assert all(np.array_equal(numbers[key], before[key], equal_nan=True) for key in numbers)
    made.sense(bot.neutral.tolist())
    assert all(np.array_equal(numbers[key], before[key], equal_nan=True) for key in numbers)


def mimicking() -> Any:
    """An arm of three joints, the third of which follows the first."""
    model = pin.Model()
    last = add_chain(model, [(X, (0, 0.3, 0)), (X, (0, 0.3, 0))])
    leader = model.joints[1]
    follower = model.addJoint(last, pin.JointModelMimic(leader, 1.0, 0.0), HERE, "follower")
    model.addFrame(pin.Frame("hook", follower, 0, HERE, pin.FrameType.OP_FRAME))
    return bare("mimic", model)


def test_a_mimic_joint_between_the_bodies_is_refused() -> None:
    bot = mimicking()
    below, hook = Body("below", "F1", HERE, Sphere(0.1)), Body("hook", "hook", HERE, Sphere(0.1))
    with pytest.raises(UnsupportedJointError, match="follower"):
        PairSensor(bot, [(below, hook)], 1, buffers(bot, 1))
    made = PairSensor(bot, [(hook, BLOCK)], 1, buffers(bot, 1))
    made.sense(bot.neutral)
