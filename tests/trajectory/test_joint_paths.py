"""Paths of joints through waypoints: they meet them, at every scale; repeated ones are dropped; bad input is named."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.trajectory.path_checks import steps_at_knots, worst_derivative
from wbc.trajectory import Law, PolynomialPath, Timing, blend_path, spline_path, standing_path, straight_path

WAYPOINTS = np.random.default_rng(4).normal(size=(6, 7))
ENDS = ("not-a-knot", "clamped", "natural")


def at(path: PolynomialPath, *s: float) -> np.ndarray:
    return path.evaluate(np.array(s))


def nearest(path: PolynomialPath, point: np.ndarray) -> float:
    grid = np.unique(np.concatenate([path.knots, np.linspace(path.knots[0], path.knots[-1], 2001)]))
    return float(np.linalg.norm(path.evaluate(grid) - point, axis=1).min())


def test_straight_has_unit_speed_and_both_ends() -> None:
    path = straight_path(WAYPOINTS[0], WAYPOINTS[1])
    assert path.degree == 1
    assert path.length == pytest.approx(np.linalg.norm(WAYPOINTS[1] - WAYPOINTS[0]), rel=1e-15)
    np.testing.assert_allclose(at(path, *path.knots), WAYPOINTS[:2], atol=1e-15)
    assert np.linalg.norm(path.evaluate(path.knots, 1), axis=1) == pytest.approx([1.0, 1.0], rel=1e-15)


@pytest.mark.parametrize("ends", ENDS)
def test_spline_meets_waypoints_and_is_c2(ends: Any) -> None:
    path = spline_path(WAYPOINTS, ends)
    np.testing.assert_allclose(at(path, *path.knots), WAYPOINTS, atol=1e-14)
    np.testing.assert_allclose(np.diff(path.knots), np.linalg.norm(np.diff(WAYPOINTS, axis=0), axis=1), rtol=1e-14)
    for order, scale in ((0, 1e-14), (1, 1e-13), (2, 1e-12)):
        assert steps_at_knots(path, order) < scale
    for order in (1, 2, 3):
        assert worst_derivative(path, order) < 1e-9


def test_ends_of_splines() -> None:
    clamped, natural, smooth = (spline_path(WAYPOINTS, ends) for ends in ("clamped", "natural", "not-a-knot"))
    s = clamped.knots[[0, -1]]
    assert np.abs(clamped.evaluate(s, 1)).max() < 1e-14
    assert np.abs(natural.evaluate(s, 2)).max() < 1e-13
    third = smooth.evaluate(smooth.knots[:-1], 3)
    np.testing.assert_allclose(third[0], third[1], rtol=1e-9)
    np.testing.assert_allclose(third[-1], third[-2], rtol=1e-9)


@pytest.mark.parametrize("ratio", [10.0, 1e3, 1e6])
@pytest.mark.parametrize("count", [3, 4, 6])
def test_splines_do_not_swing_out_where_lengths_differ(ratio: float, count: int) -> None:
    rng = np.random.default_rng(count)
    for _ in range(20):
        steps = rng.normal(size=(count - 1, 3))
        steps /= np.linalg.norm(steps, axis=1)[:, None]
        steps[1:] /= ratio
        for way in (steps, steps[::-1]):
            path = spline_path(np.concatenate([np.zeros((1, 3)), np.cumsum(way, axis=0)]))
            speeds = np.linalg.norm(path.evaluate(np.linspace(0.0, path.length, 2001), 1), axis=1)
            assert speeds.max() < 6.0


@pytest.mark.parametrize("scale", [1e-8, 1e-5, 1.0, 1e6])
@pytest.mark.parametrize("offset", [0.0, 3.0])
def test_every_scale_has_the_same_shape(scale: float, offset: float) -> None:
    points = offset + scale * WAYPOINTS
    rounding = 1e-15 * (offset + 10.0 * scale)
    for path in (spline_path(points), spline_path(points, "clamped"), blend_path(points, 0.05 * scale)):
        assert path.length / scale == pytest.approx(spline_path(WAYPOINTS).length, rel=1e-7)
        np.testing.assert_allclose(at(path, *path.knots[[0, -1]]), points[[0, -1]], atol=rounding)
        speeds = np.linalg.norm(path.evaluate(np.linspace(0.0, path.length, 501), 1), axis=1)
        assert speeds.max() < 5.0


def test_repeated_waypoints_are_dropped() -> None:
    repeated = np.repeat(WAYPOINTS, 3, axis=0)
    repeated[1] += 1e-12
    for make in (spline_path, lambda w: blend_path(w, 0.1)):
        plain, path = make(WAYPOINTS), make(repeated)
        np.testing.assert_allclose(path.knots, plain.knots, atol=1e-10)
        grid = np.linspace(0.0, plain.length, 101)
        np.testing.assert_allclose(path.evaluate(grid), plain.evaluate(grid), atol=1e-9)


@pytest.mark.parametrize(("whole", "least"), [(1e-8, 1e-14), (1.0, 1e-6), (1e3, 1e-6)])
def test_waypoints_are_apart_from_a_millionth_on(whole: float, least: float) -> None:
    """Of the whole, of long paths of a unit."""
    near, nearer = (
        whole * np.array([[0.0, 0.0], [step / whole, 0.0], [0.5, 0.0], [0.5, 0.5]])
        for step in (1.1 * least, 0.9 * least)
    )
    assert len(spline_path(near).knots) == 4
    assert len(spline_path(nearer).knots) == 3


def test_the_last_waypoint_is_reached_even_if_it_repeats_the_one_before() -> None:
    points = np.array([[0.0], [1.0], [1.0 + 1e-11]])
    path = spline_path(points)
    assert at(path, path.length)[0, 0] == pytest.approx(1.0 + 1e-11, abs=1e-16)


def test_there_and_back_is_no_standing() -> None:
    path = spline_path([[0.0], [1.0], [0.0]])
    assert path.length == pytest.approx(2.0)
    assert nearest(path, np.array([1.0])) == 0.0


@pytest.mark.parametrize("ends", ENDS)
def test_two_waypoints(ends: Any) -> None:
    path = spline_path(WAYPOINTS[:2], ends)
    np.testing.assert_allclose(at(path, *path.knots), WAYPOINTS[:2], atol=1e-15)
    assert path.degree == (3 if ends == "clamped" else 1)


@pytest.mark.parametrize("size", [0.0, 1e-15])
def test_equal_waypoints_stand(size: float) -> None:
    points = np.array([[1.0, -2.0], [1.0 + size, -2.0], [1.0, -2.0]])
    paths = (spline_path(points), blend_path(points, 0.1), straight_path(points[0], points[1]))
    for path in (*paths, standing_path(points[0])):
        assert path.degree == 0
        assert path.knots.tolist() == [0.0, 1.0]
        np.testing.assert_array_equal(at(path, 0.0, 0.5, 1.0), np.tile(points[0], (3, 1)))
        for order in (1, 2, 3):
            assert not path.evaluate(np.array([0.0, 1.0]), order).any()
    law = Law(paths[0], Timing.identity(1.0))
    assert law.at(0.3).position.tolist() == [1.0, -2.0]
    assert not law.at(0.3).velocity.any()
