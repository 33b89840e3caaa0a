"""Ellipsoids: distances against roots, support functions and Coal; rows of a tick; proofs; pictures and simulators."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import brentq

import wbc
from tests.distances import coal_distance
from tests.geometry.world import clear_of, distance, shapes
from tests.random_robots import random_pose
from tests.repeats import repeats
from wbc.errors import NotFiniteError, RangeError, ShapeError
from wbc.shapes import Box, Ellipsoid, HalfSpace, PlacedShape, Solid, Sphere
from wbc.validation import Array


def semi_axes(rng: np.random.Generator) -> tuple[float, float, float]:
    """From balls to needles and discs."""
    x, y, z = 0.3 * 10 ** rng.uniform(-1.0, 0.0, 3)
    return float(x), float(y), float(z)


def from_surface(axes: Array, y: Array) -> float:
    """Signed distance of a point from an ellipsoid: with x_i = e_i^2 y_i / (t + e_i^2) on it, x - y is normal to it."""
    e, y = np.asarray(axes), np.abs(y)
    low, high = -(e.min() ** 2), float(np.linalg.norm(e * y)) + 1.0

    def off(t: float) -> float:
        return float((((e * y) / (t + e**2)) ** 2).sum() - 1.0)

    t = brentq(off, low + 1e-12 * e.min() ** 2, high, xtol=1e-15)
    return float(np.sign(t) * np.linalg.norm(e**2 * y / (t + e**2) - y))


def test_points_and_balls_to_a_billionth() -> None:
    """Outside by the distance, inside by the shortest way out."""
    rng = np.random.default_rng(1)
    for _ in range(repeats(150)):
        axes, at = semi_axes(rng), random_pose(rng, 1.0)
        point = rng.normal(size=3) * axes * rng.choice([0.3, 0.9, 3.0])
        radius = float(rng.choice([0.0, 0.1]))
        found = distance(Ellipsoid(axes), at, Sphere(radius), pin.SE3(random_pose(rng).rotation, at.act(point)))
        expected = from_surface(np.array(axes), point)
        # Inside, the expanding polytope ends within 1e-7 of the sizes
        assert found.gap == pytest.approx(expected - radius, abs=1e-9 if expected > 1e-6 else 1e-7), (axes, point)


def test_all_shapes_as_coal_finds_them() -> None:
    rng = np.random.default_rng(2)
    apart = 0
    for _ in range(repeats(30)):
        one, at = Ellipsoid(semi_axes(rng)), random_pose(rng, 0.5)
        for other in (*shapes(rng), Ellipsoid(semi_axes(rng))):
            there = random_pose(rng, 0.3)
            found, back = distance(one, at, other, there), distance(other, there, one, at)
            assert back.gap == pytest.approx(found.gap, abs=1e-8)
            assert np.linalg.norm(found.normal) == pytest.approx(1.0)
            expected = coal_distance(one, at, other, there, 1e-9 if found.gap > 0.0 else None)
            if found.gap > 1e-6:
                apart += 1
                assert found.gap == pytest.approx(expected, abs=5e-8), (one, other)
            elif np.isfinite(expected) and expected > -10.0:
                assert found.gap == pytest.approx(expected, abs=2e-5), (one, other)
    assert apart > 50


def test_an_obstacle_in_a_tick_is_kept_clear_of() -> None:
    """The rows are the distance, and the arm stops in front of it."""
    shape, there = Ellipsoid((0.1, 0.25, 0.06)), pin.SE3(pin.rpy.rpyToMatrix(0.3, 0.2, 1.0), np.array([0.4, 0.35, 0.3]))
    clear_of(shape, there)


def test_links_keep_clear_of_each_other() -> None:
    robot = wbc.robots.load("ur5")
    group = {
        "forearm_link": [PlacedShape(Ellipsoid((0.25, 0.06, 0.08)), pin.SE3(np.eye(3), np.array([-0.2, 0.0, 0.05])))],
        "base_link": [PlacedShape(Ellipsoid((0.25, 0.25, 0.3)), pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.2])))],
    }
    robot = robot.with_shapes(group)
    stack = wbc.Stack(robot, dt=0.01)
    stack.add(wbc.tasks.Posture(), name="fold")
    stack.add(wbc.tasks.SelfCollision([("base_link", "forearm_link")], margin=0.035), name="apart")
    controller = stack.compile(backend="vm")
    controller["fold"].target = [0.0, -0.3, 2.9, 0.0, 0.0, 0.0]
    q, data, gaps = robot.configuration("q", [0.0, -1.57, 0.3, 0.0, 0.0, 0.0]), robot.model.createData(), list[float]()
    for _ in range(250):
        q = robot.integrate(q, controller.step(q).v, 0.01)
        pin.framesForwardKinematics(robot.model, data, q)
        placed = []
        for link, (one,) in group.items():
            placed += [one.shape, data.oMf[robot.model.getFrameId(link)] * one.placement]
        gaps.append(coal_distance(placed[0], placed[1], placed[2], placed[3], 1e-9))
    assert gaps[0] < 0.03, "they begin within the margin"
    assert 0.0345 < min(gaps[50:]) < 0.036


@pytest.mark.parametrize("obstacle", [HalfSpace(), Sphere(0.1), Box((0.2, 0.3, 0.1))], ids=repr)
def test_what_an_ellipsoid_on_a_link_is_measured_to(obstacle: HalfSpace | Solid) -> None:
    """No expression stands for it: not its centre, nor a ball."""
    robot = wbc.robots.load("ur5")
    placed = PlacedShape(Ellipsoid((0.05, 0.2, 0.1)), pin.SE3(pin.rpy.rpyToMatrix(0.5, 0.2, 0.1), np.zeros(3)))
    robot = robot.with_shapes({"wrist_3_link": [placed]})
    stack, there = wbc.Stack(robot, dt=0.01), pin.SE3(pin.rpy.rpyToMatrix(0.1, 0.2, 0.3), np.array([0.1, 0.2, -0.2]))
    stack.add(wbc.tasks.Obstacle(obstacle, pose=there), name="clear")
    controller, data = stack.compile(backend="vm"), robot.model.createData()
    for seed in range(5):
        q = robot.random(seed)
        controller.step(q)
        pin.framesForwardKinematics(robot.model, data, q)
        where = data.oMf[robot.model.getFrameId("wrist_3_link")] * placed.placement
        ((_, _, found),) = controller.pairs("clear")
        assert found == pytest.approx(coal_distance(placed.shape, where, obstacle, there), abs=1e-5)


def test_inertia_and_geom_are_those_of_mujoco() -> None:
    shape = Ellipsoid((0.1, 0.2, 0.3))
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="a")
    body.add_freejoint()
    geom = body.add_geom(mass=2.0)
    shape.become(geom, spec, "a")
    model = spec.compile()
    assert np.sort(model.body_inertia[1]) == pytest.approx(np.sort(np.diag(shape.inertia(2.0).inertia)))
    assert model.geom_size[0] == pytest.approx(shape.semi_axes)


def test_the_surface_is_drawn() -> None:
    shape = Ellipsoid((0.1, 0.2, 0.3))
    corners = shape.triangles()
    assert np.linalg.norm(corners.reshape(-1, 3) / shape.semi_axes, axis=1) == pytest.approx(np.ones(3 * len(corners)))
    volume = np.abs(np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum()) / 6.0
    assert volume == pytest.approx(4.0 / 3.0 * np.pi * 0.006, rel=0.01)


@pytest.mark.parametrize(
    ("given", "error"),
    [((0.1, 0.2), ShapeError), ((0.1, 0.2, 0.0), RangeError), ((0.1, np.nan, 0.2), NotFiniteError), ("x", ShapeError)],
)
def test_bad_semi_axes(given: object, error: type[Exception]) -> None:
    with pytest.raises(error, match="semi_axes"):
        Ellipsoid(given)  # type: ignore[arg-type]
