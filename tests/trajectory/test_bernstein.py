"""Bounds of polynomials from their Bernstein coefficients."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tests.trajectory.random_laws import powers
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
