"""What the checker computes by itself, against Pinocchio, brute force and known bodies."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from tests.walking.honest import MACHINE, honest
from wbc.clearance import TriangleMesh
from wbc.robots import walker
from wbc.shapes import Box, Capsule, Cylinder, Sphere
from wbc.walking import CylinderSurface, Obstacle, PlaneSurface
from wbc.walking.checker import distances
from wbc.walking.checker.body import Hands, estimate, single
from wbc.walking.checker.check import check_walk
from wbc.walking.checker.holds import HoldTable, angles_between, rotations, turns_between
from wbc.walking.checker.rules import Rules
from wbc.walking.checker.samples import blocks
from wbc.walking.checker.urdf import forward, read_urdf

RNG = np.random.default_rng(6)


@pytest.mark.parametrize("two_ended", [False, True])
def test_placements_are_those_of_pinocchio(two_ended: bool, tmp_path: Path) -> None:
    machine = walker(two_ended=two_ended)
    path = machine.urdf(tmp_path / "robot.urdf")
    urdf, model = read_urdf(path), pin.buildModelFromUrdf(str(path))
    names = [str(name) for name in model.names[1:]]
    q, data = RNG.uniform(-2.0, 2.0, (5, len(names))), model.createData()
    found = forward(urdf, names, q)
    for k in range(5):
        pin.framesForwardKinematics(model, data, q[k])
        for link in urdf.links:
            placed = data.oMf[model.getFrameId(link, pin.FrameType.BODY)]
            np.testing.assert_allclose(found.rotation[link][k], placed.rotation, atol=1e-13)
            np.testing.assert_allclose(found.position[link][k], placed.translation, atol=1e-13)
    assert urdf.root == "body"
    for k, name in enumerate(names):
        joint = urdf.joint(name)
        assert (joint.lower, joint.upper) == (model.lowerPositionLimit[k], model.upperPositionLimit[k])
        assert joint.velocity == model.velocityLimit[k]
    capsules = [shape for group in machine.robot.shapes.values() for shape in group]
    assert len(urdf.capsules) == len(capsules)


def test_a_joint_turns_about_any_axis(tmp_path: Path) -> None:
    text = """<robot name="r"><link name="a"/><link name="b"><collision><origin xyz="0 0 1"/><geometry>
    <cylinder radius="0.1" length="2"/></geometry></collision></link><joint name="j" type="continuous">
    <parent link="a"/><child link="b"/><origin xyz="1 2 3" rpy="0.3 -0.4 2"/><axis xyz="1 -2 3"/></joint></robot>"""
    path = tmp_path / "r.urdf"
    path.write_text(text)
    urdf, q = read_urdf(path), np.array([[0.7], [-1.2]])
    found = forward(urdf, ["j"], q)
    origin, axis = pin.rpy.rpyToMatrix(0.3, -0.4, 2.0), np.array([1.0, -2.0, 3.0]) / np.sqrt(14.0)
    for k in range(2):
        np.testing.assert_allclose(found.rotation["b"][k], origin @ pin.exp3(q[k, 0] * axis), atol=1e-14)
        np.testing.assert_allclose(found.position["b"][k], [1, 2, 3], atol=1e-15)
    (capsule,) = urdf.capsules
    np.testing.assert_allclose([capsule.a, capsule.b], [[0, 0, 0], [0, 0, 2]], atol=1e-15)
    assert np.isinf(urdf.joint("j").velocity)


def test_neighbours_and_links_that_move_together(tmp_path: Path) -> None:
    urdf = read_urdf(MACHINE.urdf(tmp_path / "robot.urdf"))
    assert {tuple(sorted(pair)) for pair in urdf.neighbours()} == {
        pair
        for n in (1, 2, 3)
        for pair in (
            (f"arm{n}_link1", "body"),
            (f"arm{n}_link1", f"arm{n}_link2"),
            (f"arm{n}_link2", f"arm{n}_link4"),
            (f"arm{n}_link4", f"arm{n}_link6"),
        )
    }
    assert urdf.carried_with("arm2_hand") == ("arm2_link6", "arm2_hand")
    assert urdf.carried_with("body") == ("body", "arm1_base", "arm2_base", "arm3_base")


def brute(a: np.ndarray, b: np.ndarray, count: int = 150) -> np.ndarray:
    """Points on segments, [s, count, 3]."""
    return a[:, None] + np.linspace(0, 1, count)[None, :, None] * (b - a)[:, None]


def test_distances_are_those_of_many_points() -> None:
    a, b, c, d = RNG.normal(size=(4, 40, 3))
    # Among them points, parallel and crossing segments
    b[:3], d[3:6], d[6:9] = a[:3], c[3:6], c[6:9] + 2.0 * (b[6:9] - a[6:9])
    c[9], d[9] = a[9] - [0, 0, 1], b[9] + [0, 0, 1]
    found = distances.between_segments(a, b, c, d)
    grid = np.linalg.norm(brute(a, b)[:, :, None] - brute(c, d)[:, None], axis=3).min(axis=(1, 2))
    assert (found <= grid + 1e-12).all()
    np.testing.assert_allclose(found, grid, atol=0.03)
    place = pin.SE3.Random()
    corners = np.vstack([np.zeros(3), np.eye(3)])
    rock = TriangleMesh(corners[[[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]], solid=True)
    for shape in (Box((0.5, 1.0, 0.3)), Capsule(0.2, 0.9), Sphere(0.4), Cylinder(0.3, 0.8), rock):
        obstacle = Obstacle("o", shape, place)
        exact = distances.from_obstacle(obstacle, a, b)
        bound = distances.at_least(obstacle, a, b)
        assert (bound <= exact + 1e-9).all()
        if isinstance(shape, Box):
            assert (bound >= exact - np.linalg.norm(b - a, axis=1) / (2 * distances.PARTS) - 1e-9).all()
        grid = obstacle.distance(brute(a, b)).min(axis=1)
        if shape is rock:
            # A segment that enters a mesh is 0 away from it, however deep; a point inside has its depth
            exact, grid = np.maximum(exact, 0.0), np.maximum(grid, 0.0)
        assert (exact <= grid + 1e-9).all()
        np.testing.assert_allclose(exact, grid, atol=0.01)
    for surface in (PlaneSurface(place), CylinderSurface(place, 0.4)):
        exact, grid = distances.from_surface(surface, a, b), surface.height(brute(a, b)).min(axis=1)
        assert (exact <= grid + 1e-9).all()
        np.testing.assert_allclose(exact, grid, atol=0.01)
    rows, near = distances.nearest(c, a)
    every = np.linalg.norm(a[:, None] - c[None], axis=2)
    np.testing.assert_array_equal(rows, every.argmin(axis=1))
    np.testing.assert_allclose(near, every.min(axis=1), atol=1e-12)


def table(roll: str | int, tilt: float) -> HoldTable:
    return HoldTable.of(honest(roll, tilt)[0])


def test_what_hands_hardly_fix_stays_as_logged() -> None:
    holds = table("fixed", 0.05)
    # Two holds, almost upright on the line between them: that is how much their rolls fix the turn about it
    first = holds.rotation[0]
    lean = pin.exp3(1e-3 * np.array([1.0, 0.0, 0.0]))
    holds = replace(holds, rotation=np.stack([first, lean @ first, *holds.rotation[2:]]))
    body = pin.SE3(np.eye(3), np.array([0.3, -0.2, 1.2]))
    hold = np.array([[0, 1]])
    grips = [body.inverse() * pin.SE3(holds.rotation[k], holds.position[k]) for k in range(2)]
    # Hands turned in their holds by what a loop leaves
    grips[1] = grips[1] * pin.SE3(pin.exp3(np.array([0.0, 0.0, 4e-6])), np.zeros(3))
    hands = Hands(np.array([[grip.translation for grip in grips]]), np.array([[grip.rotation for grip in grips]]))
    found = estimate(hands, hold, np.ones((1, 2), dtype=bool), holds, body.translation[None], np.array([body.rotation]))
    assert np.linalg.norm(found.position[0] - body.translation) < 1e-4
    assert np.linalg.norm(pin.log3(body.rotation.T @ found.rotation[0])) < 1e-4


@pytest.mark.parametrize(("roll", "tilt"), [("free", 0.0), ("fixed", 0.0), (4, 0.0), ("free", 0.05)])
def test_the_body_follows_from_the_hands(roll: str | int, tilt: float) -> None:
    holds, count = table(roll, tilt), 20
    bodies = [pin.SE3(pin.exp3(RNG.normal(size=3) * 0.3), RNG.normal(size=3)) for _ in range(count)]
    # Hands on three holds, rolled where they may be, seen from the body
    poses = []
    for body in bodies:
        row = []
        for k in range(3):
            turn = RNG.uniform(-3, 3) if roll == "free" else 0.0 if roll == "fixed" else RNG.integers(4) * np.pi / 2
            lean = pin.utils.rotate("x", 0.5 * tilt)
            grip = pin.SE3(holds.rotation[k] @ pin.utils.rotate("z", float(turn)) @ lean, holds.position[k])
            row.append(body.inverse() * grip)
        poses.append(row)
    hands = Hands(
        np.array([[pose.translation for pose in row] for row in poses]),
        np.array([[pose.rotation for pose in row] for row in poses]),
    )
    hold = np.tile([0, 1, 2], (count, 1))
    start = [body * pin.exp6(np.r_[RNG.normal(size=3) * 0.02, RNG.normal(size=3) * 0.02]) for body in bodies]
    at = np.array([pose.translation for pose in start]), np.array([pose.rotation for pose in start])
    truth = np.array([body.translation for body in bodies]), np.array([body.rotation for body in bodies])
    found = estimate(hands, hold, np.ones((count, 3), dtype=bool), holds, *at)
    np.testing.assert_allclose(found.position, truth[0], atol=1e-8)
    np.testing.assert_allclose(found.rotation, truth[1], atol=1e-8)
    assert not found.open.any()
    # Two ball holds leave one freedom, one hand leaves its roll, none leaves all: there the start stays
    for arms, open_ in ((2, tilt > 0), (1, roll == "free"), (0, True)):
        held = np.tile(np.arange(3) < arms, (count, 1))
        part = estimate(hands, hold, held, holds, *at)
        assert part.open.all() == open_
        placed = hands.placed(part.position, part.rotation).position[held]
        np.testing.assert_allclose(placed, holds.position[hold[held]], atol=1e-7)
        if not open_:
            np.testing.assert_allclose(part.position, truth[0], atol=1e-7)
        if arms == 0:
            np.testing.assert_array_equal(part.rotation, at[1])
    if roll != "free":
        near = truth[1] @ hands.rotation[:, 1]
        position, rotation = single(hands.position[:, 1], hands.rotation[:, 1], holds, hold[:, 1], near)
        np.testing.assert_allclose(position, truth[0], atol=1e-12)
        np.testing.assert_allclose(rotation, truth[1], atol=1e-12)


def test_offsets_from_holds() -> None:
    holds = HoldTable(np.zeros((3, 3)), np.array([np.eye(3)] * 3), np.array([0, 1, 4]), np.array([0.0, 0.0, 0.1]))
    turns = [pin.utils.rotate("z", angle) @ pin.utils.rotate("x", 0.3) for angle in (1.0, 0.2, np.pi / 2 - 0.05)]
    distance, tilt, roll = holds.offsets(np.arange(3), np.array([[0.0, 3.0, 4.0]] * 3), np.array(turns))
    np.testing.assert_allclose(distance, [5.0, 5.0, 5.0])
    np.testing.assert_allclose(tilt, [0.3, 0.3, 0.2], atol=1e-15)
    np.testing.assert_allclose(roll, [0.0, 0.2, 0.05], atol=1e-15)


def test_angles_and_rotations() -> None:
    q = RNG.normal(size=(30, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    turns = rotations(q)
    np.testing.assert_allclose(turns, [pin.Quaternion(x).matrix() for x in q], atol=1e-14)
    angles = turns_between(turns[:-1], turns[1:])
    logs = [np.linalg.norm(pin.log3(a.T @ b)) for a, b in itertools.pairwise(turns)]
    np.testing.assert_allclose(angles, logs, atol=1e-9)
    x = np.array([1.0, 0.0, 0.0])
    small = np.array([np.cos(1e-7), np.sin(1e-7), 0.0])
    assert angles_between(x, small) == pytest.approx(1e-7, rel=1e-9)
    assert turns_between(np.eye(3), pin.utils.rotate("y", 1e-7)) == pytest.approx(1e-7, rel=1e-6)


def test_samples_cover_every_tick_once_and_what_is_between() -> None:
    log, _ = honest()
    parts = list(blocks(log, 3))
    assert sum(len(part) for part in parts) == 4 * len(log) - 3
    part = parts[0]
    np.testing.assert_array_equal(part.tick[part.starts], np.arange(len(log)))
    np.testing.assert_array_equal(part.q[part.starts], log.q)
    np.testing.assert_allclose(part.q[part.starts[7] + 1], 0.75 * log.q[7] + 0.25 * log.q[8], atol=1e-15)
    np.testing.assert_allclose(part.t[part.starts[7] + 2], log.t[7] + 0.005, atol=1e-15)
    np.testing.assert_array_equal(part.anchor[part.starts], np.arange(len(log)))


def test_least_clearances_leave_no_sample_out(tmp_path: Path) -> None:
    """What is skipped between ticks could not matter: the least of all samples is the same."""
    log, ground = honest()
    path, rules = MACHINE.urdf(tmp_path / "robot.urdf"), Rules(sub_samples=4)
    report, urdf = check_walk(log, path, ground, rules), read_urdf(path)
    (samples,) = blocks(log, 4)
    placements = forward(urdf, log.joints, samples.q)
    ends = [(c, placements.point(c.link, c.a), placements.point(c.link, c.b)) for c in urdf.capsules]
    least: dict[tuple[str, str], float] = {}
    for i, (one, a, b) in enumerate(ends):
        for two, c, d in ends[i + 1 :]:
            pair, radii = (one.link, two.link), one.radius + two.radius
            if one.link != two.link and frozenset(pair) not in urdf.neighbours():
                gap = float((distances.between_segments(a, b, c, d) - radii).min())
                least[pair] = min(gap, least.get(pair, np.inf))
    pair = min(least, key=lambda key: least[key])
    assert report["clearance of links"].worst == pytest.approx(least[pair], abs=1e-12)
    assert report["clearance of links"].where == " and ".join(pair)


def test_blocks_change_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log, ground = honest("free", 0.05)
    path, rules = MACHINE.urdf(tmp_path / "robot.urdf"), Rules(sub_samples=1)
    whole = check_walk(log, path, ground, rules)
    monkeypatch.setattr("wbc.walking.checker.samples.BLOCK", 47)
    parts = check_walk(log, path, ground, rules)
    assert (whole.samples, whole.open_freedoms) == (parts.samples, parts.open_freedoms)
    for one, other in zip(whole.findings, parts.findings, strict=True):
        assert (one.kind, one.count, one.where) == (other.kind, other.count, other.where)
        assert one.worst == pytest.approx(other.worst, rel=1e-9, abs=1e-12, nan_ok=True)


@pytest.mark.parametrize("count", [0, 1, 200])
def test_points_that_are_near_one_of_many_are_found(count: int) -> None:
    rng = np.random.default_rng(count)
    points, of = rng.uniform(-1.0, 1.0, (count, 3)), rng.uniform(-0.5, 0.5, (300, 3))
    gaps = np.linalg.norm(of[:, None] - points[None], axis=2).min(axis=1, initial=np.inf)
    for distance in (0.02, 0.1, 0.4, 2.0):
        np.testing.assert_array_equal(distances.near_any(points, of, distance), gaps <= distance)
    # At the edge of their box too
    assert distances.near_any(np.eye(3), np.zeros((1, 3)), 1.0).all()
    assert len(distances.near_any(points, of[:0], 1.0)) == 0
