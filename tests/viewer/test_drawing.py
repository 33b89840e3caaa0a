"""What is drawn, by the numbers that a scene is given: forces, reach, balance, holds and the ways of hands."""

from __future__ import annotations

import functools
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbc
from wbc.api import Controller
from wbc.controller.step import state_of
from wbc.tasks import CenterOfMass, EndEffector, Hold, PointContact, Posture
from wbc.viewer.bodies import DrawnMesh
from wbc.viewer.drawing import AMBER, BLUE, GREEN, GREY, PURPLE, RED, Drawing, size
from wbc.viewer.link import SharedTick
from wbc.viewer.scenery import Scenery
from wbc.viewer.tick import Tick


class Scene:
    """Keeps what it is told to draw."""

    def __init__(self) -> None:
        self.nodes: dict[str, SimpleNamespace] = {}

    def __getattr__(self, name: str) -> Any:
        def add(node: str = "", *given: Any, **named: Any) -> SimpleNamespace:
            made = SimpleNamespace(visible=True, given=given, on_click=lambda _: None, **named)
            if name == "add_line_segments":
                made.points, made.colors = given
            self.nodes[str(node)] = made
            return made

        return add


def tick_of(controller: Controller, q: np.ndarray) -> Tick:
    return Tick(controller, SharedTick(1, 0.0, state_of(controller.step(q))))


@functools.cache
def standing() -> Controller:
    """A Panda that three of its frames hold, with its centre of mass as a task."""
    robot = wbc.robots.load("panda")
    stack = wbc.Stack(robot, dt=0.01)
    stack.add(EndEffector(robot.frames["tip"]), name="hand").add(CenterOfMass(weights=(1, 1, 0)), name="balance")
    for k in (2, 4, 6):
        stack.add(Hold(f"panda_link{k}"), name=f"hold {k}")
    return stack.compile(backend="vm")


@pytest.fixture
def drawn() -> tuple[Scene, Drawing, Tick]:
    controller, scene = standing().clone(), Scene()
    q = controller.stack.robot.neutral
    controller.reset(q)
    drawing = Drawing(scene, controller)  # type: ignore[arg-type]
    return scene, drawing, tick_of(controller, q)


def test_the_centre_of_mass_stands_on_the_polygon_of_what_is_held(drawn: tuple[Scene, Drawing, Tick]) -> None:
    scene, drawing, tick = drawn
    drawing.show(tick)
    center, feet = tick.center_of_mass(), [tick.pose(f"panda_link{k}").translation for k in (2, 4, 6)]
    assert scene.nodes["/com"].position == pytest.approx(center)
    lines = scene.nodes["/lines/balance"]
    low = min(foot[2] for foot in feet)
    assert lines.points[0] == pytest.approx(np.array([center, [center[0], center[1], low]]), abs=1e-6)
    assert (lines.colors[0] == AMBER).all()
    assert (lines.colors[1:] == GREEN).all()
    # Every corner is a foot, each once as a beginning and once as an end
    for side in (0, 1):
        corners = lines.points[1:, side]
        assert len(corners) == 3
        assert all(min(np.linalg.norm(corners - foot, axis=1)) < 1e-6 for foot in feet)


def test_the_reach_is_a_ball_that_no_configuration_leaves(drawn: tuple[Scene, Drawing, Tick]) -> None:
    scene, drawing, tick = drawn
    drawing.show(tick)
    assert "/lines/reach" not in scene.nodes
    drawing.demand("reach", True)
    drawing.show(tick)
    points = scene.nodes["/lines/reach"].points.reshape(-1, 3)
    center = points.mean(axis=0)
    radius = np.linalg.norm(points - center, axis=1)
    assert np.ptp(radius) < 0.03 * radius.max()
    robot = tick.robot
    hands = [robot.pose(robot.random(np.random.default_rng(k)), robot.frames["tip"]).translation for k in range(50)]
    far = np.linalg.norm(np.array(hands) - tick.joint(1).translation, axis=1)
    assert far.max() < radius.max()
    # And it is no larger than it has to be said: a stretched arm comes near to it
    assert far.max() > 0.6 * radius.max()
    drawing.demand("reach", False)
    drawing.show(tick)
    assert not scene.nodes["/lines/reach"].visible


def test_a_force_is_an_arrow_along_it_from_its_contact() -> None:
    robot = wbc.robots.load("panda")
    stack = wbc.Stack(robot, dt=0.01)
    stack.add(PointContact("panda_hand_tcp", friction=0.4), name="wiper").add(Posture(), weight=1e-2)
    controller, scene = stack.compile(command="torque", backend="vm"), Scene()
    q = robot.neutral
    controller.reset(q)
    tick, drawing = tick_of(controller, q), Drawing(scene, controller)  # type: ignore[arg-type]
    force = np.array([3.0, -4.0, 12.0])
    pressed: Any = SimpleNamespace(step=SimpleNamespace(forces={"wiper": force}), pose=tick.pose)
    lines, colours = drawing._forces(pressed)
    pose = tick.pose("panda_hand_tcp")
    item: Any = stack["wiper"].item
    wrench = np.zeros(6)
    wrench[list(item.axes)] = force[: len(item.axes)]
    along = pose.rotation @ wrench[:3]
    shaft = lines[0][1] - lines[0][0]
    assert lines[0][0] == pytest.approx(pose.translation)
    assert np.cross(shaft, along) == pytest.approx(np.zeros(3), abs=1e-9)
    assert shaft @ along > 0.0
    # Half the robot's size for its weight on earth
    weight = 9.81 * pin.computeTotalMass(robot.model)
    assert np.linalg.norm(shaft) == pytest.approx(0.5 * size(robot) * np.linalg.norm(along) / weight, rel=1e-2)
    assert len(lines) == 3
    assert colours == [PURPLE] * 3
    assert all(np.linalg.norm(barb[0] - lines[0][1]) < 1e-12 for barb in lines[1:])


def test_a_note_marks_reserved_and_gone_holds_and_draws_the_ways_of_hands() -> None:
    controller, scene = standing().clone(), Scene()
    empty = DrawnMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.uint32), (0, 0, 0))
    places = np.array([[0.0, 0, 0], [1.0, 0, 0], [0.0, 1.0, 0]])
    around = Scenery((), empty, ("a", "b", "c"), places, (0.0, 0.0, 1.0), "panda_link0", ("arm1",), {}, 0.25)
    drawing = Drawing(scene, controller, scenery=around)  # type: ignore[arg-type]
    ways = [[[0.0, 0, 0], [0.5, 0, 0.2], [1.0, 0, 0]], [[0.0, 0, 0], [0.0, 1.0, 0]]]
    drawing.note({"reserved": ["b"], "gone": ["c"], "held": ["a"], "ways": ways})
    assert scene.nodes["/holds/reserved b"].color == BLUE
    assert scene.nodes["/holds/reserved b"].position == pytest.approx(places[1])
    assert scene.nodes["/holds/gone c"].color == RED
    assert scene.nodes["/holds/held a"].color == AMBER
    lines = scene.nodes["/lines/swings"]
    assert lines.points.shape == (3, 2, 3)
    assert [tuple(colour[0]) for colour in lines.colors] == [PURPLE, PURPLE, GREY]
    drawing.note({"reserved": [], "gone": ["c"], "ways": []})
    assert not scene.nodes["/holds/reserved b"].visible
    assert not scene.nodes["/holds/held a"].visible
    assert scene.nodes["/holds/gone c"].visible
    assert not lines.visible
