"""A way round for a dragged target: planned where an obstacle holds the robot back, and followed by the posture."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.plan.scenes import CoalJudge, at, reaching
from tests.viewer.arms import fresh
from wbc.api import Controller
from wbc.controller.step import state_of
from wbc.errors import WbcError
from wbc.shapes import Box
from wbc.viewer import messages
from wbc.viewer.link import SharedTick
from wbc.viewer.operation import Operation
from wbc.viewer.tick import Tick
from wbc.viewer.ways import WaysRound

HAND = "panda_hand_tcp"


#: Where the page has moved the board to
PLACE = at(0.65, 0.0, 0.35)


def under_a_board() -> tuple[wbc.Stack, np.ndarray, pin.SE3]:
    """A Panda that reaches under a board, and a pose for its hand above it; the board stands elsewhere at first."""
    stack = wbc.Stack(wbc.robots.load("panda").with_limits(acceleration=8.0), dt=0.01)
    stack.add(wbc.tasks.EndEffector(HAND, gain=4.0), name="hand")
    stack.add(wbc.tasks.Posture(), name="posture", weight=1e-6)
    stack.add(wbc.tasks.JointLimits(), name="limits")
    stack.add(wbc.tasks.Obstacle(Box((0.4, 0.8, 0.02)), pose=at(0.65, 3.0, 0.35), margin=0.01), name="board")
    planner = stack.planner()
    planner["board"].pose = PLACE
    start = planner.coordinates.configuration(
        planner.branches(stack.robot.neutral, {"hand": reaching(0.6, 0.0, 0.15)})[0]
    )
    return stack, start, reaching(0.6, 0.0, 0.55)


class Loop:
    """A loop and what watches it, in one process and without a clock."""

    def __init__(self, controller: Controller, q: np.ndarray) -> None:
        self.controller, self.operation, self.q = controller, Operation(controller), q
        self.told, self.sent, self.visited, self.number = list[str](), list[dict[str, Any]](), list[np.ndarray](), 0
        self.ways = WaysRound(controller.clone(), self.sent.append, self.told.append)

    def tick(self) -> None:
        """A tick, and what came of it."""
        controller, dt = self.controller, self.controller.stack.dt
        step = controller.step(self.q)
        self.number += 1
        self.ways.look(Tick(controller, SharedTick(self.number, self.number * dt, state_of(step))))
        if self.ways._thread is not None:
            self.ways._thread.join()
        while self.sent:
            self.operation.obey(messages.read(messages.write(self.sent.pop())))
        if self.operation.moving:
            self.operation.advance(dt)
        self.q = controller.stack.robot.integrate(self.q, step.v, dt)
        self.visited.append(self.q)


def test_a_target_above_a_board_is_reached_from_below() -> None:
    """The tick alone rests under it. A path that ends too soon is followed by another one."""
    stack, start, target = under_a_board()
    robot, controller = stack.robot, stack.compile(backend="vm")
    for watched in (False, True):
        controller.reset(start)
        controller["board"].pose = PLACE
        loop = Loop(controller, start)
        message = {"type": "set", "item": "hand", "values": {"target": pin.SE3ToXYZQUAT(target).tolist()}}
        controller.step(start)
        loop.operation.obey(message)
        if watched:
            loop.ways.dragged("hand")
        cut = False
        for _ in range(700):
            loop.tick()
            if loop.operation._path is not None and not cut:
                cut = True
                loop.operation._leave_path()
        off = np.linalg.norm(robot.pose(loop.q, HAND).translation - target.translation)
        judge = CoalJudge(stack, {"board": PLACE})
        assert min(judge.margin(q) for q in loop.visited[::5]) > -2e-3
        assert bool(off < 0.01) is watched
        assert cut is watched
        assert not loop.told
    # What was set before is there again
    assert controller["hand"].enabled
    assert controller["posture"].weight == pytest.approx(1e-6)


def test_what_has_no_way_round_is_told_and_nothing_is_sent() -> None:
    stack, start, _ = under_a_board()
    controller = stack.compile(backend="vm")
    controller.reset(start)
    loop = Loop(controller, start)
    controller["board"].pose = PLACE
    controller.step(start)
    controller["hand"].target = reaching(0.6, 0.22, 0.37)
    loop.ways.dragged("hand")
    for _ in range(600):
        loop.tick()
    assert len(loop.told) == 1
    assert "no way round to hand" in loop.told[0]
    assert "board" in loop.told[0]


def test_a_path_that_is_followed_ends_where_something_else_is_asked_for() -> None:
    controller = fresh()
    operation, robot = Operation(controller), controller.stack.robot
    q = robot.neutral
    controller.step(q)
    before = {name: controller[name].weight for name in ("hand", "posture")}
    path = [q.tolist(), (q + 0.2).tolist()]
    follow = {"type": "follow", "item": "hand", "dt": 1.0, "q": path}
    pose = pin.SE3ToXYZQUAT(controller["hand"].target).tolist()
    ends = (
        {"type": "set", "item": "hand", "values": {"target": pose}},
        {"type": "rate", "item": "hand", "rate": [0.1, 0, 0, 0, 0, 0]},
        {"type": "stop"},
    )
    for end in ends:
        operation.obey(follow)
        operation.advance(0.5)
        assert not controller["hand"].enabled
        np.testing.assert_allclose(controller["posture"].target, q + 0.1)
        np.testing.assert_allclose(controller["posture"].feedforward, 0.2)
        operation.obey(end)
        if end["type"] == "stop":
            operation.resume()
        assert controller["hand"].enabled
        np.testing.assert_allclose(controller["posture"].feedforward, 0.0)
        assert {name: controller[name].weight for name in before} == before


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"q": [[0.0] * 7]}, "two configurations"),
        ({"q": [[0.0] * 6] * 3}, r"message.q\[0\]"),
        ({"q": [[float("nan")] * 7] * 3}, "message.q"),
        ({"dt": 0.0}, "message.dt"),
        ({"item": "ball"}, "a path leads a task"),
        ({"item": "hnd"}, "hand"),
    ],
)
def test_a_path_that_is_none_is_refused_and_nothing_changes(change: dict[str, Any], match: str) -> None:
    controller = fresh()
    operation = Operation(controller)
    message = {"type": "follow", "item": "hand", "dt": 0.1, "q": [[0.0] * 7] * 3} | change
    with pytest.raises(WbcError, match=match):
        operation.check(message)
    with pytest.raises(WbcError, match=match):
        operation.obey(message)
    assert controller["hand"].enabled
    assert not operation.moving
