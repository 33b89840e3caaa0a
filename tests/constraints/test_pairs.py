"""Every pair of shapes with an expression: values against Coal, derivatives against differences, degenerate places."""

from __future__ import annotations

import itertools
import zlib
from typing import ClassVar

import casadi as ca
import numpy as np
import pinocchio as pin

from tests.models import placement

# isort: split
import pytest

from tests.distances import coal_distance
from tests.evaluation import numbers, probe, random_configuration
from tests.random_robots import random_pose
from tests.tasks.robots import robot as registered
from tests.tasks.test_registry import check_derivatives
from wbc.robot import Robot
from wbc.shapes import Box, Capsule, Convex, Cylinder, HalfSpace, PlacedShape, Shape, Solid, Sphere
from wbc.tasks import _gap as gap
from wbc.tasks._nearest import out_of_box, out_of_cylinder
from wbc.tasks.obstacle import Obstacle


def hull(count: int) -> Convex:
    """A convex hull of ``count`` vertices on an ellipsoid."""
    points = np.random.default_rng(3).normal(size=(count, 3))
    return Convex(points / np.linalg.norm(points, axis=1, keepdims=True) * [0.1, 0.08, 0.12])


HULL, CUT = hull(30), hull(6)
SOLIDS: list[Solid] = [Sphere(0.07), Capsule(0.05, 0.2), Box((0.1, 0.2, 0.15)), Cylinder(0.06, 0.2), HULL, CUT]
ROWS = [(a, b) for a, b in itertools.product(SOLIDS, [*SOLIDS, HalfSpace()]) if gap.pair_rows(a, b)]
PAIRS = [pair for pair in ROWS if not gap.is_sensed(*pair)]
#: A capsule with a box or a cylinder has rows for its ends
ENDS = [pair for pair in ROWS if gap.is_sensed(*pair)]


def name_of(shape: Shape) -> str:
    return f"{type(shape).__name__}{len(shape.points) if isinstance(shape, Convex) else ''}"


ASKEW = pin.SE3(pin.exp3(np.array([0.4, -1.1, 0.7])), np.array([0.03, -0.05, 0.06]))


def carrying(shape: Solid, name: str = "panda") -> tuple[Robot, str]:
    """A robot whose only shape is on its last link but one, askew; and the link."""
    bot = registered(name)
    link = list(bot.shapes)[-2]
    return bot.with_shapes({link: (PlacedShape(shape, ASKEW),)}), link


def where(bot: Robot, q: np.ndarray, link: str) -> pin.SE3:
    """Pose of the link's shape in the world."""
    return placement(bot, link, q) * ASKEW


def near(bot: Robot, q: np.ndarray, link: str, rng: np.random.Generator) -> pin.SE3:
    """A pose about a decimetre from the shape."""
    return pin.SE3(random_pose(rng).rotation, where(bot, q, link).translation + rng.normal(0.0, 0.12, 3))


def cylinder_gap(ball: np.ndarray, radius: float, cylinder: Cylinder) -> float:
    """Distance of a ball to a cylinder, in the axes of the cylinder: that of a point to a rectangle."""
    over = np.array([np.hypot(ball[0], ball[1]) - cylinder.radius, abs(ball[2]) - cylinder.length / 2])
    return float(np.linalg.norm(np.maximum(over, 0)) + min(over.max(), 0.0) - radius)


def ends(pose: pin.SE3, length: float) -> list[np.ndarray]:
    return [pose.act(np.array([0.0, 0.0, side * length / 2])) for side in (-1, 1)]


def ball_gap(center: np.ndarray, radius: float, face: Box | Cylinder, pose: pin.SE3) -> float:
    """Distance of a ball to a box (by Coal) or to a cylinder."""
    if isinstance(face, Cylinder):
        return cylinder_gap(pose.actInv(center), radius, face)
    return coal_distance(Sphere(radius), pin.SE3(np.eye(3), center), face, pose)


class Ends(Obstacle):
    """Without the sensed rows."""

    abstract: ClassVar[bool] = True

    def sensed_rows(self, robot: Robot) -> int:
        return 0


def test_pairs_are_those_that_are_promised() -> None:
    kinds = {(type(a).__name__, type(b).__name__) for a, b in PAIRS}
    ball = {("Sphere", other) for other in ("Sphere", "Capsule", "Box", "Cylinder")}
    plane = {(type(solid).__name__, "HalfSpace") for solid in SOLIDS}
    assert kinds == ball | {pair[::-1] for pair in ball} | {("Capsule", "Capsule")} | plane
    rods = {("Capsule", "Box"), ("Capsule", "Cylinder")}
    assert {(type(a).__name__, type(b).__name__) for a, b in ENDS} == rods | {pair[::-1] for pair in rods}
    assert len(HULL.points) > gap.VERTEX_ROWS >= len(CUT.points)
    assert gap.pair_rows(hull(gap.SUPPORT_VERTICES), HalfSpace()) == ("",)
    assert gap.pair_rows(hull(gap.SUPPORT_VERTICES + 1), HalfSpace()) == ()


@pytest.mark.parametrize(("solid", "other"), PAIRS, ids=name_of)
def test_margins_are_those_of_coal(solid: Solid, other: Shape) -> None:
    bot, link = carrying(solid)
    item, rng = Obstacle(other), np.random.default_rng(21)
    clear, inside, outside = probe(item, bot), 0, 0
    rows = len(item.rows(bot))
    for _ in range(60):
        q = random_configuration(bot, rng)
        pose = near(bot, q, link, rng)
        h = clear(q, pose=pose)[0]
        truth = coal_distance(solid, where(bot, q, link), other, pose)
        if Cylinder in (type(solid), type(other)) and Sphere in (type(solid), type(other)):
            # In a cylinder Coal's own iteration is off by millimetres
            here = where(bot, q, link)
            if isinstance(other, Cylinder):
                exact = cylinder_gap(pose.actInv(here.translation), solid.radius, other)
            else:
                exact = cylinder_gap(here.actInv(pose.translation), other.radius, solid)
            assert truth < 0 or truth == pytest.approx(exact, abs=1e-6)
            truth = exact
        assert h.shape == (rows,)
        assert h.min() == pytest.approx(truth, abs=1e-9)
        inside, outside = inside + (truth < 0), outside + (truth > 0)
    assert min(inside, outside) >= 5


@pytest.mark.parametrize(("solid", "other"), ENDS, ids=name_of)
def test_ends_of_a_capsule_against_faces(solid: Solid, other: Shape) -> None:
    """Two rows: the distances of the spheres at the ends. None is below that of the whole capsule."""
    bot, link = carrying(solid)
    clear, rng, touching = probe(Ends(other), bot), np.random.default_rng(22), 0
    for _ in range(30):
        q = random_configuration(bot, rng)
        pose = near(bot, q, link, rng)
        h, here = clear(q, pose=pose)[0], where(bot, q, link)
        rod, face, at, other_at = (
            (solid, other, here, pose) if isinstance(solid, Capsule) else (other, solid, pose, here)
        )
        for row, end in enumerate(ends(at, rod.length)):
            truth = ball_gap(end, rod.radius, face, other_at)
            assert h[row] == pytest.approx(truth, abs=1e-9)
            touching += truth < 0
        whole = coal_distance(solid, here, other, pose)
        assert whole < 0 or h.min() > whole - 1e-6
    assert touching > 3


@pytest.mark.parametrize("name", ["panda", "talos"])
@pytest.mark.parametrize(("solid", "other"), ROWS, ids=name_of)
def test_derivatives_along_v_and_in_time(solid: Solid, other: Shape, name: str) -> None:
    bot, link = carrying(solid, name)
    found = numbers(Ends(other), bot)
    rng = np.random.default_rng(zlib.crc32(f"{solid} {other} {name}".encode()))
    for _ in range(2):
        q = random_configuration(bot, rng)
        values = {"pose": near(bot, q, link, rng), "velocity": rng.uniform(-1, 1, 6), "margin": 0.01}
        check_derivatives(found, q, values)


@pytest.mark.parametrize(("solid", "other"), ROWS, ids=name_of)
def test_gradient_is_a_unit_vector_wherever_the_shapes_are(solid: Solid, other: Shape) -> None:
    """Centres coincide, axes cross or are parallel, a centre in a face, on an edge, on an axis; in between as well."""
    bot, link = carrying(solid)
    clear, q = probe(Ends(other), bot), bot.neutral
    here, quarter = where(bot, q, link), pin.utils.rotate("x", np.pi / 2)
    turns = [np.eye(3), quarter, pin.exp3(np.array([0.3, 0.2, 0.1])), pin.exp3(np.array([1e-9, 0.0, 0.0]))]
    steps = [
        np.zeros(3),
        *(1e-11 * np.eye(3)),
        *(0.05 * np.eye(3)),
        *np.array([[0.05, 0.1, 0.0], [0.05, 0.1, 0.075], [0.03, 0.03, 0.03], [0.0, 0.0, 0.1], [0.06, 0.0, 0.1]]),
    ]
    for turn, step in itertools.product(turns, steps):
        for pose in (here * pin.SE3(turn, step), here * pin.SE3(turn, step).inverse()):
            h, jacobian, _ = clear(q, pose=pose)
            assert np.isfinite(h).all()
            assert np.isfinite(jacobian).all()
            pushes = [clear(q, pose=pose, velocity=axis)[2] for axis in np.eye(6)[:3]]
            assert np.linalg.norm(pushes, axis=0) == pytest.approx(1.0, abs=1e-9)


def test_directions_out_are_the_declared_ones() -> None:
    """Velocity of the obstacle along the declared direction, from the link to it, opens the gap at 1 m/s."""

    def rate(solid: Solid, other: Shape, step: np.ndarray, axis: np.ndarray, world: bool = False) -> float:
        bot, link = carrying(solid)
        here = where(bot, bot.neutral, link)
        direction = axis if world else here.rotation @ axis
        pose, velocity = here * pin.SE3(np.eye(3), step), np.concatenate([direction, np.zeros(3)])
        return float(probe(Obstacle(other), bot)(bot.neutral, pose=pose, velocity=velocity)[2][0])

    x, _, z = np.eye(3)
    assert rate(Sphere(0.1), Sphere(0.1), np.zeros(3), -z, world=True) == pytest.approx(1.0)
    assert rate(Sphere(0.1), Capsule(0.1, 0.2), np.zeros(3), x) == pytest.approx(1.0)
    assert rate(Capsule(0.1, 0.2), Sphere(0.1), 0.05 * z, -x) == pytest.approx(1.0)
    assert rate(Capsule(0.1, 0.2), Capsule(0.1, 0.2), np.zeros(3), x) == pytest.approx(1.0)
    assert rate(Sphere(0.1), Box((0.3, 0.2, 0.2)), -0.01 * z, -z) == pytest.approx(1.0)
    assert rate(Sphere(0.1), Box((0.3, 0.2, 0.2)), 0.01 * z, z) == pytest.approx(1.0)
    assert rate(Sphere(0.1), Cylinder(0.2, 0.2), -0.01 * z, -z) == pytest.approx(1.0)
    assert rate(Sphere(0.1), Cylinder(0.1, 0.4), -0.01 * x, -x) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("shape", "axis"),
    [
        (Box((0.3, 0.2, 0.2)), 1),
        (Box((0.2, 0.2, 0.2)), 0),
        (Box((0.3, 0.3, 0.2)), 2),
        (Cylinder(0.2, 0.4), 2),
        (Cylinder(0.2, 0.5), 0),
    ],
)
def test_way_out_of_the_very_middle(shape: Box | Cylinder, axis: int) -> None:
    """The nearest face, of equals the first of x, y, z or the end of a cylinder; on the positive side."""
    point = ca.SX.sym("point", 3)
    formula = out_of_box(point, shape) if isinstance(shape, Box) else out_of_cylinder(point, shape)
    distance, direction = ca.Function("out", [point], list(formula))(np.zeros(3))
    size = shape.size[axis] / 2 if isinstance(shape, Box) else 0.2
    assert float(distance) == pytest.approx(-size)
    np.testing.assert_array_equal(np.array(direction)[:, 0], np.eye(3)[axis])


def between_in_a_plane(first: list[np.ndarray], second: list[np.ndarray]) -> float:
    """Distance of two segments in a plane that do not cross: one of their ends is nearest."""
    out = []
    for points, (start, end) in ((first, second), (second, first)):
        along = (end - start) / np.linalg.norm(end - start)
        for point in points:
            t = np.clip(along @ (point - start), 0.0, np.linalg.norm(end - start))
            out.append(np.linalg.norm(point - start - t * along))
    return float(min(out))


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2])
def test_nearly_parallel_capsules(angle: float) -> None:
    """The distance is off by less than PARALLEL length^2 / distance, however small the angle; Coal is off by more."""
    length = 0.3
    bot, link = carrying(Capsule(0.02, length))
    clear, q = probe(Obstacle(Capsule(0.02, length)), bot), bot.neutral
    here = where(bot, q, link)
    for slide, turn in itertools.product((0.0, 0.1, 0.29), (-1.0, 1.0)):
        pose = here * pin.SE3(pin.exp3(np.array([0.0, turn * angle, 0.0])), np.array([0.1, 0.0, slide]))
        h = float(clear(q, pose=pose)[0][0])
        truth = between_in_a_plane(ends(here, length), ends(pose, length)) - 0.04
        assert -2e-10 < h - truth < gap.PARALLEL * length**2 / 0.1
