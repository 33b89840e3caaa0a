"""Jerk-limited laws between two states: closed forms, straight lines, position limits."""

from __future__ import annotations

import numpy as np
import pytest

from tests.repeats import repeats
from wbc import errors
from wbc.trajectory import jerk_limited


def test_published_duration():
    law = jerk_limited([0.0], [1.0], velocity=1.0, acceleration=1.0, jerk=1.0)
    assert abs(law.duration - 32.0 ** (1.0 / 3.0)) < 1e-12


def least(way, v, a, j):
    """Duration from rest to rest, by cases of what is reached: A and V, V alone, A alone, neither."""
    if v * j >= a * a:
        if way >= v * (v / a + a / j):
            return way / v + v / a + a / j
        if way >= 2.0 * a**3 / j**2:
            return a / j + np.sqrt(a * a / (j * j) + 4.0 * way / a)
    elif way >= 2.0 * v * np.sqrt(v / j):
        return way / v + 2.0 * np.sqrt(v / j)
    return 4.0 * np.cbrt(way / (2.0 * j))


def test_rest_to_rest_takes_the_closed_form():
    rng = np.random.default_rng(3)
    for _ in range(repeats(150)):
        way, v, a, j = np.exp(rng.normal(size=(4, 3)) * 2.0)
        way *= rng.choice([-1.0, 1.0], 3)
        law = jerk_limited(np.zeros(3), way, velocity=v, acceleration=a, jerk=j)
        expected = max(least(*row) for row in zip(np.abs(way), v, a, j, strict=True))
        assert abs(law.duration - expected) <= 1e-9 * expected


@pytest.mark.parametrize("synchronisation", ["time", "phase", "none"])
def test_tiny_moves_and_none_at_all(synchronisation):
    sizes = {"velocity": 1.0, "acceleration": [5.0, 2.0, 1.0], "jerk": 10.0, "synchronisation": synchronisation}
    start = np.array([0.3, -1.0, 2.0])
    for size in 10.0 ** np.arange(-1.0, -16.0, -1.0):
        target = start + size * np.array([1.0, 0.0, -0.5])
        law = jerk_limited(start, target, **sizes)
        assert law.certificate.satisfied
        assert np.abs(law.at(law.duration).position - target).max() <= 1e-15
    law = jerk_limited(start, start, **sizes)
    assert 0.0 < law.duration <= 1e-6
    assert np.array_equal(law.at([0.0, law.duration]).position, [start, start])
    assert law.certificate.ratio == 0.0


@pytest.mark.parametrize("straight", [False, True])
def test_a_jerk_limit_that_means_none(straight):
    """Jerk phases of microseconds late in long laws, of which doubles hold the time to some digits only."""
    rng = np.random.default_rng(4)
    for _ in range(60):
        start, target = rng.normal(size=(2, int(rng.integers(1, 4))))
        v, a = 10.0 ** rng.uniform(-2.0, 1.0, (2, len(start)))
        law = jerk_limited(start, target, velocity=v, acceleration=a, jerk=1e6 * a, straight=straight)
        assert law.certificate.satisfied, (v, a, law.certificate)
        t = np.linspace(0.0, law.duration, 10)
        np.testing.assert_allclose(law.at(law.duration).position, target, atol=1e-12)
        assert (np.abs(law.jerk(t)) <= 1e6 * a * (1.0 + 1e-6)).all()


def test_straight_lines_are_straight_whatever_the_limits_are():
    rng = np.random.default_rng(5)
    for k in range(100):
        start, target = rng.normal(size=(2, 5))
        target[rng.integers(5)] = start[rng.integers(5)]
        v, a, j = np.exp(rng.normal(size=(3, 5)))
        law = jerk_limited(start, target, velocity=v, acceleration=a, jerk=j, straight=True)
        way = target - start
        at = law.at(np.linspace(0.0, law.duration, 50)).position - start
        across = at - np.outer(at @ way / (way @ way), way)
        assert np.abs(across).max() < 1e-13, k
        assert np.abs(at[-1] - way).max() < 1e-14
        size = np.maximum(np.abs(way), 1e-300)
        expected = least(1.0, *(np.min(x / size) for x in (v, a, j)))
        assert abs(law.duration - expected) <= 1e-9 * expected
        assert law.certificate.satisfied


def test_straight_with_speeds_along_the_line():
    start, way = np.array([0.1, 0.2, 0.3]), np.array([1.0, -2.0, 0.5])
    sizes = {"velocity": [1.0, 3.0, 2.0], "acceleration": 4.0, "jerk": [30.0, 20.0, 40.0], "straight": True}
    law = jerk_limited(start, start + way, start_velocity=0.5 * way, target_velocity=-0.3 * way, **sizes)
    assert law.certificate.satisfied
    end = law.at(law.duration)
    assert np.abs(end.position - start - way).max() < 1e-12
    assert np.abs(end.velocity + 0.3 * way).max() < 1e-12


def test_phase_needs_the_same_time_as_time():
    rng = np.random.default_rng(6)
    for _ in range(40):
        start, target = rng.normal(size=(2, 4))
        sizes = dict(zip(("velocity", "acceleration", "jerk"), np.exp(rng.normal(size=(3, 4))), strict=True))
        laws = [jerk_limited(start, target, synchronisation=s, **sizes) for s in ("time", "phase", "none")]
        assert np.ptp([law.duration for law in laws]) <= 1e-9 * laws[0].duration
        assert all(law.certificate.satisfied for law in laws)


def test_position_limits_are_kept_where_they_can_be():
    """Starts whose least way to v = 0 just ends at the limit; what is refused has no way that keeps it."""
    rng = np.random.default_rng(12)
    walls = {"lower": -1.0, "upper": 1.0}
    mended = refused = 0
    for k in range(150):
        v, a, j = rng.uniform((0.1, 2.0, 20.0), (1.5, 8.0, 80.0))
        start = np.array([1.0 - least_way(v, a, j) + (2e-3 if k % 10 == 0 else -1e-6), -1.0])
        target, away = rng.uniform(-1.0, 1.0, 2), np.array([rng.uniform(-1.0, 1.0) * (k % 2), 0.0])
        motion = {"start_velocity": [v, 0.0], "target_velocity": away, "velocity": 2.0, "acceleration": a, "jerk": j}
        free = jerk_limited(start, target, **motion)
        outside = np.abs(free.at(np.linspace(0.0, free.duration, 300)).position).max() > 1.0 + 1e-5
        # Arriving with a speed, or leaving with one, takes as much way behind
        behind = target[0] - np.sign(away[0]) * least_way(abs(away[0]), a, j)
        if k % 10 == 0 or abs(behind) > 1.0:
            refused += 1
            with pytest.raises(errors.BoundsError, match="joint 0"):
                jerk_limited(start, target, **motion, **walls)
            continue
        law = jerk_limited(start, target, **motion, **walls)
        mended += outside
        assert law.certificate.satisfied
        assert np.abs(law.at(np.linspace(0.0, law.duration, 300)).position).max() <= 1.0 + 1e-9
        end = law.at(law.duration)
        assert np.abs(end.position - target).max() < 1e-11
        assert np.abs(end.velocity - away).max() < 1e-9
    assert refused > 15
    assert mended > 5, mended


def least_way(v, a, j):
    """Way to v = 0 under jerk -j down to -a, then held."""
    t = a / j
    if v < 0.5 * a * t:
        t = np.sqrt(2.0 * v / j)
        return v * t - j * t**3 / 6.0
    left = v - 0.5 * a * t
    return v * t - j * t**3 / 6.0 + left**2 / (2.0 * a)
