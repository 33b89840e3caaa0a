"""Obstacle: margins against Coal, derivatives against differences, moving obstacles, curvature, bad declarations."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

from tests.constraints.robots import NAMES, robot
from tests.evaluation import numeric_jacobian, probe, random_configuration
from wbc.errors import DuplicateNameError, MissingShapeError, NotFiniteError, RangeError, ShapeError, UnknownNameError
from wbc.robot import Robot
from wbc.shapes import Box, Capsule, Convex, Cylinder, HalfSpace, PlacedShape, Shape, Sphere
from wbc.tasks.obstacle import Obstacle

OBSTACLES = [Sphere(0.15), HalfSpace()]


def coal_shape(shape: Shape) -> object:
    if isinstance(shape, Sphere):
        return coal.Sphere(shape.radius)
    if isinstance(shape, Capsule):
        return coal.Capsule(shape.radius, shape.length)
    if isinstance(shape, Box):
        return coal.Box(*shape.size)
    if isinstance(shape, Cylinder):
        return coal.Cylinder(shape.radius, shape.length)
    if isinstance(shape, Convex):
        points = coal.StdVec_Vec3s()
        points.extend(shape.points)
        return coal.Convex.convexHull(points, True, "Qt")
    return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)


def coal_pose(pose: pin.SE3) -> object:
    return coal.Transform3s(pose.rotation, pose.translation)


def coal_distance(bot: Robot, q: np.ndarray, link: str, placed: PlacedShape, shape: object, pose: pin.SE3) -> float:
    data = bot.model.createData()
    pin.framesForwardKinematics(bot.model, data, q)
    where = data.oMf[bot.model.getFrameId(link)] * placed.placement
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    request.enable_signed_distance = True
    return coal.distance(
        coal_shape(placed.shape), coal_pose(where), coal_shape(shape), coal_pose(pose), request, result
    )


def random_pose(rng: np.random.Generator) -> pin.SE3:
    return pin.SE3(pin.exp3(rng.uniform(-2, 2, 3)), rng.uniform(-0.8, 0.8, 3))


def pose_near(bot: Robot, q: np.ndarray, rng: np.random.Generator) -> pin.SE3:
    """A pose about a decimetre from one of the links with shapes."""
    data = bot.model.createData()
    pin.framesForwardKinematics(bot.model, data, q)
    link = data.oMf[bot.model.getFrameId(str(rng.choice(list(bot.shapes))))]
    return pin.SE3(random_pose(rng).rotation, link.translation + rng.normal(0.0, 0.1, 3))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("shape", OBSTACLES, ids=lambda s: type(s).__name__)
def test_margins_are_those_of_coal(name: str, shape: Sphere | HalfSpace) -> None:
    bot, rng = robot(name), np.random.default_rng(11)
    item = Obstacle(shape)
    clear = probe(item, bot)
    links = np.array([label.split(".")[0] for label in (r.label for r in item.rows(bot))])
    inside = 0
    for k in range(20):
        q, margin = random_configuration(bot, rng), rng.uniform(0.0, 0.05)
        pose = random_pose(rng) if k % 2 else pose_near(bot, q, rng)
        h = clear(q, pose=pose, margin=margin)[0]
        for link, k, placed in item.pairs(bot):
            truth = coal_distance(bot, q, link, placed, shape, pose) - margin
            # A capsule over a half-space has a row for each end; the lower one is its distance
            assert h[links == f"{link}[{k}]"].min() == pytest.approx(truth, abs=1e-9)
            inside += truth < 0
    assert inside > 5, "overlapping pairs are among the tests"


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("shape", OBSTACLES, ids=lambda s: type(s).__name__)
def test_derivative_along_the_tangent_space(name: str, shape: Sphere | HalfSpace) -> None:
    bot, rng = robot(name), np.random.default_rng(12)
    clear = probe(Obstacle(shape), bot)
    for _ in range(3):
        q, pose = random_configuration(bot, rng), random_pose(rng)
        numeric = numeric_jacobian(bot, q, lambda x, at=pose: clear(x, pose=at)[0])
        assert clear(q, pose=pose)[1] == pytest.approx(numeric, abs=1e-7)


@pytest.mark.parametrize("shape", OBSTACLES, ids=lambda s: type(s).__name__)
def test_drift_of_a_moving_obstacle(shape: Sphere | HalfSpace) -> None:
    bot, rng = robot("ur5"), np.random.default_rng(13)
    clear = probe(Obstacle(shape), bot)
    for _ in range(10):
        q, pose, twist = random_configuration(bot, rng), random_pose(rng), rng.uniform(-1, 1, 6)

        def after(t: float, at: pin.SE3 = pose, speed: np.ndarray = twist) -> pin.SE3:
            return pin.SE3(pin.exp3(speed[3:] * t) @ at.rotation, at.translation + speed[:3] * t)

        step = 1e-5
        change = (clear(q, pose=after(step))[0] - clear(q, pose=after(-step))[0]) / (2 * step)
        assert clear(q, pose=pose, velocity=twist)[2] == pytest.approx(change, abs=1e-7)


@pytest.mark.parametrize("place", ["center", "end", "beside", "just past the guard"])
def test_no_direction_is_no_number_at_coincident_centres(place: str) -> None:
    """Obstacle centre on the core of a link shape: finite h and a unit direction, so that the robot can leave."""
    bot = robot("panda")
    link, q = "panda_hand", bot.neutral
    rod = PlacedShape(Capsule(0.05, 0.2), pin.SE3(pin.exp3(np.array([1.0, 0.0, 0.0])), np.array([0.0, 0.1, 0.0])))
    ball = PlacedShape(Sphere(0.05), pin.SE3.Identity())
    bot = bot.with_shapes({link: (rod, ball)})
    clear = probe(Obstacle(Sphere(0.1), links=link), bot)
    data = bot.model.createData()
    pin.framesForwardKinematics(bot.model, data, q)
    here = data.oMf[bot.model.getFrameId(link)]
    for row, placed in enumerate((rod, ball)):
        offset = {
            "center": placed.placement.translation,
            "end": placed.ends()[1],
            "beside": placed.placement.translation - np.array([0.0, 0.0, 2e-10]),
            "just past the guard": placed.placement.translation + np.array([2e-10, 0.0, 0.0]),
        }[place]
        h, jacobian, _ = clear(q, pose=pin.SE3(np.eye(3), here.act(offset)))
        assert h[row] == pytest.approx(-placed.shape.radius - 0.1, abs=1e-9)
        assert np.isfinite(jacobian).all()
        assert np.linalg.norm(jacobian[row]) > 1e-3


def test_gradient_is_continuous_where_the_nearest_point_reaches_an_end() -> None:
    bot, q = robot("panda"), robot("panda").neutral
    rod = PlacedShape(Capsule(0.05, 0.2), pin.SE3.Identity())
    bot = bot.with_shapes({"panda_hand": (rod,)})
    clear = probe(Obstacle(Sphere(0.1)), bot)
    data = bot.model.createData()
    pin.framesForwardKinematics(bot.model, data, q)
    here = data.oMf[bot.model.getFrameId("panda_hand")]
    rows = [
        clear(q, pose=pin.SE3(np.eye(3), here.act(np.array([0.3, 0.0, 0.1 + step]))))[1] for step in (-1e-9, 0.0, 1e-9)
    ]
    assert rows[0] == pytest.approx(rows[1], abs=1e-8)
    assert rows[2] == pytest.approx(rows[1], abs=1e-8)


def test_curvature_left_out_by_one_tick_is_second_order() -> None:
    """h(q + v dt) - h - dt dh/dq v at full joint speed: at least -(1/2) rho w^2 dt^2, and growing as dt^2."""
    bot, rng = robot("panda"), np.random.default_rng(17)
    clear = probe(Obstacle(Sphere(0.1)), bot)
    worst = {}
    for dt in (0.005, 0.01):
        worst[dt] = 0.0
        for _ in range(300):
            q, pose = random_configuration(bot, rng), random_pose(rng)
            v = bot.limits.velocity * rng.choice([-1.0, 1.0], bot.nv)
            h, jacobian, _ = clear(q, pose=pose)
            later = clear(pin.integrate(bot.model, q, v * dt), pose=pose)[0]
            away = h > 0.02
            missing = np.max((h + dt * jacobian @ v - later)[away], initial=0.0)
            worst[dt] = max(worst[dt], missing)
            reach, turn = 1.2, np.abs(v).sum()
            assert missing <= 0.5 * reach * turn**2 * dt**2
    assert 0.0 < worst[0.005] < 3e-3
    assert worst[0.01] > 2 * worst[0.005]


def test_labels_and_units() -> None:
    bot = robot("panda").with_shapes(
        {
            "panda_link0": (PlacedShape(Sphere(0.1), pin.SE3.Identity()),),
            "panda_hand": (
                PlacedShape(Sphere(0.1), pin.SE3.Identity()),
                PlacedShape(Capsule(0.1, 0.2), pin.SE3.Identity()),
                PlacedShape(Capsule(0.1, 0.0), pin.SE3.Identity()),
            ),
        }
    )
    labels = [r.label for r in Obstacle(Sphere(0.1)).rows(bot)]
    assert labels == ["panda_hand[0]", "panda_hand[1]", "panda_hand[2]"], "the fixed base cannot keep clear"
    labels = [r.label for r in Obstacle(HalfSpace()).rows(bot)]
    assert labels == ["panda_hand[0]", "panda_hand[1].start", "panda_hand[1].end", "panda_hand[2]"]
    assert {r.unit for r in Obstacle(HalfSpace()).rows(bot)} == {"m"}


def test_bad_declarations() -> None:
    bot = robot("panda")
    shaped = next(iter(bot.shapes))
    for shape in ("ball", PlacedShape(Sphere(0.1), pin.SE3.Identity()), [], [Sphere(0.1)]):
        with pytest.raises(ShapeError, match=r"Obstacle\.shape.*valid: Sphere, Capsule, Box"):
            Obstacle(shape)  # type: ignore[arg-type]
    for count in (0, 1.5, True, float("inf")):
        with pytest.raises((RangeError, NotFiniteError), match=r"Obstacle\.closest"):
            Obstacle(Sphere(0.1), closest=count)  # type: ignore[arg-type]
    with pytest.raises(RangeError, match=r"Obstacle\.margin"):
        Obstacle(Sphere(0.1), margin=-0.01)
    with pytest.raises(DuplicateNameError, match=r"Obstacle\.links"):
        Obstacle(Sphere(0.1), links=("a", "a"))
    with pytest.raises(ShapeError, match=r"Obstacle\.pose"):
        Obstacle(Sphere(0.1), pose=np.zeros(3))  # type: ignore[arg-type]
    with pytest.raises(UnknownNameError, match=shaped):
        Obstacle(Sphere(0.1), links=shaped + "x").validate(bot)
    bare = next(n for n in bot.frame_names if n.startswith("panda_link") and n not in bot.shapes)
    with pytest.raises(MissingShapeError, match=f"{bare}.*valid: ") as caught:
        Obstacle(Sphere(0.1), links=(shaped, bare)).validate(bot)
    assert set(caught.value.choices) == set(bot.shapes)
    with pytest.raises(MissingShapeError, match="no moving link"):
        Obstacle(Sphere(0.1)).validate(bot.with_shapes({}))
    fixed = bot.with_shapes({"panda_link0": (PlacedShape(Sphere(0.1), pin.SE3.Identity()),)})
    with pytest.raises(RangeError, match="no joint moves"):
        Obstacle(Sphere(0.1), links="panda_link0").validate(fixed)


def test_declaration_is_plain_data() -> None:
    bot = robot("panda")
    here = Obstacle(Sphere(0.1), pose=pin.SE3.Identity()).declaration(bot)
    assert here != Obstacle(Sphere(0.1)).declaration(bot)
    assert here != Obstacle(Sphere(0.2), pose=pin.SE3.Identity()).declaration(bot)
    assert here == Obstacle(Sphere(0.1), pose=pin.SE3.Identity()).declaration(bot)
