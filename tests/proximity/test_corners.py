"""Rows for corners: what they measure, by Coal; that they forbid nothing; where there are none."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.distances import coal_distance
from tests.evaluation import random_configuration
from tests.models import Y, arm
from tests.proximity.world import Referee, buffers, link_bodies, place, robot, set_pose, things
from wbc.errors import RangeError
from wbc.proximity import FAR, OBSTACLE, Body, PairSensor
from wbc.robot import Robot
from wbc.shapes import Box, Capsule, Convex, Cylinder, HalfSpace, Sphere
from wbc.shapes.convex import CORNERS as HULL_CORNERS, spread

CORNERS = 4


def made(
    bot: Robot, pairs: list[tuple[Body, Body]], count: int, margin: float = 0.0, corners: int = CORNERS
) -> tuple[PairSensor, dict[str, np.ndarray]]:
    numbers = buffers(bot, count * (1 + corners)) | {"margin": np.array([margin])}
    return PairSensor(bot, pairs, count, numbers, corners=corners), numbers


def rows_of(bot: Robot, numbers: dict[str, np.ndarray], q: np.ndarray) -> np.ndarray:
    count = len(numbers["distance"])
    screws = pin.computeJointJacobians(bot.model, bot.model.createData(), q).reshape(6, -1)
    return np.asarray(numbers["side"].reshape(count, -1) * (numbers["line"].reshape(count, 6) @ screws))


def truths(referee: Referee, pair: tuple[Body, Body], q: np.ndarray, pose: pin.SE3) -> np.ndarray:
    """Distances by Coal of the corners of each body, as balls, from the other body, sorted."""
    pin.framesForwardKinematics(referee.bot.model, referee.data, q)
    out = []
    for own, other in (pair, pair[::-1]):
        if isinstance(other.shape, Convex):
            continue
        center = own.shape.points.mean(axis=0) if isinstance(own.shape, Convex) else np.zeros(3)
        ball = own.shape.radius if isinstance(own.shape, Capsule) else 0.0
        where, there = referee.pose(own, pose), referee.pose(other, pose)
        for corner in own.shape.row_corners():
            at = pin.SE3(np.eye(3), where.act(corner + center))
            out.append(coal_distance(Sphere(ball), at, other.shape, there, 1e-10))
    return np.sort(np.array(out))


@pytest.mark.parametrize("name", ["panda", "talos"])
def test_corners_are_measured_as_coal_says(name: str) -> None:
    """The nearest corners, for all pairs of shapes; none is nearer than the bodies themselves."""
    bot, rng = robot(name), np.random.default_rng(30)
    links, others = link_bodies(bot, rng), things(rng)
    pairs = [(a, b) for a in links for b in others] + [(b, a) for a in links for b in others]
    sensing, numbers = made(bot, pairs, len(pairs), margin=10.0)
    referee, compared = Referee(bot), 0
    for _ in range(2):
        q, pose = random_configuration(bot, rng), place(rng, 0.4)
        set_pose(numbers, pose)
        sensing.sense(q)
        main, more = numbers["distance"][: len(pairs)], numbers["distance"][len(pairs) :].reshape(-1, CORNERS)
        for k, pair in enumerate(pairs):
            truth = truths(referee, pair, q, pose)
            if main[k] < 1e-3 or not len(truth):
                continue
            found = np.sort(more[k][more[k] < FAR / 2])
            assert len(found) == min(CORNERS, len(truth))
            assert found == pytest.approx(truth[: len(found)], abs=2e-5)
            assert found.min() > main[k] - 4e-6, "nothing is asked for but the distance"
            compared += 1
    assert compared > 60


def test_rows_are_the_derivatives_of_the_corners_distances() -> None:
    """Corner by corner, against central differences, with what moves by itself."""
    bot, rng, step = robot("ur5"), np.random.default_rng(31), 1e-6
    links, others = link_bodies(bot, rng), things(rng)
    pairs = [(a, b) for a in links[1:] for b in others]
    sensing, numbers = made(bot, pairs, len(pairs), margin=10.0)
    checked = moving = 0
    for _ in range(3):
        q, v = random_configuration(bot, rng), rng.uniform(-1, 1, bot.nv)
        pose, twist = place(rng, 0.4), rng.uniform(-1, 1, 6)
        found = []
        for t in (-step, 0.0, step):
            set_pose(numbers, pin.SE3(pin.exp3(t * twist[3:]) @ pose.rotation, pose.translation + t * twist[:3]))
            numbers["velocity"][:] = twist
            sensing.sense(pin.integrate(bot.model, q, t * v))
            rate = rows_of(bot, numbers, pin.integrate(bot.model, q, t * v)) @ v + numbers["drift"]
            found.append((numbers["distance"].copy(), rate, numbers["drift"].copy()))
        (before, _, _), (here, rate, drift), (after, _, _) = found
        smooth = np.abs(after - 2 * here + before) < 1e-9
        use = (np.arange(len(here)) >= len(pairs)) & (here < 10.0) & (here > 1e-3) & smooth
        assert rate[use] == pytest.approx((after - before)[use] / (2 * step), abs=1e-3)
        checked, moving = checked + use.sum(), moving + np.count_nonzero(drift[use])
    assert checked > 200
    assert moving > 20


def test_a_slab_on_a_hinge_has_a_row_for_each_edge() -> None:
    """Tilted by 1e-6 rad, its nearest point is on one edge; the other edge, 20 cm away, has rows of its own."""
    bot, slab = arm("hinge", [(Y, (0.0, 0.0, 0.0))]), Box((0.2, 0.2, 0.02))
    table = Body("table", "world", pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.12])), Box((0.3, 0.3, 0.02)))
    sensing, numbers = made(bot, [(table, Body("slab", "F1", pin.SE3.Identity(), slab))], 1, margin=0.1)
    for tilt in (-1e-6, 0.0, 1e-6):
        sensing.sense(np.array([tilt]))
        rows = rows_of(bot, numbers, np.array([tilt]))[1:, 0]
        assert np.sort(rows) == pytest.approx([-0.1, -0.1, 0.1, 0.1], abs=1e-4)
        assert numbers["distance"][1:] == pytest.approx(np.full(4, 0.1), abs=1e-6)


def test_a_rod_of_many_corners_has_rows_at_both_of_its_ends() -> None:
    """Of corners beside each other one has a row, so that the higher end has some, over a half-space."""
    bot, turns = arm("hinge", [(Y, (0.0, 0.0, 0.0))]), np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    ring = 0.01 * np.stack([np.zeros(12), np.cos(turns), np.sin(turns)], axis=1)
    rod = Convex(np.concatenate([ring + np.array([x, 0.0, 0.0]) for x in (-0.1, 0.1)]))
    ground = Body("ground", "world", pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.05])), HalfSpace())
    sensing, numbers = made(bot, [(ground, Body("rod", "F1", pin.SE3.Identity(), rod))], 1, margin=0.1)
    for tilt in (-1e-2, 1e-2):
        sensing.sense(np.array([tilt]))
        near = numbers["distance"][1:] < FAR
        rows = rows_of(bot, numbers, np.array([tilt]))[1:, 0][near]
        assert (np.sign(rows).min(), np.sign(rows).max()) == (-1.0, 1.0)
        assert numbers["distance"][1:][near].min() == pytest.approx(numbers["distance"][0], abs=1e-12)


def test_pairs_that_are_far_have_no_such_rows() -> None:
    bot = arm("hinge", [(Y, (0.0, 0.0, 0.0))])
    ball, slab = Sphere(0.05), Body("slab", "F1", pin.SE3.Identity(), Box((0.2, 0.2, 0.02)))
    there = Body("ball", "obstacle", pin.SE3.Identity(), ball)
    sensing, numbers = made(bot, [(slab, there)], 1)
    for height, corners in ((0.07, 4), (3.0, 0), (0.08, 4)):
        set_pose(numbers, pin.SE3(np.eye(3), np.array([0.0, 0.0, height])))
        sensing.sense(np.zeros(1))
        assert np.count_nonzero(numbers["distance"][1:] < FAR) == corners
        assert numbers["line"][6:].reshape(4, 6).any(axis=1).sum() == corners
    sensing.reset()
    assert set(numbers["distance"]) == {FAR}
    assert not numbers["line"].any()
    assert not numbers["side"].any()


def test_balls_have_no_corners_and_overlaps_no_normals() -> None:
    """Two balls; a corner that is inside the other body; hulls against hulls: far, and never NaN."""
    bot = arm("hinge", [(Y, (0.0, 0.0, 0.0))])
    here = pin.SE3.Identity()
    hull = Convex(0.1 * np.vstack([np.eye(3), -np.eye(3)]))
    box = Box((0.1, 0.1, 0.1))
    for own, other in ((Sphere(0.1), Sphere(0.05)), (box, Box((1.0, 1.0, 1.0))), (hull, hull)):
        pair = (Body("own", "F1", here, own), Body("other", "world", here, other))
        sensing, numbers = made(bot, [pair], 1)
        sensing.sense(np.zeros(1))
        assert np.isfinite(numbers["line"]).all()
        if not (isinstance(own, Box) and isinstance(other, Box)):
            assert set(numbers["distance"][1:]) == {FAR}


def test_corners_of_shapes() -> None:
    assert len(Box((0.1, 0.2, 0.3)).row_corners()) == 8
    assert Capsule(0.1, 0.4).row_corners() == pytest.approx(np.array([[0, 0, -0.2], [0, 0, 0.2]]))
    rim = Cylinder(0.1, 0.4).row_corners()
    assert np.hypot(rim[:, 0], rim[:, 1]) == pytest.approx(np.full(len(rim), 0.1))
    assert len(Sphere(0.1).row_corners()) == len(HalfSpace().row_corners()) == 0
    points = np.random.default_rng(3).normal(size=(60, 3))
    chosen = spread(points, HULL_CORNERS)
    assert len(chosen) == HULL_CORNERS
    assert all(np.linalg.norm(points - p, axis=1).min() == 0.0 for p in chosen)
    assert len(spread(points[:5], HULL_CORNERS)) == 5


@pytest.mark.parametrize("corners", [-1, 1.5, True, None])
def test_bad_numbers_of_corners(corners: object) -> None:
    bot = robot("panda")
    hand = Body("hand", "panda_hand", pin.SE3.Identity(), Sphere(0.1))
    block = Body("block", "world", pin.SE3.Identity(), Box((0.1, 0.1, 0.1)))
    with pytest.raises(RangeError, match="corners"):
        PairSensor(bot, [(hand, block)], 1, buffers(bot, 1), corners=corners)  # type: ignore[arg-type]


def test_a_hull_of_many_corners_has_rows_where_it_rolls_to() -> None:
    """The lowest of its points above a half-space after tilts by 0.1 rad in four directions, by numpy."""
    bot, rng = robot("ur5"), np.random.default_rng(36)
    ways = rng.normal(size=(300, 3))
    hull = Convex(ways / np.linalg.norm(ways, axis=1, keepdims=True) * (0.02, 0.03, 0.06))
    body = Body("hull", "wrist_3_link", pin.SE3.Identity(), hull)
    sensing, numbers = made(bot, [(body, Body("ground", OBSTACLE, pin.SE3.Identity(), HalfSpace()))], 1, margin=10.0)
    referee = Referee(bot)
    for _ in range(10):
        q, pose = random_configuration(bot, rng), place(rng, 0.4)
        set_pose(numbers, pose)
        sensing.sense(q)
        pin.framesForwardKinematics(bot.model, referee.data, q)
        there = pose.actInv(referee.pose(body, pose))
        points = hull.points @ there.rotation.T + there.translation
        ways = np.pi * (np.arange(4) + 0.5) / 2.0
        tilts = np.column_stack([-0.1 * np.cos(ways), -0.1 * np.sin(ways), np.ones(4)])
        lowest = np.unique(np.argmin(points @ tilts.T, axis=0))
        found = numbers["distance"][1:]
        assert np.sort(found[found < FAR / 2]) == pytest.approx(np.sort(points[lowest, 2]), abs=1e-9)
