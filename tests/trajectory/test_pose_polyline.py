"""Polylines of poses: straight, turning about one axis, corners within their deviations in position and in turn."""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, strategies as st

from tests.trajectory.path_checks import off_orthonormal, random_poses
from wbc.trajectory import Law, MotionLimits, Path, Timing, geodesic_path, pose_polyline
from wbc.validation import Array

SEEDS = st.integers(0, 10**6)


def lengths(poses: list[pin.SE3], radius: float) -> Array:
    return np.array(
        [
            np.linalg.norm(b.translation - a.translation) + radius * np.linalg.norm(pin.log3(b.rotation @ a.rotation.T))
            for a, b in itertools.pairwise(poses)
        ]
    )


def without_corners(poses: list[pin.SE3], radius: float, s: float) -> pin.SE3:
    """The pose on the straight lines, by Pinocchio."""
    sizes = lengths(poses, radius)
    ends = np.cumsum(sizes)
    k = min(int(np.searchsorted(ends, s)), len(sizes) - 1)
    share = 1.0 - (ends[k] - s) / sizes[k]
    a, b = poses[k], poses[k + 1]
    turn = pin.exp3(share * pin.log3(b.rotation @ a.rotation.T))
    return pin.SE3(turn @ a.rotation, a.translation + share * (b.translation - a.translation))


def off(path: Path, poses: list[pin.SE3], radius: float, s: Array) -> tuple[Array, Array]:
    """Distances [m] and turns [rad] from the straight lines at the same s."""
    found = path.evaluate(s)
    exact = [without_corners(poses, radius, x) for x in s.tolist()]
    places = [np.linalg.norm(f[:3, 3] - e.translation) for f, e in zip(found, exact, strict=True)]
    turns = [np.linalg.norm(pin.log3(f[:3, :3] @ e.rotation.T)) for f, e in zip(found, exact, strict=True)]
    return np.array(places), np.array(turns)


@given(SEEDS, st.integers(3, 5), st.floats(1e-3, 1.0), st.floats(1e-3, 1.0), st.floats(0.05, 2.0))
def test_deviations_are_kept_at_every_s(seed: int, count: int, place: float, turn: float, radius: float) -> None:
    poses = random_poses(seed, count)
    path = pose_polyline(poses, place, turn, radius)
    assert path.length == pytest.approx(lengths(poses, radius).sum(), rel=1e-12)
    s = np.linspace(0.0, path.length, 60)
    places, turns = off(path, poses, radius, s)
    assert places.max() <= place * (1.0 + 1e-9)
    assert turns.max() <= turn * (1.0 + 1e-9) + 1e-9
    np.testing.assert_allclose(path.evaluate(s[:1])[0], poses[0].homogeneous, atol=1e-14)
    np.testing.assert_allclose(path.evaluate(s[-1:])[0], poses[-1].homogeneous, atol=1e-13)


@given(SEEDS)
def test_straight_between_corners(seed: int) -> None:
    poses = random_poses(seed, 4)
    path = pose_polyline(poses, 0.01)
    for low, high in zip(path.knots[:-1:2], path.knots[1::2], strict=True):
        s = np.linspace(low, high, 12)[1:-1]
        places, turns = off(path, poses, 0.5, s)
        assert places.max() < 1e-13
        assert turns.max() < 1e-7  # Pinocchio's logarithm of a small turn
        twist = path.evaluate(s, 1)
        np.testing.assert_allclose(twist, np.tile(twist[0], (10, 1)), atol=1e-14)


def test_the_corner_is_passed_at_the_deviation_that_binds() -> None:
    poses = random_poses(5, 3)
    middle = lengths(poses, 0.5)[:1]
    place, turn = off(pose_polyline(poses, 0.01, 10.0), poses, 0.5, middle)
    assert place[0] == pytest.approx(0.01, rel=1e-9)
    place, turn = off(pose_polyline(poses, 10.0, 0.01), poses, 0.5, middle)
    assert 0.009 < turn[0] <= 0.01


def test_geodesics_are_straight_and_turn_at_one_rate() -> None:
    for seed in range(20):
        start, end = random_poses(seed, 2)
        path = geodesic_path(start, end, 0.3)
        assert path.degree == 1
        assert path.length == pytest.approx(lengths([start, end], 0.3)[0], rel=1e-12)
        turn = pin.log3(end.rotation @ start.rotation.T)
        expected = np.concatenate([end.translation - start.translation, turn]) / path.length
        twists = path.evaluate(np.array([0.0, 0.1, path.length]), 1)
        np.testing.assert_allclose(twists, np.tile(expected, (3, 1)), atol=1e-13)
        np.testing.assert_allclose(path.evaluate(path.knots)[1], end.homogeneous, atol=1e-14)


@pytest.mark.parametrize("angle", [1e-8, 1e-4, 1.0, 3.0, np.pi - 2e-6])
def test_geodesics_with_any_turn_on_the_spot(angle: float) -> None:
    axis = np.array([0.6, 0.0, 0.8])
    start = random_poses(2, 1)[0]
    end = pin.SE3(pin.exp3(angle * axis) @ start.rotation, start.translation)
    path = geodesic_path(start, end)
    assert path.length == pytest.approx(0.5 * angle, rel=1e-7)
    np.testing.assert_allclose(path.evaluate(path.knots)[1], end.homogeneous, atol=1e-14)
    np.testing.assert_allclose(path.evaluate(np.zeros(1), 1)[0, 3:], axis / 0.5, atol=1e-7)


@pytest.mark.parametrize("scale", [1e-8, 1e-4, 1e4])
def test_scales(scale: float) -> None:
    rng = np.random.default_rng(6)
    turns = rng.normal(size=(5, 3)) * min(scale, 0.5)
    poses = [pin.SE3(pin.exp3(turn), 1.0 + scale * rng.normal(size=3)) for turn in turns]
    path = pose_polyline(poses, 0.01 * scale)
    assert path.length == pytest.approx(lengths(poses, 0.5).sum(), rel=1e-6)
    assert off_orthonormal(path) < 4e-15
    twist = path.evaluate(np.linspace(0.0, path.length, 500), 1)
    assert np.linalg.norm(twist[:, :3], axis=1).max() < 1.0 + 1e-9
    assert np.linalg.norm(twist[:, 3:], axis=1).max() < 2.0 + 1e-9


def test_repeated_poses_are_dropped_and_equal_ones_stand() -> None:
    poses = random_poses(7, 3)
    repeated = [pose for pose in poses for _ in range(3)]
    plain, path = pose_polyline(poses, 0.05), pose_polyline(repeated, 0.05)
    np.testing.assert_allclose(path.knots, plain.knots, rtol=1e-14)
    # The other sign of the quaternion is the same orientation
    q = pin.Quaternion(poses[0].rotation).coeffs()
    other = np.concatenate([poses[0].translation, -q])
    for standing in (pose_polyline([poses[0], other, poses[0]], 0.05), geodesic_path(other, poses[0])):
        assert standing.degree == 0
        assert standing.knots.tolist() == [0.0, 1.0]
        np.testing.assert_allclose(standing.evaluate(np.array([0.3]))[0], poses[0].homogeneous, atol=1e-15)
        assert not standing.evaluate(np.array([0.3]), 1).any()


def test_certificates_are_exact_where_each_corner_turns_about_one_axis() -> None:
    a = pin.SE3.Identity()
    b = pin.SE3(pin.exp3(np.array([0.0, 0.0, 1.0])), np.array([1.0, 0.0, 0.0]))
    c = pin.SE3(pin.exp3(np.array([0.0, 0.0, 1.5])), np.array([1.0, 1.0, 0.0]))
    d = pin.SE3(pin.exp3(np.array([0.7, 0.0, 0.0])) @ c.rotation, np.array([1.0, 1.0, 1.0]))
    limits = MotionLimits(velocity=np.ones(6), acceleration=np.full(6, 10.0))
    kinds = []
    for poses in ([a, b, c], [a, b, c, d]):
        path = pose_polyline(poses, 0.05)
        law = Law(path, Timing.identity(path.length), limits)
        kinds.append(law.certificate.worst["acceleration"].kind)
        seen = np.abs(law.at(np.linspace(0.0, law.duration, 4001)).acceleration).max() / 10.0
        assert law.certificate.worst["acceleration"].ratio >= seen - 1e-12
    assert kinds == ["exact", "sampled"]
