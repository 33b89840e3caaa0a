"""Trees of arms decided by blocks: ranks add up, verdicts hold on the whole robot, rows without blocks are named."""

from __future__ import annotations

import numpy as np
import pytest

from wbc.analysis import BodyRows, ExactModel, JointRows, PitchPlaneRows, Rows, analyse_blocks, joint_blocks
from wbc.analysis.jacobians.numeric import NumericRows, rank
from wbc.coordinates import tree_sets
from wbc.errors import RangeError, ShapeError, UnknownNameError
from wbc.robots import operator_arm
from wbc.validation import Array

TREE = tree_sets("spdm_on_ssrms")


def rows_of(chosen: str) -> tuple[Rows, ...]:
    """Of a set on all 22 joints, task first."""
    return (*TREE.sets[chosen].task, *TREE.sets[chosen].constraints)


def single(prefix: str, rows: tuple[Rows, ...]) -> list[Rows]:
    """Rows of one arm of the tree, on that arm by itself."""
    out: list[Rows] = []
    for r in rows:
        if isinstance(r, JointRows):
            out.append(JointRows(r.joint.removeprefix(prefix)))
        elif isinstance(r, PitchPlaneRows):
            out.append(PitchPlaneRows(r.shoulder.removeprefix(prefix), r.wrist.removeprefix(prefix)))
        else:
            axes = None if r.expressed is None else r.expressed.removeprefix(prefix)
            out.append(BodyRows(r.frame.removeprefix(prefix), "world", axes, r.translation, r.rotation))
    return out


def places() -> list[Array]:
    """Random configurations of 22 joints, and such where the carrier, an arm, or all three lose rank."""
    rng = np.random.default_rng(4)
    q = rng.uniform(-np.pi, np.pi, (12, 22))
    for at in (q[3:6], q[9:]):
        at[:, 2:5] = np.pi / 2, 0.0, -np.pi / 2
    for at in (q[6:9], q[9:]):
        at[:, 11] = 0.0
    q[9:, 18] = np.pi
    return list(q)


@pytest.mark.parametrize("chosen", ["elbow, beta, gamma", "arms alpha"])
def test_ranks_of_blocks_add_up(chosen: str) -> None:
    """The blocks are measured on the arms by themselves, the whole by Pinocchio on 22 joints."""
    rows = rows_of(chosen)
    blocks = joint_blocks(TREE.robot, rows)
    names = [(b.joints[0], len(b.joints)) for b in blocks]
    assert names == [("carrier_joint1", 7), ("body_joint", 1), ("arm1_joint1", 7), ("arm2_joint1", 7)]
    assert sorted(map(str, rows)) == sorted(str(r) for b in blocks for r in b.rows)
    whole = NumericRows(TREE.robot)
    alone = {"carrier_": "ssrms", "arm1_": "spdm_arm", "arm2_": "spdm_arm"}
    seen = set()
    for q in places():
        total = 1  # of the body's lock
        for block in (blocks[0], *blocks[2:]):
            prefix = block.joints[0].removesuffix("joint1")
            start = TREE.robot.dofs(block.joints[0]).start
            part = NumericRows(operator_arm(alone[prefix]).robot)
            total += rank(part.value(single(prefix, block.rows), q[start : start + 7]))
        assert rank(whole.value(rows, q)) == total
        seen.add(total)
    assert seen == ({22, 21} if chosen == "elbow, beta, gamma" else {22, 21, 19})


@pytest.mark.parametrize(
    ("chosen", "verdict", "shape"),
    [
        ("elbow, beta, gamma", "incomplete", (36, 22)),
        ("elbow, beta, gamma, tip in task", "loose", (36, 22)),
        ("elbow, q1, q2, q7", "strict", (37, 22)),
    ],
)
def test_verdicts_hold_on_all_joints(chosen: str, verdict: str, shape: tuple[int, int]) -> None:
    one = TREE.sets[chosen]
    found = analyse_blocks(ExactModel(TREE.robot), one.task, one.constraints)
    assert (found.verdict, found.shape) == (verdict, shape)
    assert found.parted == (verdict == "loose")
    assert [b.verdict for b in found.blocks[1:]] == ["strict"] * 3
    numeric, rows = NumericRows(TREE.robot), rows_of(chosen)
    if found.witness is not None:
        assert str(found.lost) == "carrier_joint1 ... carrier_joint7"
        assert rank(numeric.value(one.task, found.witness.q)) == 12
        assert rank(numeric.value(rows, found.witness.q)) == 21
        return
    assert verdict != "incomplete"
    q = np.random.default_rng(5).uniform(-np.pi, np.pi, (200, 22))
    # Where the carrier set of the other two loses rank
    q[:100, 2:5] = np.pi / 2, 0.0, -np.pi / 2
    expected = 22 if verdict == "strict" else 21
    assert {rank(numeric.value(rows, at)) for at in q[:100]} == {expected}
    assert {rank(numeric.value(rows, at)) for at in q[100:]} == {22}
    if verdict == "loose":
        assert {rank(numeric.value(one.task, at)) for at in q[:100]} == {17}


def test_two_arms_on_a_body_that_is_locked() -> None:
    """15 joints: the lock of the body makes blocks of the arms without its twist among the rows."""
    tree = tree_sets("spdm")
    for chosen, verdict in (("alpha, q1, q7, elbow", "strict"), ("alpha", "incomplete")):
        one = tree.sets[chosen]
        found = analyse_blocks(ExactModel(tree.robot), one.task, one.constraints)
        assert (found.verdict, len(found.blocks)) == (verdict, 3)
        if found.witness is not None:
            numeric = NumericRows(tree.robot)
            assert rank(numeric.value(one.task, found.witness.q)) == 12
            assert rank(numeric.value((*one.task, *one.constraints), found.witness.q)) < 15


def test_rows_that_leave_no_blocks_are_named() -> None:
    model = ExactModel(TREE.robot)
    one = TREE.sets["elbow, beta, gamma"]
    without = [r for r in one.constraints if str(r) != "carrier_xi"]
    with pytest.raises(RangeError, match="carriers without them: carrier_joint7") as caught:
        analyse_blocks(model, one.task, without)
    assert caught.value.value == "arm1_xi"
    height = BodyRows("arm1_end3", expressed="world", translation=(2,), rotation=(), name="height")
    between = BodyRows("arm1_tip", base="arm2_tip", name="between")
    for bad in (height, between):
        with pytest.raises(RangeError) as caught:
            analyse_blocks(model, one.task, (*one.constraints, bad))
        assert caught.value.value == str(bad)
    with pytest.raises(RangeError, match="no row depends") as caught:
        analyse_blocks(model, one.task, [r for r in one.constraints if str(r) != "body_joint"])
    assert caught.value.value == "body_joint"
    with pytest.raises(RangeError, match="no joint moves it"):
        joint_blocks(TREE.robot, [BodyRows("base")])
    with pytest.raises(ShapeError):
        analyse_blocks(model, one.task, [])
    with pytest.raises(UnknownNameError, match="sub_determinants"):
        analyse_blocks(model, one.task, one.constraints, algorithm="subdeterminants")
    with pytest.raises(UnknownNameError, match="spdm_on_ssrms"):
        tree_sets("spdm_on_ssrm")
