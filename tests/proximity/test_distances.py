"""Distances, normals and witness points: against Coal pair by pair, and against support functions."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.evaluation import random_configuration
from tests.models import spherical_seven
from tests.proximity.world import all_pairs, place, robot
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


def test_distances_take_what_users_have() -> None:
    bot, rng = robot("panda"), np.random.default_rng(5)
    pairs, pose = all_pairs(bot, rng), place(rng, 0.4)
    q = random_configuration(bot, rng)
    found = distances(bot, pairs, q.tolist(), pose.homogeneous)
    assert found == pytest.approx([w.distance for w in witnesses(bot, pairs, q, pose)], abs=0.0)
    assert distances(bot, [], q).shape == (0,)
