"""Both locus algorithms: the published loci, agreement, and numerical rank on and off the branches."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from wbc.analysis import (
    Budget,
    Exact,
    ExactModel,
    LocusBranch,
    Notation,
    Rows,
    Value,
    published_sets,
    singular_vector_locus,
    sub_determinant_locus,
    symbolic_jacobian,
)
from wbc.analysis.algebra.points import real_point
from wbc.analysis.jacobians.numeric import NumericRows, rank

#: Robot, set ("" for the task alone), and the lines of its locus
LOCI = (
    ("planar_3r", "", {"q2 in {0, pi} and q3 in {0, pi}"}),
    ("planar_3r", "middle", {"q2 in {0, pi} and q3 in {0, pi}"}),
    ("spherical_4r", "", {"q4 in {0, pi}", "q2 = +-pi/2 and L3 c3 + L4 c34 = 0"}),
    ("spherical_4r", "elbow", {"q4 in {0, pi}", "q2 = +-pi/2"}),
    ("spherical_4r", "alpha", {"q4 in {0, pi}", "q2 = +-pi/2"}),
    ("spherical_4r", "alpha, beta", {"q4 in {0, pi}"}),
    ("spherical_4r", "elbow, beta", {"q2 in {0, pi} and q4 in {0, pi}", "q3 = +-pi/2 and q4 in {0, pi}"}),
)


def problem(name: str, chosen: str) -> tuple[Exact, ExactModel, tuple[Rows, ...]]:
    sets = published_sets(name)
    model = ExactModel(sets.robot, sets.symbols)
    return Exact(model.ring), model, (*sets.task, *(sets.sets[chosen] if chosen else ()))


@pytest.mark.parametrize(("name", "chosen", "lines"), LOCI, ids=lambda x: x if isinstance(x, str) else "")
def test_both_algorithms_find_the_published_locus(name: str, chosen: str, lines: set[str]) -> None:
    exact, model, rows = problem(name, chosen)
    matrix = symbolic_jacobian(model, rows).matrix
    found = sub_determinant_locus(exact, matrix)
    assert set(Notation(exact.half).branches(found.branches)) == lines
    assert set(singular_vector_locus(exact, matrix).branches) == set(found.branches)
    assert not found.open


@pytest.mark.parametrize(("name", "chosen"), [(n, c) for n, c, _ in LOCI])
def test_rank_by_singular_values_on_and_off_the_branches(name: str, chosen: str) -> None:
    exact, model, rows = problem(name, chosen)
    numeric, rng = NumericRows(model.robot), np.random.default_rng(1)
    J = symbolic_jacobian(model, rows)
    for branch in sub_determinant_locus(exact, J.matrix).branches:
        points = [p for p in (real_point(exact.half, branch, rng) for _ in range(6)) if p is not None]
        assert points
        assert all(rank(numeric.value(rows, p)) < min(J.shape) for p in points)
    for q in rng.uniform(-np.pi, np.pi, (20, model.robot.nv)):
        assert rank(numeric.value(rows, q)) == min(J.shape)


def test_a_locus_that_the_budget_cuts_short_says_so() -> None:
    exact, model, rows = problem("ssrms_simplified", "elbow, beta, gamma")
    found = sub_determinant_locus(exact, symbolic_jacobian(model, rows).matrix, Budget(3))
    assert found.open


def test_subsets_of_branches() -> None:
    exact, _, _ = problem("spherical_4r", "")
    arithmetic = exact.branches
    wide, narrow = LocusBranch((Value(1, Fraction(0)),)), LocusBranch((Value(1, Fraction(0)), Value(3, None)))
    assert arithmetic.within(narrow, wide)
    assert not arithmetic.within(wide, narrow)
    assert arithmetic.with_condition(wide, Value(1, None)) == []
    assert exact.without_redundant([narrow, wide, narrow]) == [wide]
