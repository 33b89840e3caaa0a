"""Distances, normals and witness points: against Coal pair by pair, and against support functions."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.evaluation import random_configuration
from tests.models import spherical_seven
from tests.proximity.world import NAMES, Referee, all_pairs, place, robot, sensor
from wbc.proximity import Body, distances, witnesses
from wbc.shapes import Box, Capsule, Convex, Cylinder, Shape, Sphere

QUARTERS = [np.round(pin.exp3(np.pi / 2 * k * axis)) for axis in np.eye(3) for k in (0, 1, 2)]


def reach(shape: Shape, pose: pin.SE3, direction: np.ndarray) -> np.ndarray:
    """Support function by hand: the largest n'x of the shape's points, for directions in the world, n x 3."""
    n = direction @ pose.rotation
    if isinstance(shape, Convex):
        own = (n @ shape.points.T).max(axis=1)
    elif isinstance(shape, Box):
        own = np.abs(n) @ np.array(shape.size) / 2
    elif isinstance(shape, Cylinder):
        own = shape.radius * np.hypot(n[:, 0], n[:, 1]) + shape.length / 2 * np.abs(n[:, 2])
    else:
        assert isinstance(shape, (Sphere, Capsule))
        own = shape.radius + (shape.length / 2 * np.abs(n[:, 2]) if isinstance(shape, Capsule) else 0.0)
    return np.asarray(own + direction @ pose.translation)


@pytest.mark.parametrize("name", NAMES)
def test_every_pair_is_as_coal_says(name: str) -> None:
    bot, rng = robot(name), np.random.default_rng(2)
    pairs, referee, pose = all_pairs(bot, rng), Referee(bot), place(rng, 0.4)
    sensing, numbers = sensor(bot, pairs, len(pairs), pose)
    overlapping = 0
    for _ in range(12):
        q = random_configuration(bot, rng)
        sensing.sense(q)
        line = numbers["line"].reshape(-1, 6)
        for k, pair in enumerate(pairs):
            truth, normal, on_first, on_second = referee(pair, q, pose)
            if sensing.doubtful[k]:
                assert numbers["distance"][k] <= truth + 1e-9, "what is declared is proven, so it is below"
                continue
            # EPA on cylinders stops within 1e-6; which of two equally near points it meets is open
            assert numbers["distance"][k] == pytest.approx(truth, abs=4e-6)
            overlapping += truth < 0
            if numbers["distance"][k] == pytest.approx(truth, abs=1e-9) and line[k, :3] @ normal > 1 - 1e-9:
                assert line[k, 3:] == pytest.approx(np.cross(on_first, line[k, :3]), abs=2e-3)
                assert line[k, 3:] == pytest.approx(np.cross(on_second, line[k, :3]), abs=2e-3)
        assert np.isfinite(numbers["line"]).all()
        assert np.linalg.norm(line[:, :3], axis=1) == pytest.approx(np.ones(len(pairs)), abs=1e-9)
        assert not numbers["drift"].any()
    assert overlapping > 10, "overlapping pairs are among the tests"
    assert sensing.pairs()[3][:2] == (pairs[3][0].name, pairs[3][1].name)


def test_centres_on_each_other_have_declared_normals() -> None:
    bot = spherical_seven()
    turned = pin.SE3(pin.exp3(np.array([0.3, 0.5, 0.2])), np.array([0.1, 0.2, 0.3]))
    for first, second, depth, axis in [
        (Sphere(0.1), Sphere(0.05), 0.15, 2),
        (Sphere(0.0), Sphere(0.0), 0.0, 2),
        (Capsule(0.1, 0.4), Capsule(0.1, 0.4), 0.2, 1),
        (Capsule(0.0, 0.3), Capsule(0.0, 0.3), 0.0, 1),
        (Sphere(0.1), Capsule(0.05, 0.4), 0.15, 1),
        (Sphere(0.01), Cylinder(0.1, 0.4), 0.11, 1),
        (Box((0.1, 0.2, 0.3)), Box((0.1, 0.2, 0.3)), 0.1, 0),
        (Cylinder(0.2, 0.1), Cylinder(0.2, 0.1), 0.1, 2),
    ]:
        bodies = Body("a", "world", turned, first), Body("b", "world", turned, second)
        (found,) = witnesses(bot, [bodies], bot.neutral)
        assert found.doubtful
        assert found.distance == pytest.approx(-depth, abs=1e-9)
        assert found.normal == pytest.approx(turned.rotation[:, axis], abs=1e-9)


def test_a_body_just_inside_has_the_normal_out() -> None:
    """A small ball in a big box, a finger's breadth below one face."""
    bot = spherical_seven()
    ball = Body("ball", "world", pin.SE3(np.eye(3), np.array([0.01, -0.02, 0.13])), Sphere(0.02))
    box = Body("box", "world", pin.SE3.Identity(), Box((0.4, 0.4, 0.3)))
    there, back = witnesses(bot, [(ball, box), (box, ball)], bot.neutral)
    assert (there.distance, back.distance) == (pytest.approx(-0.04), pytest.approx(-0.04))
    assert there.normal == pytest.approx([0.0, 0.0, -1.0], abs=1e-9)
    assert back.normal == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
    assert there.on_second == pytest.approx([0.01, -0.02, 0.15], abs=1e-9)
    assert not there.doubtful


def test_distances_take_what_users_have() -> None:
    bot, rng = robot("panda"), np.random.default_rng(5)
    pairs, pose = all_pairs(bot, rng), place(rng, 0.4)
    q = random_configuration(bot, rng)
    found = distances(bot, pairs, q.tolist(), pose.homogeneous)
    assert found == pytest.approx([w.distance for w in witnesses(bot, pairs, q, pose)], abs=0.0)
    assert distances(bot, [], q).shape == (0,)
