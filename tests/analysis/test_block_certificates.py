"""Certificates of trees block by block: verdicts on the whole robot, tubes, witnesses, resumption."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from wbc.analysis import BodyRows, ExactModel, JointRows, analyse_blocks, certify, certify_blocks
from wbc.analysis.jacobians.numeric import NumericRows, rank, singular_values
from wbc.errors import RangeError, RobotFileError
from wbc.robot import Limits, Robot

LENGTHS = (1.0, 0.8, 0.5)
TIPS = tuple(BodyRows(f"arm{k}_tip", expressed=f"arm{k}_F3", translation=(0, 1), rotation=()) for k in (1, 2))
MIDDLES = tuple(BodyRows(f"arm{k}_middle", expressed=f"arm{k}_F3", translation=(0, 1), rotation=()) for k in (1, 2))
LOCK = JointRows("body")


def two_arms() -> Robot:
    """Two planar 3R arms on a body that turns: 7 joints."""
    model = pin.Model()

    def joint(parent: int, x: float, name: str) -> int:
        added = model.addJoint(parent, pin.JointModelRZ(), at(x), name)
        model.addJointFrame(added)
        return int(added)

    def frame(parent: int, x: float, name: str) -> None:
        model.addFrame(pin.Frame(name, parent, model.getFrameId(model.names[parent]), at(x), pin.FrameType.OP_FRAME))

    def at(x: float) -> pin.SE3:
        return pin.SE3(np.eye(3), np.array([x, 0.0, 0.0]))

    body = joint(0, 0.0, "body")
    for k, side in ((1, 1.0), (2, -1.0)):
        parent, place = body, side
        for i, length in enumerate(LENGTHS, start=1):
            parent, place = joint(parent, place, f"arm{k}_joint{i}"), length
            if i == 2:
                frame(parent, 0.5 * length, f"arm{k}_middle")
        frame(parent, 0.0, f"arm{k}_F3")
        frame(parent, place, f"arm{k}_tip")
    free = np.full(model.nv, np.inf)
    return Robot("two arms", model, Limits(-free, free, free, free, free))


@pytest.fixture(scope="module")
def model() -> ExactModel:
    return ExactModel(two_arms())


def test_a_task_in_the_blocks_has_a_tube_in_each(model: ExactModel) -> None:
    """The lock is part of the task, so both fall into blocks; the exact method says loose."""
    told: list[str] = []
    task = (*TIPS, LOCK)
    found = certify_blocks(model, task, MIDDLES, workers=1, progress=lambda block, part: told.append(str(block)))
    assert analyse_blocks(model, task, MIDDLES).verdict == "loose"
    assert (found.verdict, found.parted, found.everywhere, found.left) == ("complete", True, False, 0.0)
    assert [str(b) for b, _ in found.blocks] == ["body", "arm1_joint1 ... arm1_joint3", "arm2_joint1 ... arm2_joint3"]
    body, arm, other = (own for _, own in found.blocks)
    assert (body.everywhere, arm.everywhere) == (True, False)
    assert arm is other
    assert told
    assert arm.eps == pytest.approx(0.01 * arm.peak)
    assert arm.counts.tube > 0
    assert found.witness is None


def test_a_task_across_blocks_fails_where_the_body_helps_it(model: ExactModel) -> None:
    """With the lock as a constraint both tips keep full rank where an arm is stretched: the body moves them."""
    found = certify_blocks(model, TIPS, (*MIDDLES, LOCK), workers=1)
    assert (found.verdict, found.parted) == ("incomplete", False)
    assert analyse_blocks(model, TIPS, (*MIDDLES, LOCK)).verdict == "incomplete"
    assert [own.verdict for _, own in found.blocks] == ["complete", "incomplete", "incomplete"]
    assert str(found.lost) == "arm1_joint1 ... arm1_joint3"
    assert found.witness is not None
    numeric = NumericRows(model.robot)
    J_T = numeric.value(TIPS, found.witness.q)
    assert rank(J_T) == 4
    assert singular_values(J_T)[-1] >= found.eps > 0.0
    assert rank(numeric.value((*TIPS, *MIDDLES, LOCK), found.witness.q)) == 6


def test_going_on_from_files_of_the_blocks(model: ExactModel, tmp_path: Path) -> None:
    task, file = (*TIPS, LOCK), tmp_path / "tree.npz"
    cut = certify_blocks(model, task, MIDDLES, minutes=1e-6, workers=1, state=file)
    assert cut.verdict == "undecided"
    assert 0.0 < cut.left < 1.0
    assert [p.name for p in tmp_path.iterdir()] == ["tree-arm1_joint1.npz"]
    whole = certify_blocks(model, task, MIDDLES, workers=1, state=file)
    assert (whole.verdict, whole.left) == ("complete", 0.0)
    assert whole.blocks[1][1].counts.boxes > cut.blocks[1][1].counts.boxes
    with pytest.raises(RobotFileError, match="another"):
        certify_blocks(model, task, MIDDLES, part=0.02, workers=1, state=file)


def test_rows_without_blocks_and_bad_numbers(model: ExactModel) -> None:
    with pytest.raises(RangeError, match="so there are no blocks"):
        certify_blocks(model, TIPS, MIDDLES)
    with pytest.raises(RangeError, match="part"):
        certify_blocks(model, (*TIPS, LOCK), MIDDLES, part=1.0)


def test_without_a_task_the_witness_is_of_the_rows_alone(model: ExactModel) -> None:
    rows = (TIPS[0], TIPS[1], *MIDDLES, LOCK)
    found = certify(model, (), rows, workers=1)
    assert (found.verdict, found.eps) == ("incomplete", 0.0)
    assert found.witness is not None
    assert len(found.witness.task) == 0
    assert rank(NumericRows(model.robot).value(rows, found.witness.q)) < 7
