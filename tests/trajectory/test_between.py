"""Bounds of what lies between samples."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.trajectory.laws.between import bounds, highest, slopes


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
