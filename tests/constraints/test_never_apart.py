"""Pairs of shapes that no posture brings far apart: how far one does, what they keep of the margin, and their names."""

from __future__ import annotations

import logging

import numpy as np
import pinocchio as pin
import pytest

from tests import models
from wbc.api import Stack
from wbc.controller import Status
from wbc.errors import MissingShapeError
from wbc.robot import Limits, Robot
from wbc.robot.pairs.apart import most_apart
from wbc.shapes import Box, PlacedShape, Sphere
from wbc.tasks import JointLimits, Posture
from wbc.tasks.self_collision import APART, SHARE, SelfCollision

#: Upper arm and forearm [m]; the elbow is bent by LEAST [rad] or more: shoulder and wrist are at most STRAIGHT apart
UPPER, FORE, LEAST = 1.0, 0.8, 0.4
STRAIGHT = np.sqrt(UPPER**2 + FORE**2 + 2 * UPPER * FORE * np.cos(LEAST))


def bent(room: float, cube: bool = False) -> Robot:
    """An arm whose elbow is bent by 0.4 to 2 rad; balls about shoulder and wrist that are at most ``room`` apart."""
    links = [((0, 0, 1), (UPPER, 0, 0)), ((0, 0, 1), (FORE, 0, 0)), ((0, 0, 1), (0.3, 0, 0))]
    arm, free = models.arm("bent", links), np.full(3, np.inf)
    low, high = np.array([-1.0, LEAST, -1.0]), np.array([1.0, 2.0, 1.0])
    robot = Robot("bent", arm.model, Limits(low, high, free, free, free), neutral=np.array([0.0, 1.0, 0.0]))
    ball = PlacedShape(Sphere(0.9), pin.SE3.Identity())
    rest = STRAIGHT - 0.9 - room
    own = Box((2.0 * rest, 0.1, 0.1)) if cube else Sphere(rest)
    return robot.with_shapes({"F1": [ball], "F3": [PlacedShape(own, pin.SE3.Identity())]})


def named(robot: Robot) -> dict[str, tuple[str, PlacedShape]]:
    return {f"{link}[0]": (link, shapes[0]) for link, shapes in robot.shapes.items()}


@pytest.mark.parametrize("room", [-0.2, -0.01, 0.002, 0.03])
def test_the_most_that_a_posture_brings_shapes_apart_is_the_closed_form(room: float) -> None:
    robot = bent(room)
    ((_, found),) = most_apart(robot, named(robot), [("F1[0]", "F3[0]")], 0.05).items()
    assert found == pytest.approx(room, abs=1e-4)
    assert most_apart(robot, named(robot), [("F1[0]", "F3[0]")], room - 1e-3) == {}


def test_shapes_without_a_closed_form_are_measured() -> None:
    """A slab on the wrist can be turned away: what its bounding capsule says is too little."""
    robot = bent(-0.01, cube=True)
    assert most_apart(robot, named(robot), [("F1[0]", "F3[0]")], 0.05) == {}


@pytest.mark.parametrize("method", ["symbolic", "sensed"])
@pytest.mark.parametrize("room", [0.01, 0.03])
def test_a_pair_keeps_no_more_than_half_of_the_room_that_it_has(
    room: float, method: str, caplog: pytest.LogCaptureFixture
) -> None:
    robot, margin = bent(room), 0.02
    item = SelfCollision(margin=margin, method=method)  # type: ignore[arg-type]
    with caplog.at_level(logging.WARNING, logger="wbc"):
        stack = Stack(robot, 0.01).add(JointLimits(), name="limits").add(Posture(), name="rest")
        stack.add(item, name="self")
    said = f"F1[0] and F3[0] ({1e3 * room:.1f} mm)" in caplog.text
    assert said == (room < margin)
    control, q = stack.compile(backend="vm"), np.array([0.0, LEAST, 0.0])
    control["rest"].target = np.array([0.0, 2.0, 0.0])
    for _ in range(200):
        step = control.step(q)
        assert step.status is Status.SOLVED
        q = pin.integrate(robot.model, q, 0.01 * step.v)
    kept = min(margin, SHARE * room)
    apart = np.sqrt(UPPER**2 + FORE**2 + 2 * UPPER * FORE * np.cos(q[1])) - STRAIGHT + room
    assert apart == pytest.approx(kept, abs=3e-4)
    assert step.margins["self"].min() == pytest.approx(apart - kept, abs=1e-6)
    if method == "sensed":
        ((_, _, distance),) = control.pairs("self")
        assert distance == pytest.approx(apart, abs=1e-4), "the distance itself is told"


def test_what_always_overlaps_is_left_out_by_name(caplog: pytest.LogCaptureFixture) -> None:
    robot = bent(-0.01)
    with caplog.at_level(logging.WARNING, logger="wbc"), pytest.raises(MissingShapeError, match="no posture"):
        SelfCollision([("F1", "F3")]).validate(robot)
    more = robot.with_shapes({**robot.shapes, "tip": [PlacedShape(Sphere(0.01), pin.SE3.Identity())]})
    item = SelfCollision([("F1", "F3"), ("F1", "tip")], margin=0.01)
    with caplog.at_level(logging.WARNING, logger="wbc"):
        item.validate(more)
    assert "nothing keeps them clear: F1[0] and F3[0] (-10.0 mm)" in caplog.text
    assert [row.label for row in item.rows(more)] == ["F1[0] tip[0]"]
    assert APART < 0.01
