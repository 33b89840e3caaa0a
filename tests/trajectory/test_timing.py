"""Timings: their algebra, where they pass places, and bad input."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tests.trajectory.random_laws import ragged
from wbc.trajectory import Timing
from wbc.validation import Array

seeds = st.integers(0, 2**32 - 1)


def random_timing(seed: int, degree: int) -> Timing:
    return ragged(seed, 1, degree).timing


@given(seeds, st.integers(1, 6))
@settings(max_examples=15)
def test_derivatives_are_those_of_the_polynomials(seed: int, degree: int) -> None:
    timing = random_timing(seed, degree)
    times = np.linspace(0.0, timing.duration, 101)
    piece = timing.pieces_at(times)
    for order in range(4):
        for k in range(len(timing.times) - 1):
            here = piece == k
            p = np.poly1d(timing.coefficients[:, k]).deriv(order)
            assert timing.evaluate(times[here], order) == pytest.approx(p(times[here] - timing.times[k]), abs=1e-9)


@given(seeds, st.integers(1, 5))
@settings(max_examples=20)
def test_crossings_are_all_found(seed: int, degree: int) -> None:
    """Between two neighbours of a dense grid on both sides of a place, there is one."""
    timing = random_timing(seed, degree)
    low, high = timing.hull().min(), timing.hull().max()
    places = np.random.default_rng(seed).uniform(low, high, 4)
    found = timing.crossings(places)
    assert np.abs(timing.evaluate(found)[:, None] - places).min(axis=1).max(initial=0.0) < 1e-9 * (1.0 + high)
    for k in range(len(timing.times) - 1):
        times = np.linspace(timing.times[k], timing.times[k + 1], 2001)
        s = timing.evaluate(times, 0, np.full(2001, k))
        for place in places:
            beyond = s > place
            for i in np.flatnonzero(beyond[1:] != beyond[:-1]):
                if min(abs(s[i] - place), abs(s[i + 1] - place)) > 1e-9:
                    assert ((found >= times[i]) & (found <= times[i + 1])).any()


@pytest.mark.parametrize("leading", [1e-320, 1e-300, 1e-30, -1e-17, 0.0])
def test_crossings_do_not_mind_leading_powers_below_rounding(leading: float) -> None:
    timing = Timing([0.0, 1.0], [[leading], [leading], [1.0], [0.0]])
    assert timing.crossings(np.array([0.3])) == pytest.approx([0.3], abs=1e-12)


@pytest.mark.parametrize("span", [1e-9, 1.0, 1e9])
def test_crossings_of_every_duration(span: float) -> None:
    timing = Timing([0.0, span], [[1.0 / span**2], [0.0], [0.0]])
    assert timing.crossings(np.array([0.25])) == pytest.approx([0.5 * span], rel=1e-12)


def test_what_only_touches_a_place_does_not_cross_it() -> None:
    timing = Timing([0.0, 2.0], [[-1.0], [2.0], [0.0]])
    assert timing.crossings(np.array([0.0, 1.0 + 1e-9])).size == 0


@given(seeds, st.integers(1, 6))
@settings(max_examples=15)
def test_ranges(seed: int, degree: int) -> None:
    timing = random_timing(seed, degree)

    def never(low: Array, high: Array) -> Any:
        return np.zeros(len(low), dtype=bool)

    low, high = timing.ranges(never)
    hull = timing.hull()
    for k in range(len(timing.times) - 1):
        times = np.linspace(timing.times[k], timing.times[k + 1], 2001)
        s = timing.evaluate(times, 0, np.full(2001, k))
        assert low[k] - 1e-12 <= s.min() <= low[k] + 1e-4
        assert high[k] - 1e-4 <= s.max() <= high[k] + 1e-12
        assert hull[k].min() <= low[k] + 1e-12
        assert hull[k].max() >= high[k] - 1e-12


def test_constant_accelerations() -> None:
    timing = Timing.accelerations(np.array([0.0, 1.0, 3.0]), np.array([0.0, 2.0, 2.0]))
    assert timing.times.tolist() == [0.0, 1.0, 2.0]
    assert timing.evaluate(np.array([0.0, 0.5, 1.5, 2.0])).tolist() == [0.0, 0.25, 2.0, 3.0]
    assert timing.evaluate(np.array([0.5, 1.5]), 2).tolist() == [2.0, 0.0]
