"""Pairs of links that must not touch: neighbours, SRDF rules, sampling and descents, against Coal and closed forms."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests import models
from tests.distances import coal_distance
from tests.refusals import assert_refused
from wbc.errors import MissingShapeError, NotFiniteError, RangeError, RobotFileError, ShapeError
from wbc.robot import Limits, Robot
from wbc.robot.pairs.collision_pairs import REASONS, find_self_pairs
from wbc.robot.pairs.descent import Descent
from wbc.robot.pairs.distances import Links
from wbc.robot.sampling import configuration, draw
from wbc.shapes import Box, Capsule, Convex, Cylinder, PlacedShape, Solid, Sphere

HERE = pin.SE3.Identity()


def with_balls(robot: Robot, radii: dict[str, float]) -> Robot:
    """A copy with one sphere about the origin of each named frame."""
    return robot.with_shapes({link: [PlacedShape(Sphere(r), HERE)] for link, r in radii.items()})


@pytest.mark.parametrize(
    "shape",
    [
        Sphere(0.2),
        Capsule(0.1, 0.4),
        Box((0.3, 0.1, 0.5)),
        Box((0.4, 0.4, 0.1)),
        Cylinder(0.3, 0.2),
        Convex(np.random.default_rng(5).normal(size=(40, 3)) * [0.3, 0.1, 0.2]),
    ],
    ids=repr,
)
def test_bounding_capsules_contain_their_shapes(shape: Solid) -> None:
    place = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.7, 1.1), np.array([0.1, 0.2, -0.3]))
    a, b, radius = PlacedShape(shape, place).capsule()
    corners = {
        Box: lambda s: np.array(list(itertools.product(*[(-x / 2, x / 2) for x in s.size]))),
        Convex: lambda s: s.points,
        Cylinder: lambda s: np.array(
            [
                (s.radius * np.cos(t), s.radius * np.sin(t), z)
                for t in np.linspace(0, 6.3, 90)
                for z in (-s.length / 2, s.length / 2)
            ]
        ),
    }.get(type(shape), lambda s: np.zeros((1, 3)))(shape)
    for corner in corners:
        point = place * corner
        t = np.clip((point - a) @ (b - a) / max((b - a) @ (b - a), 1e-300), 0, 1)
        assert np.linalg.norm(point - a - t * (b - a)) <= radius + 1e-9
    if isinstance(shape, (Sphere, Capsule)):
        assert radius == shape.radius


def test_broad_and_narrow_phase_agree_with_coal_on_every_sample() -> None:
    robot = wbc.robots.load("ur5", shapes="none")
    robot = robot.with_shapes(
        {
            "shoulder_link": [
                PlacedShape(Capsule(0.08, 0.2), HERE),
                PlacedShape(Sphere(0.1), pin.SE3(np.eye(3), np.ones(3) / 9)),
            ],
            "forearm_link": [PlacedShape(Capsule(0.05, 0.4), pin.SE3(pin.rpy.rpyToMatrix(1, 2, 3), np.zeros(3)))],
            "wrist_2_link": [PlacedShape(Box((0.1, 0.2, 0.15)), HERE)],
            "ee_link": [PlacedShape(Cylinder(0.05, 0.3), HERE)],
        }
    )
    links, steps = Links(robot), draw(robot, 200, np.random.default_rng(0))
    scenes, data = links.place(steps), robot.model.createData()
    for first, second in itertools.combinations(robot.shapes, 2):
        bounds = scenes.bounds(first, second)
        for n, step in enumerate(steps):
            pin.framesForwardKinematics(robot.model, data, configuration(robot, step))
            least = np.inf
            for a, b in itertools.product(robot.shapes[first], robot.shapes[second]):
                where = [data.oMf[robot.model.getFrameId(k)] * s.placement for k, s in ((first, a), (second, b))]
                least = min(least, coal_distance(a.shape, where[0], b.shape, where[1], 1e-9))
            assert scenes.distance(first, second, n) == pytest.approx(least, abs=1e-6)
            assert bounds[n] <= least + 1e-6
            if links.is_exact(first, second):
                assert bounds[n] == pytest.approx(least, abs=1e-6)


def test_welded_links_and_joints_that_share_an_origin() -> None:
    panda = wbc.robots.load("panda")
    reasons = {pair.links: pair.reason for pair in find_self_pairs(panda, samples=0).pairs}
    assert reasons["panda_link7", "panda_hand"] == "same body"
    assert reasons["panda_leftfinger", "panda_rightfinger"] == "same body"  # locked
    assert reasons["panda_link6", "panda_hand"] == "adjacent"  # across joint 7, hand welded to link 7
    assert reasons["panda_link5", "panda_hand"] == "unsampled"
    free = wbc.robots.load("panda", lock=())
    reasons = {pair.links: pair.reason for pair in find_self_pairs(free, samples=0).pairs}
    assert reasons["panda_hand", "panda_leftfinger"] == "adjacent"
    assert reasons["panda_leftfinger", "panda_rightfinger"] != "same body"
    # The shoulder of this arm is three joints at one point, the wrist too
    arm = models.spherical_seven()
    reasons = {
        pair.links: pair.reason
        for pair in find_self_pairs(with_balls(arm, {"F1": 0.1, "F3": 0.1, "F4": 0.1, "F7": 0.1}), samples=0).pairs
    }
    assert reasons["F1", "F3"] == "adjacent"
    assert reasons["F4", "F7"] == "adjacent"
    assert reasons["F1", "F4"] == "unsampled"  # the elbow stands off the shoulder
    (pair,) = find_self_pairs(with_balls(arm, {"F1": 0.1, "F4": 0.1}), samples=0).pairs
    assert pair.reason == "unsampled"


def planar(limit: float) -> Robot:
    """Upper arm 1 m, forearm 0.8 m, elbow within +-limit."""
    arm = models.arm("planar", [((0, 1, 0), (1.0, 0, 0)), ((0, 1, 0), (0.8, 0, 0)), ((0, 1, 0), (0.3, 0, 0))])
    bound = np.array([3.0, limit, 0.5])
    none = np.full(3, np.inf)
    return Robot("planar", arm.model, Limits(-bound, bound, none, none, none), neutral=arm.neutral)


def test_least_distance_is_the_closed_form() -> None:
    # Distance of shoulder and wrist: the law of cosines at the elbow's limit
    for limit in (1.0, 2.0, 2.7):
        robot = with_balls(planar(limit), {"F1": 0.1, "F3": 0.2})
        (pair,) = find_self_pairs(robot, samples=50).pairs
        wanted = np.sqrt(1 + 0.64 + 1.6 * np.cos(limit)) - 0.3
        assert pair.distance == pytest.approx(wanted, abs=1e-4)
        assert (pair.keep, pair.reason) == (False, "never")


def test_descents_find_touch_that_samples_miss() -> None:
    # Touches only in the last 0.01 rad of the elbow's 5.8: one sample in 300 or so
    limit = 2.9
    reach = np.sqrt(1 + 0.64 + 1.6 * np.cos(limit - 0.01))
    robot = with_balls(planar(limit), {"F1": reach / 2, "F3": reach / 2})
    elbow = draw(robot, 20, np.random.default_rng(0))[:, 1]
    assert np.abs(elbow).max() < limit - 0.01
    (pair,) = find_self_pairs(robot, samples=20).pairs
    assert (pair.keep, pair.reason) == (True, "touches")


@pytest.mark.parametrize(("name", "links"), [("ur5", ("upper_arm_link", "wrist_3_link")), ("panda", None)])
def test_gradient_of_the_distance(name: str, links: tuple[str, str] | None) -> None:
    robot = wbc.robots.load(name)
    first, second = links or ("panda_link1", "panda_hand")
    descent = Descent(robot, Links(robot), 0.0)
    for step in draw(robot, 10, np.random.default_rng(3)):
        _, gradient = descent._slope(first, second, step)
        h = 1e-6
        for k, slope in enumerate(gradient):
            ends = [descent._slope(first, second, step + sign * h * np.eye(robot.nv)[k])[0] for sign in (1, -1)]
            assert slope == pytest.approx((ends[0] - ends[1]) / (2 * h), abs=1e-4)


def test_reasons() -> None:
    robot = with_balls(planar(2.0), {"F1": 0.35, "F2": 0.05, "F3": 0.3, "tip": 0.05})
    found = {pair.links: pair for pair in find_self_pairs(robot, samples=300).pairs}
    assert found["F1", "F2"].reason == found["F2", "F3"].reason == "adjacent"
    assert found["F3", "tip"].reason == "same body"
    assert found["F1", "F3"].reason == "never"
    assert found["F1", "F3"].distance == pytest.approx(np.sqrt(1.64 + 1.6 * np.cos(2.0)) - 0.65, abs=1e-4)
    wide = with_balls(planar(2.0), {"F1": 1.0, "F3": 0.5, "tip": 0.2})
    found = {pair.links: pair for pair in find_self_pairs(wide, samples=300).pairs}
    assert found["F1", "F3"].reason == "touches"
    always = with_balls(planar(2.0), {"F1": 1.2, "F3": 0.9})
    (pair,) = find_self_pairs(always, samples=300).pairs
    assert (pair.keep, pair.reason) == (False, "always")
    bent = Robot("bent", robot.model, robot.limits, neutral=np.array([0.0, 2.0, 0.0]))
    (pair,) = find_self_pairs(with_balls(bent, {"F1": 0.6, "F3": 0.6}), samples=300).pairs
    assert (pair.keep, pair.reason) == (False, "neutral")
    (pair,) = find_self_pairs(with_balls(bent, {"F1": 0.6, "F3": 0.6}), samples=0).pairs
    assert (pair.keep, pair.reason) == (False, "neutral")
    near = find_self_pairs(with_balls(planar(2.0), {"F1": 0.35, "F3": 0.3}), samples=300, clearance=0.5).pairs
    assert near[0].reason == "touches"


def test_srdf_rules_and_their_order(tmp_path: Path) -> None:
    file = tmp_path / "r.srdf"
    file.write_text(
        '<robot name="r"><disable_default_collisions link="tip"/>'
        '<enable_collisions link1="tip" link2="F1"/><enable_collisions link1="F1" link2="F2"/>'
        '<enable_collisions link1="F2" link2="tip"/><disable_collisions link1="tip" link2="F2" reason="User"/>'
        '<disable_collisions link1="F3" link2="F1"/><disable_collisions link1="F1" link2="gone"/></robot>'
    )
    robot = with_balls(planar(2.0), dict.fromkeys(("F1", "F2", "F3", "tip"), 0.01))
    found = find_self_pairs(robot, srdf=file, samples=0)
    pairs = {pair.links: (pair.keep, pair.reason, pair.detail) for pair in found.pairs}
    assert pairs["F1", "F2"] == (True, "enabled", "")  # although they are adjacent
    assert pairs["F1", "tip"] == (True, "enabled", "")
    assert pairs["F2", "tip"] == (False, "adjacent", "")
    assert pairs["F1", "F3"] == (False, "srdf", "")
    assert pairs["F3", "tip"] == (False, "same body", "")
    assert found.unknown == ("gone",)
    sampled = find_self_pairs(robot, srdf=file, samples=100)
    assert sampled.kept == found.kept
    assert all(pair.distance is not None for pair in sampled.pairs)
    for text in ('<robot><disable_collisions link1="F1"/></robot>', "<sdf/>", "<robot>"):
        file.write_text(text)
        assert_refused(lambda: find_self_pairs(robot, srdf=file, samples=0), RobotFileError, "r.srdf")


def test_same_seed_same_pairs_and_progress_is_told() -> None:
    robot = wbc.robots.load("ur5")
    told: list[tuple[int, int]] = []
    first = wbc.robots.find_self_pairs(robot, samples=3000, progress=lambda done, total: told.append((done, total)))
    assert [done for done, _ in told] == list(range(1, len(told) + 1))
    assert {total for _, total in told} == {len(told)}
    assert wbc.robots.find_self_pairs(robot, samples=3000) == first
    assert set(first.counts()) <= set(REASONS)
    assert sum(first.counts().values()) == len(first.pairs) == 28


@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_stored_pairs_are_those_that_the_search_finds(name: str) -> None:
    robot = wbc.robots.load(name)
    found = wbc.robots.find_self_pairs(robot)
    assert robot.self_pairs == found.kept
    assert robot.notes["self_pairs"] == found.summary()


def test_loading_chooses_pairs_without_sampling() -> None:
    anymal = wbc.robots.load("anymal_b")
    assert anymal.self_pairs == wbc.robots.find_self_pairs(anymal, samples=0).kept
    assert "LH_HIP and RH_HIP" in anymal.notes["self_pairs"]  # they touch as it stands
    assert wbc.robots.load("ur5", shapes="none").self_pairs is None
    free = wbc.robots.load("panda", lock=())  # the stored pairs are for locked fingers
    assert free.self_pairs == wbc.robots.find_self_pairs(free, samples=0).kept


def test_pairs_are_chosen_for_the_links_that_have_shapes() -> None:
    robot = wbc.robots.load("ur5")
    grown = {link: [PlacedShape(Sphere(0.2), HERE)] for link in robot.shapes}
    assert robot.with_shapes(grown).self_pairs == robot.self_pairs
    fewer = robot.with_shapes({"ee_link": robot.shapes["ee_link"]})
    assert fewer.self_pairs is None


def test_bad_arguments() -> None:
    robot = wbc.robots.load("ur5")
    assert_refused(lambda: wbc.robots.find_self_pairs(wbc.robots.load("ur5", shapes="none")), MissingShapeError, "ur5")
    for key in ("samples", "seed"):
        with pytest.raises(RangeError, match=key):
            wbc.robots.find_self_pairs(robot, **{key: -1})
        for value in (1.5, True, "many"):
            with pytest.raises(ShapeError, match=key):
                wbc.robots.find_self_pairs(robot, **{key: value})
    assert_refused(lambda: wbc.robots.find_self_pairs(robot, srdf="gone.srdf"), RobotFileError, "gone.srdf")


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_distance_that_is_no_number_is_refused_by_name(monkeypatch: pytest.MonkeyPatch, value: float) -> None:
    """NaN is no less than another distance: the pair was the least of none, and had no normal."""
    robot = wbc.robots.load("panda", shapes="none")
    first, second = (PlacedShape(shape, HERE) for shape in (Box((0.1, 0.2, 0.3)), Cylinder(0.1, 0.2)))
    robot = robot.with_shapes({"panda_link1": [first], "panda_link5": [second]})
    monkeypatch.setattr("wbc.robot.pairs.distances.distances", lambda *_: np.full((1, 7), value))
    assert_refused(lambda: find_self_pairs(robot, samples=3), NotFiniteError, "'panda_link1' and 'panda_link5'")
