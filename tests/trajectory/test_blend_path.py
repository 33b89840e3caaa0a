"""Rounded corners: never farther from the straight lines than allowed, straight between, curvature continuous."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

from tests.trajectory.path_checks import steps_at_knots
from wbc.trajectory import Law, MotionLimits, PolynomialPath, Timing, blend_path
from wbc.validation import Array

#: Waypoints some of which are equal, on one line, straight back, or far apart
POINTS = st.integers(1, 3).flatmap(
    lambda dof: arrays(np.float64, st.tuples(st.integers(2, 6), st.just(dof)), elements=st.integers(-4, 4).map(float))
)
SCALES = st.sampled_from([1e-8, 1e-3, 1.0, 1e5])


def polyline(points: Array, s: Array) -> Array:
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    keep = np.concatenate([[True], lengths > 0.0])
    at = np.concatenate([[0.0], np.cumsum(lengths[lengths > 0.0])])
    return np.stack([np.interp(s, at, column) for column in points[keep].T], axis=1)


def grid(path: PolynomialPath, count: int = 33) -> tuple[Array, Array]:
    """(s, pieces)."""
    shares = np.linspace(0.0, 1.0, count)
    s = path.knots[:-1, None] + np.diff(path.knots)[:, None] * shares
    return s.ravel(), np.repeat(np.arange(len(path.knots) - 1), count)


@given(POINTS, st.floats(1e-6, 10.0), SCALES)
def test_deviation_is_kept_at_every_s(points: Array, share: float, scale: float) -> None:
    points, deviation = scale * points, scale * share
    if not np.ptp(points, axis=0).any():
        assert blend_path(points, deviation).degree == 0
        return
    path = blend_path(points, deviation)
    s, pieces = grid(path)
    off = np.linalg.norm(path.evaluate(s, 0, pieces) - polyline(points, s), axis=1)
    size = scale * 1e-13
    assert off.max() <= deviation * (1.0 + 1e-9) + size
    assert path.length == pytest.approx(np.linalg.norm(np.diff(points, axis=0), axis=1).sum(), rel=1e-14)
    np.testing.assert_allclose(path.evaluate(path.knots[[0, -1]]), points[[0, -1]], atol=size)


@given(POINTS, st.floats(1e-6, 10.0), SCALES)
def test_first_two_derivatives_are_continuous(points: Array, share: float, scale: float) -> None:
    path = blend_path(scale * points, scale * share)
    s, pieces = grid(path)
    second = np.abs(path.evaluate(s, 2, pieces)).max()
    assert steps_at_knots(path, 0) <= scale * 1e-13
    assert steps_at_knots(path, 1) <= 1e-13
    # A corner of 1e-6 in 20 has knots that are 1e-9 of its size apart from where they should be
    assert steps_at_knots(path, 2) <= 1e-8 * second
    assert np.linalg.norm(path.evaluate(s, 1, pieces), axis=1).max() <= 1.0 + 1e-12


@given(POINTS, st.floats(1e-3, 0.2))
def test_straight_between_corners(points: Array, deviation: float) -> None:
    path = blend_path(points, deviation)
    if path.degree == 0:
        return
    s, pieces = grid(path)
    second = np.linalg.norm(path.evaluate(s, 2, pieces), axis=1).reshape(-1, 33)
    straight = second.max(axis=1) == 0.0
    off = np.linalg.norm(path.evaluate(s, 0, pieces) - polyline(points, s), axis=1).reshape(-1, 33)
    assert off[straight].max(initial=0.0) < 1e-13
    # Corners take at most half of each segment beside them
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert np.diff(path.knots)[~straight].max(initial=0.0) <= lengths.max() * (1.0 + 1e-12)


def test_the_corner_is_passed_at_the_deviation() -> None:
    path = blend_path([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], 0.05)
    middle = path.evaluate(np.array([1.0]))[0]
    assert np.linalg.norm(middle - [1.0, 0.0]) == pytest.approx(0.05, rel=1e-14)
    reach = 0.05 / (3.0 / 16.0 * np.sqrt(2.0))
    np.testing.assert_allclose(path.knots, [0.0, 1.0 - reach, 1.0 + reach, 2.0], rtol=1e-14)


def test_a_large_deviation_takes_half_of_the_shorter_segment() -> None:
    path = blend_path([[0.0, 0.0], [1.0, 0.0], [1.0, 3.0], [2.0, 3.0]], 100.0)
    np.testing.assert_allclose(path.knots, [0.0, 0.5, 1.5, 3.5, 4.5, 5.0])
    touching = blend_path([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [2.0, 1.0]], 100.0)
    np.testing.assert_allclose(touching.knots, [0.0, 0.5, 1.5, 2.5, 3.0])
    assert steps_at_knots(touching, 1) < 1e-15


def test_straight_back_stops_short_of_the_waypoint() -> None:
    path = blend_path([[0.0], [1.0], [0.0]], 0.01)
    assert path.evaluate(np.array([1.0]))[0, 0] == pytest.approx(0.99, rel=1e-14)
    assert abs(path.evaluate(np.array([1.0]), 1)[0, 0]) < 1e-13


def test_laws_along_it_have_exact_certificates() -> None:
    path = blend_path([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], 0.05)
    limits = MotionLimits(velocity=np.ones(2), acceleration=np.full(2, 100.0))
    worst = Law(path, Timing.identity(2.0), limits).certificate.worst
    assert worst["velocity"].kind == "exact"
    assert worst["velocity"].ratio == pytest.approx(1.0, abs=1e-12)
    # q'' is largest in the middle of the corner: 1.5 |v - u| / 2 d by joint
    reach = 0.05 / (3.0 / 16.0 * np.sqrt(2.0))
    assert worst["acceleration"].ratio == pytest.approx(1.5 / (2.0 * reach) / 100.0, rel=1e-9)
