"""Jerk-limited laws along paths: on the path, within every limit, hardly longer than without a limit of the jerk."""

from __future__ import annotations

import numpy as np
import pytest

from wbc import errors
from wbc.trajectory import PolynomialPath, blend_path, jerk_limited, jerk_limited_along, spline_path, time_optimal

POINTS = np.array([[0, 0, 0], [1, 0.5, -0.3], [0.5, 1.5, 0], [-0.5, 0.7, 0.8], [0, 0, 1.0]])
SIZES = {"velocity": [1.0, 1.5, 1.0], "acceleration": [3.0, 2.0, 4.0], "jerk": [20.0, 30.0, 15.0]}


def used(law, sizes, samples=6001):
    """Largest shares of the limits, by differences of positions that are read off the law."""
    t = np.linspace(0.0, law.duration, samples)
    h = t[1]
    q = law.at(t).position
    rates = [np.diff(q, axis=0) / h, np.diff(q, 2, axis=0) / h**2, np.diff(q, 3, axis=0) / h**3]
    names = ("velocity", "acceleration", "jerk")
    return [float((np.abs(x) / np.asarray(sizes[n])).max()) for x, n in zip(rates, names, strict=True)]


def on_path(law, path):
    """Largest distance of the law's positions from the path, at its own coordinates."""
    t = np.linspace(0.0, law.duration, 501)
    return float(
        np.abs(law.at(t).position - path.evaluate(np.clip(law.timing.evaluate(t), *path.knots[[0, -1]]))).max()
    )


@pytest.mark.parametrize("way", [0.3, 1.0, 10.0])
def test_on_a_line_it_is_the_law_between_two_states(way):
    line = PolynomialPath([0.0, way], [[[1.0]], [[0.0]]])
    sizes = {"velocity": 1.0, "acceleration": 1.0, "jerk": 1.0}
    law = jerk_limited_along(line, cells=100, **sizes)
    assert law.certificate.satisfied
    shortest = jerk_limited([0.0], [way], **sizes).duration
    assert -1e-9 <= law.duration / shortest - 1.0 <= 5e-3


def test_splines_take_little_longer_than_without_a_limit_of_the_jerk():
    path = spline_path(POINTS)
    free = time_optimal(path, velocity=SIZES["velocity"], acceleration=SIZES["acceleration"]).duration
    for factor, longer in ((1.0, 0.15), (100.0, 0.01)):
        sizes = {**SIZES, "jerk": factor * np.array(SIZES["jerk"])}
        law = jerk_limited_along(path, **sizes)
        assert law.certificate.satisfied
        assert {w.kind for w in law.certificate.worst.values()} == {"exact"}
        assert max(used(law, sizes)) <= 1.0 + 1e-3
        assert on_path(law, path) < 1e-12
        assert law.certificate.ratio > 1.0 - 1e-3
        # time_optimal is slower than the least time by up to so much itself
        assert -5e-3 < law.duration / free - 1.0 < longer


@pytest.mark.parametrize("size", [1e-2, 1e-8, 1e3])
def test_paths_of_every_size(size):
    law = jerk_limited_along(spline_path(size * POINTS), cells=100, **SIZES)
    assert law.certificate.satisfied
    assert law.certificate.ratio > 0.99
    start, end = law.at(0.0), law.at(law.duration)
    assert np.abs(end.position - size * POINTS[-1]).max() <= 1e-12 * size
    for state in (start, end):
        assert np.abs(state.velocity).max() < 1e-9 * size
        assert np.abs(state.acceleration).max() < 1e-6


def test_blends_with_continuous_curvature_are_passed_without_a_stop():
    path = blend_path(POINTS, deviation=0.05)
    law = jerk_limited_along(path, cells=100, **SIZES)
    assert law.certificate.satisfied
    assert on_path(law, path) < 1e-12
    inner = np.linspace(0.02, 0.98, 400) * law.duration
    assert np.abs(law.at(inner).velocity).max(axis=1).min() > 1e-3


@pytest.mark.parametrize(
    ("knots", "pieces", "what"),
    [
        # A corner; an arc of a parabola behind a line
        ([0.0, 1.0, 2.0], [[[0, 0], [0, 0]], [[1, 0], [0, 1]], [[0, 0], [1, 0]]], "direction"),
        ([0.0, 1.0, 2.0], [[[0, 0], [0, 0.5]], [[1, 0], [1, 0]], [[0, 0], [1, 0]]], "curvature"),
    ],
)
def test_jumps_are_refused_or_rested_at(knots, pieces, what):
    path = PolynomialPath(knots, np.array(pieces, dtype=float))
    sizes = {"velocity": 1.0, "acceleration": 2.0, "jerk": 10.0}
    with pytest.raises(errors.ContinuityError, match=what) as caught:
        jerk_limited_along(path, **sizes)
    assert caught.value.value == 1.0
    law = jerk_limited_along(path, stops=True, cells=80, **sizes)
    assert law.certificate.satisfied
    assert law.certificate.worst["jerk"].kind == "exact"
    t = np.linspace(0.0, law.duration, 4001)
    state = law.at(t)
    at = int(np.abs(state.position - [1.0, 0.0]).max(axis=1).argmin())
    assert np.abs(state.velocity[at]).max() < 1e-3


def test_a_path_that_stands_takes_a_moment():
    law = jerk_limited_along(
        PolynomialPath([0.0, 1.0], [[[0.0, 0.0]], [[0.2, 0.3]]]), velocity=1, acceleration=1, jerk=1
    )
    assert 0.0 < law.duration <= 1e-6
    assert np.array_equal(law.at(law.duration).position, [0.2, 0.3])
    assert law.certificate.ratio == 0.0
