"""Verdicts and witnesses."""

from __future__ import annotations

import numpy as np
import pytest

from tests.analysis.jacobians import jacobians
from wbc.analysis import ExactModel, JointRows, analyse, published_sets
from wbc.analysis.jacobians.equivalent_rows import split_twists
from wbc.analysis.jacobians.numeric import NumericRows, rank
from wbc.errors import RangeError, ShapeError, UnknownNameError

VERDICTS = {
    ("planar_3r", "middle"): "loose",
    ("spherical_4r", "alpha"): "incomplete",
    ("spherical_4r", "alpha, beta"): "loose",
    ("spherical_4r", "elbow, beta"): "loose",
    ("ssrms", "q1, q2"): "incomplete",
    ("spdm_arm_simplified", "alpha, q1, q7"): "incomplete",
    ("spdm_arm_simplified", "alpha, q1, q7, elbow"): "strict",
    ("spdm_arm", "alpha, q1, q7, elbow"): "strict",
}


@pytest.mark.parametrize(("name", "chosen"), VERDICTS)
def test_verdicts_and_their_witnesses(name: str, chosen: str) -> None:
    sets = published_sets(name)
    found = analyse(ExactModel(sets.robot, sets.symbols), sets.task, sets.sets[chosen])
    assert found.verdict == VERDICTS[name, chosen]
    assert (found.witness is None) == (found.verdict != "incomplete")
    if found.witness is not None:
        J_T, J_R = jacobians(name, chosen, found.witness.q)
        assert rank(J_T) == J_T.shape[0]
        assert rank(J_R) < sets.robot.nv
        np.testing.assert_allclose(found.witness.task, np.linalg.svd(J_T, compute_uv=False), atol=1e-12)


def test_a_robot_without_symbols_gives_the_same_verdict_and_both_algorithms_do() -> None:
    sets = published_sets("spherical_4r")
    model = ExactModel(sets.robot)
    for algorithm in ("sub_determinants", "singular_vectors"):
        assert analyse(model, sets.task, sets.sets["alpha, beta"], algorithm=algorithm).verdict == "loose"


def test_bad_requests() -> None:
    sets = published_sets("ssrms")
    model = ExactModel(sets.robot)
    with pytest.raises(UnknownNameError, match="sub_determinants"):
        analyse(model, sets.task, sets.sets["q1"], algorithm="subdeterminants")
    with pytest.raises(RangeError):
        analyse(model, [JointRows("joint1")], [JointRows("joint2")])
    with pytest.raises(ShapeError):
        analyse(model, sets.task, [])
    with pytest.raises(UnknownNameError):
        published_sets("ssrm")


def test_rows_and_their_splits_lose_rank_together() -> None:
    """On the Space Station arm, at random configurations and on the locus of (4.33)."""
    sets = published_sets("ssrms")
    model, rng = ExactModel(sets.robot, sets.symbols), np.random.default_rng(0)
    rows = (*sets.task, *sets.sets["elbow, beta, gamma"])
    splits = list(split_twists(model, rows))
    assert len(splits) == 8
    places = rng.uniform(-np.pi, np.pi, (4, 7))
    places[2:, 2:5] = [(np.pi / 2, 0.0, np.pi / 2), (-np.pi / 2, np.pi, np.pi / 2)]
    for q, expected in zip(places, (7, 7, 6, 6), strict=True):
        assert rank(NumericRows(sets.robot).value(rows, q)) == expected
        assert {rank(NumericRows(sets.robot).value(split, q)) for split in splits} == {expected}
