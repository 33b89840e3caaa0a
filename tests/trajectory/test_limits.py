"""Limits and polynomial paths: what they hold, and bad input."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from wbc.trajectory import MotionLimits, PolynomialPath
from wbc.trajectory.paths.path import JoinedPath


def test_limits_of_one_joint_may_be_a_number() -> None:
    assert MotionLimits(velocity=2.0).velocity.tolist() == [2.0]
    assert MotionLimits(velocity=[1, 2]).dof == 2
    assert MotionLimits().dof is None
    assert MotionLimits().for_dof(7).dof is None


def test_scaled_limits() -> None:
    limits = MotionLimits([-1.0], [np.inf], [2.0], None, [np.inf]).scaled(0.5)
    assert (limits.lower.tolist(), limits.upper.tolist(), limits.velocity.tolist()) == ([-1.0], [np.inf], [1.0])
    assert limits.acceleration is None
    assert limits.jerk.tolist() == [np.inf]


def test_limits_keep_their_own_numbers() -> None:
    numbers = np.ones(2)
    limits = MotionLimits(velocity=numbers)
    numbers[0] = 5.0
    assert limits.velocity.tolist() == [1.0, 1.0]


@given(st.integers(0, 2**32 - 1), st.integers(0, 9), st.integers(1, 4), st.integers(1, 3))
@settings(max_examples=15)
def test_polynomial_paths(seed: int, degree: int, pieces: int, dof: int) -> None:
    random = np.random.default_rng(seed)
    knots = np.cumsum(random.uniform(0.1, 1.0, pieces + 1)) - 3.0
    path = PolynomialPath(knots, random.normal(size=(degree + 1, pieces, dof)))
    assert (path.dof, path.degree, path.space) == (dof, degree, "joints")
    assert path.length == knots[-1] - knots[0]
    s = random.uniform(knots[0], knots[-1], 20)
    at = path.pieces_at(s)
    assert ((knots[at] <= s) & (s <= knots[at + 1])).all()
    for order in range(4):
        ours = path.evaluate(s, order)
        assert ours.shape == (20, dof)
        for i, k in np.ndindex(20, dof):
            p = np.poly1d(path.coefficients[:, at[i], k]).deriv(order)
            assert ours[i, k] == pytest.approx(p(s[i] - knots[at[i]]), rel=1e-9, abs=1e-9)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=15)
def test_joined_paths_are_their_parts(seed: int) -> None:
    """However they are nested: knots are on the side that they belong to, and the gaps between are of nobody."""
    random = np.random.default_rng(seed)
    parts = []
    for _ in range(4):
        knots = np.cumsum(random.uniform(0.1, 1.0, random.integers(2, 5))) * 10.0 ** random.integers(-2, 3)
        parts.append(PolynomialPath(knots, random.normal(size=(3, len(knots) - 1, 2))))
    a, b, c, d = parts
    for joined in (JoinedPath(JoinedPath(a, b), JoinedPath(c, d)), JoinedPath(JoinedPath(JoinedPath(a, b), c), d)):
        assert len(joined.gaps) == 3
        begin = 0
        for part in parts:
            knots = joined.knots[begin : begin + len(part.knots)]
            for order in range(3):
                expected = part.evaluate(part.knots, order)
                room = 1e-9 * (1.0 + np.abs(expected).max())
                assert np.abs(joined.evaluate(knots, order) - expected).max() < room
            before = joined.pieces_before(knots, joined.pieces_at(knots))
            ends = np.arange(len(part.knots) - 1) + begin
            assert before.tolist() == [begin, *ends[:-1], ends[-1]]
            begin += len(part.knots)
        gap = joined.knots[joined.gaps]
        assert joined.pieces_at(gap + 1e-9).tolist() == (joined.gaps - 1).tolist()
        assert joined.pieces_at(gap + JoinedPath.GAP - 1e-9).tolist() == (joined.gaps + 1).tolist()
