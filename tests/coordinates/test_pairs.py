"""Pairs as declarations, and modes on every robot."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from wbc import WbcError
from wbc.analysis.jacobians.numeric import NumericRows
from wbc.coordinates import (
    Adviser,
    BodyRows,
    CoordinatePair,
    JointRows,
    MissingPartError,
    Mode,
    PairController,
    PitchPlaneRows,
    carry,
    mode_pairs,
    mode_table,
    parts,
)
from wbc.coordinates.control.pair_controller import pair_stack
from wbc.errors import DuplicateNameError, RangeError, ShapeError, UnknownNameError
from wbc.robots import operator_arm
from wbc.robots.operator_arms import OPERATOR_ARMS

ROBOT = operator_arm("ssrms").robot
XI, ALPHA, ROLL = BodyRows("tip", name="xi"), PitchPlaneRows("F3", "F5"), JointRows("joint1")
ELBOW, POINT = BodyRows("end3", rotation=(), name="elbow"), BodyRows("tip", rotation=(), name="point")


def test_a_pair_and_its_swap() -> None:
    pair = CoordinatePair(XI, ALPHA, metric=2.0)
    assert (pair.name, str(pair), pair.counts(ROBOT)) == ("xi | alpha", "xi | alpha", (6, 1))
    assert not pair.over_determined(ROBOT)
    back = pair.swapped()
    assert (back.name, back.task, back.constraint, back.metric) == ("alpha | xi", (ALPHA,), (XI,), None)
    assert CoordinatePair(ELBOW, [XI]).over_determined(ROBOT)
    assert pickle.loads(pickle.dumps(pair)) == pair


@pytest.mark.parametrize("one", [XI, ALPHA, ROLL, CoordinatePair(XI, ALPHA)], ids=str)
def test_kept_hashes_are_those_of_the_fields_and_stay_at_home(one: Any) -> None:
    """Equal declarations have one hash, names apart; copies of other processes do not bring theirs along."""
    other = replace(one, name="another") if one is not XI else BodyRows("tip")
    assert hash(one) == hash(other) == hash(one)
    assert {one: 1}[other] == 1
    assert b"_kept_hash" not in pickle.dumps(one)
    assert copy.copy(one).__dict__ == {k: v for k, v in one.__dict__.items() if k != "_kept_hash"}


def test_one_stack_serves_several_pairs() -> None:
    pair = CoordinatePair(XI, ALPHA)
    made = pair_stack(ROBOT, [pair, pair.swapped(), CoordinatePair(XI, ROLL), CoordinatePair(XI, ALPHA, "m", 0.5)])
    assert list(made.pairs) == ["xi | alpha", "alpha | xi", "xi | joint1", "m"]
    assert set(made.follow.values()) == {"follow xi", "follow alpha", "follow xi by points at 0.5 m"}
    assert set(made.keep.values()) == {"keep alpha", "keep xi", "keep joint1"}
    assert "joint_limits" in made.stack


@pytest.mark.parametrize(
    ("make", "error"),
    [
        (lambda: CoordinatePair("tip", ALPHA), ShapeError),
        (lambda: CoordinatePair((), ALPHA), ShapeError),
        (lambda: CoordinatePair(XI, [ALPHA, XI]), DuplicateNameError),
        (lambda: CoordinatePair(XI, ALPHA, metric=-1.0), RangeError),
        (lambda: CoordinatePair(ELBOW, ALPHA, metric=1.0), RangeError),
        (lambda: CoordinatePair(ROLL, [XI, ALPHA]).counts(ROBOT), RangeError),
        (lambda: CoordinatePair(XI, JointRows("joint8")).counts(ROBOT), UnknownNameError),
        (lambda: pair_stack(ROBOT, []), ShapeError),
        (
            lambda: pair_stack(ROBOT, [CoordinatePair(XI, c, "a") for c in (ROLL, ALPHA)]),
            DuplicateNameError,
        ),
        (lambda: mode_pairs("ssrms", "M9"), UnknownNameError),
        (lambda: mode_pairs("pnda", "M1"), UnknownNameError),
    ],
)
def test_bad_pairs(make: Any, error: type[WbcError]) -> None:
    with pytest.raises(error):
        make()


def test_what_a_robot_has_is_named_where_something_is_missing() -> None:
    with pytest.raises(MissingPartError, match=r"no carrier .* valid: M1 end effector, M2 self-motion, .* M8 over"):
        mode_pairs("ssrms", "M7")
    assert mode_pairs("ssrms", Mode.M2) == mode_pairs("ssrms", "self-motion")


@pytest.mark.parametrize("pair", [CoordinatePair(XI, ()), CoordinatePair(POINT, ALPHA), CoordinatePair(ELBOW, ())])
def test_with_fewer_rows_than_joints_rates_have_the_least_norm(pair: CoordinatePair) -> None:
    """Against the pseudo-inverse of all rows, whose rates are those of task and constraint."""
    assert pair.under_determined(ROBOT)
    numeric, rng = NumericRows(ROBOT), np.random.default_rng(4)
    control = PairController(ROBOT, pair, limits=False, backend="vm")
    adviser = Adviser(ROBOT, [pair], backend="vm")
    for _ in range(5):
        q = rng.uniform(-1.0, 1.0, ROBOT.nv)
        task = 1e-3 * rng.normal(size=pair.counts(ROBOT)[0])
        control.reset(q)
        control.command(task)
        rows = numeric.value(pair.rows, q)
        rates = np.linalg.pinv(rows) @ np.append(task, np.zeros(len(rows) - len(task)))
        assert adviser.sigmas(q)[0] > control.eased_below(pair.name)
        np.testing.assert_allclose(control.step(q).v, rates, atol=1e-7)
    with pytest.raises(RangeError, match="undetermined"):
        carry(ROBOT, q, q + 0.1, [pair])


def test_every_mode_is_there_or_says_what_is_missing() -> None:
    """At a random configuration the rows of every pair determine all joints."""
    table = mode_table()
    assert list(table) == list(OPERATOR_ARMS)
    every = {(name, mode.name): found for name, row in table.items() for mode, found in row.items()}
    missing = {key: found for key, found in every.items() if isinstance(found, str)}
    single = {name for name in OPERATOR_ARMS if not name.startswith("spdm") or "arm" in name}
    tip = "joint beyond those that its tip takes"
    assert missing == {
        ("planar_rp", "M2"): tip,
        **{(name, "M6"): "second arm" for name in single},
        **{(name, "M7"): "carrier" for name in (*single, "spdm")},
    }
    for name, row in table.items():
        robot = parts(name).robot
        q, numeric = np.random.default_rng(1).uniform(-1.0, 1.0, robot.nv), NumericRows(robot)
        for mode, found in row.items():
            for pair in () if isinstance(found, str) else found:
                n, p = pair.counts(robot)
                sigma = np.linalg.svd(numeric.value(pair.rows, q), compute_uv=False)
                assert sigma[-1] > 1e-3, (name, mode, pair.name)
                spatial = mode is Mode.M3 and not name.startswith("planar")
                assert (n + p > robot.nv) == (mode is Mode.M8 or spatial)
