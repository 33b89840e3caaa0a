"""Distances, normals and witness points: against Coal pair by pair, and against support functions."""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin
import pytest

from tests.evaluation import random_configuration
from tests.models import spherical_seven
from tests.proximity.world import NAMES, SHAPES, Referee, all_pairs, place, robot, sensor
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


def deepest(first: Shape, second: Shape, poses: tuple[pin.SE3, pin.SE3], start: np.ndarray) -> float:
    """The largest clearance -h_A(n) - h_B(-n) over all n, by search: it is the signed distance of convex shapes."""
    rng = np.random.default_rng(0)

    def clear(n: np.ndarray) -> np.ndarray:
        return -reach(first, poses[0], n) - reach(second, poses[1], -n)

    axes = [*poses[0].rotation.T, *poses[1].rotation.T]
    crossed = [np.cross(a, b) for a in axes[:3] for b in axes[3:]]
    tries = np.vstack([rng.normal(size=(600, 3)), start, *axes, *(c for c in crossed if c @ c > 1e-12)])
    tries = np.vstack([tries, -tries]) / np.linalg.norm(np.vstack([tries, tries]), axis=1)[:, None]
    values = clear(tries)
    best, value, step = tries[values.argmax()], values.max(), 0.1
    while step > 1e-7:
        near = best + step * rng.normal(size=(24, 3))
        near /= np.linalg.norm(near, axis=1)[:, None]
        values = clear(near)
        if values.max() > value:
            best, value = near[values.argmax()], values.max()
        else:
            step *= 0.6
    return float(value)


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


@pytest.mark.parametrize("first", SHAPES, ids=lambda s: type(s).__name__)
def test_signed_distances_are_those_of_support_functions(first: Shape) -> None:
    """Random places, and places on a grid with aligned axes, where closed forms and EPA fail."""
    bot, rng = spherical_seven(), np.random.default_rng(3)
    q, grid = bot.neutral, [-0.1, -0.05, 0.0, 0.0, 0.05, 0.1]
    doubtful = 0
    for second, case in itertools.product(SHAPES, range(5)):
        poses = (place(rng), place(rng))
        if case % 2:
            turns = (QUARTERS[rng.integers(9)], QUARTERS[rng.integers(9)])
            poses = (pin.SE3(turns[0], rng.choice(grid, 3)), pin.SE3(turns[1], rng.choice(grid, 3)))
        if case in (3, 6, 9):
            onto_axis = poses[0].translation + rng.choice(grid) * poses[0].rotation[:, 2]
            poses = (poses[0], pin.SE3(poses[1].rotation, onto_axis))
        a, b = Body("a", "world", poses[0], first), Body("b", "world", poses[1], second)
        there, back = witnesses(bot, [(a, b), (b, a)], q)
        truth = deepest(first, second, poses, there.normal)
        for witness, sign in ((there, 1.0), (back, -1.0)):
            assert witness.distance == pytest.approx(truth, abs=1.2e-5)
            proof = -reach(first, poses[0], sign * witness.normal[None]) - reach(
                second, poses[1], -sign * witness.normal[None]
            )
            assert witness.distance == pytest.approx(float(proof[0]), abs=1.2e-5)
            gap = witness.on_second - witness.on_first
            assert gap == pytest.approx(witness.distance * witness.normal, abs=1e-9)
            doubtful += witness.doubtful
    assert first != SHAPES[1] or doubtful > 5, "places without a normal are among the tests"


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
