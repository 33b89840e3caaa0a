"""Waypoints that nearly repeat: every law takes them, passes each, and takes no longer than with stops there."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from tests.repeats import repeats
from wbc.trajectory import Law, blend_path, jerk_limited_along, spline_path, time_optimal
from wbc.validation import Array

#: What waypoints must be apart to be two, as a share of the whole and of a unit
APART = 1e-6
#: Of two places that are farther apart than that, one beside the other, a path passes both: nearly a stop
LONGER = 1.5
DEVIATION = 0.02


def sizes(dof: int) -> dict[str, Array]:
    return {"velocity": np.linspace(1.0, 2.0, dof), "acceleration": np.linspace(8.0, 3.0, dof)}


KINDS: dict[str, tuple[Callable[[Array], Law], float]] = {
    "time_optimal spline": (lambda w: time_optimal(spline_path(w), **sizes(w.shape[1])), 0.0),
    "time_optimal blend": (lambda w: time_optimal(blend_path(w, DEVIATION), **sizes(w.shape[1])), DEVIATION),
    "jerk_limited_along spline": (
        lambda w: jerk_limited_along(spline_path(w), jerk=50.0, cells=40, **sizes(w.shape[1])),
        0.0,
    ),
    "jerk_limited_along blend": (
        lambda w: jerk_limited_along(blend_path(w, DEVIATION), jerk=50.0, cells=40, **sizes(w.shape[1])),
        DEVIATION,
    ),
}


def near_repeats(rng: np.random.Generator, gap: float) -> tuple[Array, Array, list[int]]:
    """Random waypoints in 1 to 7 joints, the same with one to three clusters of two or three, and where these are."""
    plain = rng.uniform(-1.5, 1.5, (int(rng.integers(2, 6)), int(rng.integers(1, 8))))
    clusters = set(rng.integers(0, len(plain), int(rng.integers(1, 4))).tolist())
    out = []
    for k, place in enumerate(plain):
        out.append(place)
        for _ in range(int(rng.integers(1, 3)) * (k in clusters)):
            aside = rng.normal(size=len(place))
            out.append(out[-1] + gap * aside / np.linalg.norm(aside))
    return plain, np.array(out), sorted(clusters)


@pytest.mark.parametrize("kind", KINDS)
def test_near_repeats(kind: str) -> None:
    law, deviation = KINDS[kind]
    rng = np.random.default_rng(11)
    for gap in 10.0 ** rng.uniform(-12.0, -3.0, repeats(2)):
        plain, points, clusters = near_repeats(rng, float(gap))
        found = law(points)
        assert found.certificate.ratio <= 1.0 + 1e-8
        knots = found.path.knots
        s = (knots[:-1, None] + np.diff(knots)[:, None] * np.linspace(0.0, 1.0, 101)).ravel()
        places = found.path.evaluate(s)
        for place in points:
            assert np.linalg.norm(places - place, axis=1).min() <= 1.000001 * (deviation + APART)
        without = law(plain).duration
        if 2.0 * gap < APART:
            assert found.duration == pytest.approx(without, rel=1e-3)
            continue
        ends = [0, *(k for k in clusters if 0 < k < len(plain) - 1), len(plain) - 1]
        stopping = sum(law(plain[a : b + 1]).duration for a, b in pairwise(ends))
        assert 0.95 * without <= found.duration <= LONGER * stopping


def test_durations_hardly_change_with_the_distance() -> None:
    """Of the places of two waypoints, whichever side of what makes them one they are on."""
    durations = []
    for gap in (0.0, 1e-9, 1e-7, 2e-6, 1e-4, 1e-3):
        points = np.array([[0.0, 0.0], [0.5, 0.2], [0.5, 0.2 + gap], [0.8, 0.0]])
        law = jerk_limited_along(spline_path(points), velocity=1.0, acceleration=2.0, jerk=20.0, cells=40)
        durations.append(law.duration)
    one, two = np.array(durations[:3]), np.array(durations[3:])
    assert np.ptp(one) < 1e-3
    assert np.ptp(two) < 0.15 * two.min()
    assert two.max() < 1.75 * one.min()


@pytest.mark.parametrize("seed", range(repeats(6)))
def test_repeats_are_tiny_parts_of_long_paths(seed: int) -> None:
    """Turns beside millimetres, with two waypoints that are a few millionths of one apart."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(4, 3)) * [1.0, 1.0, 3e3]
    aside = rng.normal(size=3)
    points = np.insert(points, 2, points[1] + 2e-6 * aside / np.linalg.norm(aside), axis=0)
    found = time_optimal(spline_path(points), velocity=[1e-3, 2.0, 50.0], acceleration=[1.0, 5.0, 300.0])
    assert found.certificate.ratio <= 1.0 + 1e-6
    passed = found.path.evaluate(found.path.knots)
    assert all(np.abs(passed - point).max(axis=1).min() < 1e-9 for point in points)
