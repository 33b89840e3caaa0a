"""Timed paths: the twist is the derivative of the pose, both ends are at rest, waypoints are met."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest

from tests.trajectory.path_checks import random_poses
from wbc.errors import NotFiniteError, RangeError, ShapeError, UnknownNameError
from wbc.track.path import ApproachedPath, SplinePath, TimedPath, smooth_step
from wbc.track.presets import PRESETS, preset

START = pin.SE3(pin.utils.rotate("x", math.pi), np.array([0.4, 0.1, 0.5]))


def spline(seed: int) -> SplinePath:
    rng = np.random.default_rng(seed)
    return SplinePath(np.cumsum(rng.uniform(0.5, 1.5, 5)), random_poses(seed, 5))


PATHS: dict[str, TimedPath] = {
    "spline0": spline(0),
    "spline1": spline(1),
    "approach": ApproachedPath(START, spline(2), 1.5),
} | {name: preset(name, START, 5.0).path for name in PRESETS}


@pytest.mark.parametrize("name", PATHS)
def test_twist_is_the_derivative_of_the_pose(name: str) -> None:
    path = PATHS[name]
    h = 1e-5
    scale = 0.0
    # Off the joints of pieces, where the difference would straddle two polynomials
    for t in np.linspace(0.013, path.duration - 0.017, 41):
        before, after, here = path.sample(t - h), path.sample(t + h), path.sample(t)
        linear = (after.pose.translation - before.pose.translation) / (2 * h)
        angular = pin.log3(after.pose.rotation @ before.pose.rotation.T) / (2 * h)
        np.testing.assert_allclose(here.twist, np.concatenate([linear, angular]), atol=2e-8)
        scale = max(scale, float(np.abs(here.twist).max()))
    assert scale > 0.05


@pytest.mark.parametrize("name", PATHS)
def test_ends_are_at_rest(name: str) -> None:
    path, h = PATHS[name], 1e-4
    for t, inward in ((0.0, h), (path.duration, -h)):
        assert np.abs(path.sample(t).twist).max() < 1e-9
        # Acceleration vanishes too: the twist a moment inside is of second order
        assert np.abs(path.sample(t + inward).twist).max() < 50.0 * h**2
    beyond = path.sample(path.duration + 1.0)
    assert np.abs(beyond.twist).max() == 0.0
    np.testing.assert_allclose(beyond.pose.homogeneous, path.sample(path.duration).pose.homogeneous, atol=1e-12)


def test_spline_meets_its_waypoints() -> None:
    chain = random_poses(3, 6)
    times = np.array([2.0, 2.5, 3.7, 4.0, 5.5, 6.0])
    path = SplinePath(times, chain)
    assert path.duration == pytest.approx(4.0)
    for t, pose in zip(times - 2.0, chain, strict=True):
        np.testing.assert_allclose(path.sample(t).pose.homogeneous, pose.homogeneous, atol=1e-12)


def test_two_poses_give_a_straight_line_and_one_axis() -> None:
    a, b = random_poses(4, 2)
    path = SplinePath([0.0, 2.0], [a, b])
    axis = pin.log3(b.rotation @ a.rotation.T)
    way = b.translation - a.translation
    for t in (0.3, 0.9, 1.6):
        here = path.sample(t)
        x, _ = smooth_step(t, 2.0)
        np.testing.assert_allclose(here.pose.translation, a.translation + x * way, atol=1e-12)
        turned = pin.log3(here.pose.rotation @ a.rotation.T)
        assert np.linalg.norm(np.cross(turned, axis)) < 1e-12


def test_acceleration_does_not_jump_at_waypoints() -> None:
    path = spline(5)
    h = 1e-3
    for t in path.times[1:-1]:
        before, here, after = (path.sample(t + k * h).twist for k in (-1, 0, 1))
        # A jump of the acceleration by 0.1 would be 100 here
        assert np.abs(after - 2 * here + before).max() / h**2 < 60.0


def test_stretching_keeps_the_poses() -> None:
    path = spline(6)
    slow = path.stretched(2.0 * path.duration)
    assert slow.duration == pytest.approx(2.0 * path.duration)
    for t in (0.4, 1.1, 2.3):
        a, b = path.sample(t), slow.sample(2.0 * t)
        np.testing.assert_allclose(a.pose.homogeneous, b.pose.homogeneous, atol=1e-9)
        np.testing.assert_allclose(a.twist, 2.0 * b.twist, atol=1e-9)


def test_around_obstacle_goes_round_what_the_straight_line_meets() -> None:
    found = preset("around-obstacle", START, 8.0)
    (ball, center), t = found.obstacles[0], np.linspace(0.0, 8.0, 400)
    points = np.array([found.path.sample(x).pose.translation for x in t])
    assert np.linalg.norm(points - center, axis=1).min() > ball.radius + 0.09
    far = points[np.argmax(np.linalg.norm(points - points[0], axis=1))]
    straight = points[0] + np.linspace(0.0, 1.0, 100)[:, None] * (far - points[0])
    assert np.linalg.norm(straight - center, axis=1).min() < 0.5 * ball.radius


def test_circle_is_a_circle() -> None:
    path = preset("circle", START, 4.0, 0.2).path
    center = START.translation + np.array([0.0, 0.0, 0.2])
    for t in np.linspace(0.0, 4.0, 30):
        assert np.linalg.norm(path.sample(t).pose.translation - center) == pytest.approx(0.2, abs=1e-12)


def test_bad_paths_are_refused() -> None:
    a, b = random_poses(0, 2)
    with pytest.raises(RangeError, match=r"path.times\[1\].*after 1 s"):
        SplinePath([1.0, 1.0], [a, b])
    with pytest.raises(ShapeError, match="at least two times"):
        SplinePath([1.0], [a])
    with pytest.raises(NotFiniteError, match=r"path\.times"):
        SplinePath([0.0, math.nan], [a, b])
    half = pin.SE3(pin.utils.rotate("z", math.radians(175.0)) @ a.rotation, a.translation)
    with pytest.raises(RangeError, match="too far from the orientation before it"):
        SplinePath([0.0, 1.0], [a, half])
    with pytest.raises(UnknownNameError, match="did you mean 'circle'"):
        preset("circel", START, 1.0)
    with pytest.raises(RangeError, match="duration"):
        preset("circle", START, 0.0)
    with pytest.raises(RangeError, match="size"):
        preset("circle", START, 1.0, -0.1)
