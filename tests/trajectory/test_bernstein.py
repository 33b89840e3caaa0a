"""Bounds of polynomials from their Bernstein coefficients, and of what lies between samples."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tests.trajectory.random_laws import powers
from wbc.trajectory.laws.between import bounds, highest, slopes
from wbc.trajectory.paths import bernstein


@given(st.integers(0, 2**32 - 1), st.integers(0, 15))
@settings(max_examples=20)
def test_coefficients_make_the_polynomial_again(seed: int, degree: int) -> None:
    wanted = np.random.default_rng(seed).normal(size=degree + 1)
    values = np.polyval(powers(wanted), bernstein.nodes(degree))
    found = bernstein.coefficients(values.reshape(1, -1))[0]
    assert np.abs(found - wanted).max() < 1e-15 * 4.0**degree + 1e-14


@given(st.integers(0, 2**32 - 1), st.integers(0, 9), st.integers(1, 20))
@settings(max_examples=30)
def test_largest(seed: int, degree: int, count: int) -> None:
    c = np.random.default_rng(seed).normal(size=(count, degree + 1))
    bound, number, place = bernstein.largest(c)
    u = np.linspace(0.0, 1.0, 20001 // count + 2)
    values = np.array([np.polyval(powers(row), u) for row in c])
    assert values.max() - 1e-12 <= bound <= values.max() + 1e-4
    assert np.polyval(powers(c[number]), place) == pytest.approx(bound, abs=1e-9)


@pytest.mark.parametrize("scale", [0.0, 1e-300, 1e-12, 1.0, 1e12])
def test_constants_of_every_size(scale: float) -> None:
    bound, _, _ = bernstein.largest(np.full((5, 4), scale))
    assert scale <= bound <= scale * (1.0 + 1e-12)


def test_a_thousand_pieces_that_share_their_maximum() -> None:
    """As in a law of least time, where every piece touches the limit."""
    bound, _, _ = bernstein.largest(np.tile([0.0, 2.0, 0.0], (1000, 1)))
    assert bound == pytest.approx(1.0, abs=1e-12)


def test_halves_are_the_polynomial_on_each_half() -> None:
    c = np.random.default_rng(1).normal(size=(3, 6))
    low, high = bernstein.halves(c)
    u = np.linspace(0.0, 1.0, 11)
    for whole, left, right in zip(c, low, high, strict=True):
        assert np.polyval(powers(left), u) == pytest.approx(np.polyval(powers(whole), 0.5 * u), abs=1e-12)
        assert np.polyval(powers(right), u) == pytest.approx(np.polyval(powers(whole), 0.5 + 0.5 * u), abs=1e-12)


def waves(seed):
    rng = np.random.default_rng(seed)
    start = np.cumsum(np.concatenate([[0.0], rng.uniform(0.01, 1.0, 20)]))
    size, rate, phase = rng.uniform(-1.0, 1.0, (3, 2, 3)) * np.array([1.0, 6.0, 3.0])[:, None, None]

    def value(t):
        return (size * np.sin(rate * t[..., None, None] + phase)).sum(axis=-1)

    return start, value


def test_between_two_samples_a_function_may_rise_at_twice_the_steepest_slope() -> None:
    """At slopes of 1 from 0 to 1 within 2 s: up to 1.5; at slopes of 2 from 1 to 1 within 1 s: up to 2."""
    span, values = np.array([2.0]), np.array([[[0.0], [1.0], [1.0]]])
    assert slopes(span, values) == [[1.0]]
    assert bounds(span, values[:, :2], np.array([[0.5]])) == [[1.5]]
    assert bounds(span, values, np.array([[1.0]])) == [[2.0]]


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("rounds", [0, 2])
def test_bounds_hold_and_come_near(seed, rounds):
    start, value = waves(seed)
    span = np.diff(start)

    def evaluate(some, count):
        return value(start[some, None] + span[some, None] * np.linspace(0.0, 1.0, count + 1))

    top = highest(span, evaluate, 8, rounds)
    dense = value(np.linspace(start[0], start[-1], 200_001))
    largest = dense.max()
    assert top.seen <= largest + 1e-7  # 200 001 places miss the peak by so much
    assert largest <= top.bound
    assert top.column == dense.max(axis=0).argmax()
    at = value(np.array(start[top.piece] + top.place * span[top.piece]))
    assert at[top.column] == pytest.approx(top.seen, rel=1e-12)
    assert top.spacing <= span.max() / 8 + 1e-15
    if rounds:
        coarse = highest(span, evaluate, 8, 0)
        assert top.bound - top.seen < 0.1 * (coarse.bound - coarse.seen)
