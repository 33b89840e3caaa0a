"""The Singular Vector Algorithm beyond the small arms, and what ends a search that is too long."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from tests.analysis.jacobians import jacobians
from wbc.analysis import (
    ALGORITHMS,
    Analysis,
    Budget,
    Exact,
    ExactModel,
    LocusBranch,
    Notation,
    analyse,
    candidate_rows,
    published_sets,
)
from wbc.analysis.jacobians.numeric import rank
from wbc.analysis.loci.loci import Loci, loci
from wbc.errors import RangeError


def run(name: str, chosen: str, algorithm: str, budget: Budget | None = None) -> Analysis:
    sets = published_sets(name)
    rows = sets.sets.get(chosen) or (candidate_rows(name)[chosen],)
    return analyse(ExactModel(sets.robot, sets.symbols), sets.task, rows, algorithm=algorithm, budget=budget)


def known(name: str, chosen: str, algorithm: str, budget: Budget) -> Loci:
    """What the exact method alone knows."""
    sets = published_sets(name)
    rows = (*sets.task, *sets.sets[chosen])
    return loci(ExactModel(sets.robot, sets.symbols), sets.task, rows, algorithm, budget)


@pytest.mark.parametrize(("chosen", "verdict"), [("alpha, q1, q7", "incomplete"), ("alpha, q1, q7, elbow", "strict")])
def test_both_algorithms_find_one_locus_of_the_dexterous_arm(chosen: str, verdict: str) -> None:
    """With all offsets; beyond (4.41)."""
    one, other = (run("spdm_arm", chosen, algorithm) for algorithm in ALGORITHMS)
    assert one.verdict == other.verdict == verdict
    assert set(one.locus.branches) == set(other.locus.branches)
    assert not one.locus.open
    assert not other.locus.open


def test_singular_vectors_end_on_the_space_station_arm() -> None:
    """11 x 7, (4.33): the published program never converged on it."""
    found = known("ssrms", "elbow, beta, gamma", "singular_vectors", Budget())
    assert Notation(found.exact.half).branches(found.locus.branches) == [
        "q3 = +-pi/2 and q4 in {0, pi} and q5 = +-pi/2"
    ]
    assert (found.verdict, found.locus.open) == ("loose", ())


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_budget_leaves_branches_open_and_keeps_what_is_known(algorithm: str) -> None:
    """The elbow alone on the Space Station arm: long relations; a witness is found on what is known."""
    found = run("ssrms", "elbow", algorithm, Budget(12))
    assert found.verdict == "incomplete"
    assert found.witness is not None
    J_T, J_R = jacobians("ssrms", "q1", found.witness.q)[0], found.witness.augmented
    assert rank(J_T) == 6
    assert J_R[-1] < 1e-9 * J_R[0]
    assert found.locus.open
    cut = known("spherical_4r", "alpha, beta", algorithm, Budget(1))
    assert (cut.verdict, bool(cut.locus.open)) == ("undecided", True)
    # What the exact method leaves open is decided by numbers
    assert run("spherical_4r", "alpha, beta", algorithm, Budget(1)).verdict == "complete"


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("after", [0, 3])
def test_a_keyboard_interrupt_is_answered_with_what_is_known(
    algorithm: str, after: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    original: Callable[..., list[LocusBranch]] = Exact.extended
    calls = 0  # of the process that searches

    def extended(self: Exact, *arguments: object) -> list[LocusBranch]:
        nonlocal calls
        calls += 1
        if calls == after + 1:
            raise KeyboardInterrupt
        return original(self, *arguments)

    monkeypatch.setattr(Exact, "extended", extended)
    found = known("spherical_4r", "alpha, beta", algorithm, Budget())
    assert found.verdict == "undecided"
    lines = Notation(found.exact.half).branches(found.locus.open)
    assert lines
    assert (lines == ["everywhere"]) == (after == 0)


def test_open_branches_contain_all_that_was_not_decided() -> None:
    """On 4R every branch of the whole locus lies within a branch of the cut one, or within an open one."""
    for algorithm in ALGORITHMS:
        whole = known("spherical_4r", "elbow, beta", algorithm, Budget())
        for most in (1, 2, 4, 7):
            cut = known("spherical_4r", "elbow, beta", algorithm, Budget(most))
            every = (*cut.locus.branches, *cut.locus.open)
            arithmetic = cut.exact.branches
            assert all(any(arithmetic.within(b, k) for k in every) for b in whole.locus.branches)
            assert all(any(arithmetic.within(b, w) for w in whole.locus.branches) for b in cut.locus.branches)


def test_budgets_out_of_range() -> None:
    for number in (0, -1):
        with pytest.raises(RangeError, match="branches"):
            Budget(number)
    for minutes in (0.0, -1.0):
        with pytest.raises(RangeError, match="minutes"):
            Budget(1, minutes)
    spent = Budget(5, 1e-9)
    spent.start()
    assert not np.any([spent.take() for _ in range(3)])
    few = Budget(2)
    assert [few.take() for _ in range(3)] == [True, True, False]
