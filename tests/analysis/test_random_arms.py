"""Random arms with random coordinates against a judge of ranks that shares no code with the analysis."""

from __future__ import annotations

import time

import numpy as np
import pinocchio as pin
import pytest

from tests.analysis.random_arms import Case, Judge, random_case
from tests.repeats import repeats
from tests.slow import spent
from wbc.analysis import (
    Analysis,
    BodyRows,
    Budget,
    Exact,
    ExactModel,
    JointRows,
    LocusBranch,
    Notation,
    Relation,
    Value,
    analyse,
    certify,
)
from wbc.analysis.algebra.deficiency import proved_empty
from wbc.analysis.algebra.half_angles import HalfAngles
from wbc.analysis.algebra.points import angle, form_grid, form_value, real_point
from wbc.analysis.algebra.ring import Coordinate, Poly, TrigRing
from wbc.analysis.algebra.transforms import exact_placement
from wbc.analysis.jacobians.equivalent_rows import split_twists
from wbc.analysis.jacobians.numeric import NumericRows
from wbc.analysis.loci.child import Child
from wbc.errors import RangeError
from wbc.robot import DHRow
from wbc.robots import from_dh, load, operator_arm
from wbc.validation import Array

RING = TrigRing([Coordinate(k, k, str(k + 1)) for k in range(4)])
EXACT = Exact(RING)
HALF = EXACT.half
#: Minutes of one analysis, and processor time that it may be late by [s]
MINUTES, LATE = 0.02, 10.0
#: Arms that were judged wrongly before, and some more
SEEDS = (8, 29, 30, 47, 48, 49, 141, 192)[: repeats(4)]


def case_of(seed: int) -> Case:
    rng = np.random.default_rng(seed)
    return random_case(rng, int(rng.integers(4, 8)))


def holds(half: HalfAngles, branch: LocusBranch, q: Array) -> bool:
    """Whether a configuration is on a branch."""
    off = [abs(np.angle(np.exp(1j * (q[v.joint] - angle(v, half))))) for v in branch.values]
    for r in branch.relations:
        off.append(min(abs(form_value(half, r, q)), 1e3 * abs(float(form_grid(half, r, list(q))))))
    return max(off, default=0.0) < 1e-4


def judged(case: Case, found: Analysis) -> set[str]:
    """Everything that is wrong with an answer."""
    judge, rng, wrong = Judge(case.robot), np.random.default_rng(0), set()
    half, joints = found.exact.half, case.robot.nv
    lost = judge.lost(case.rows, rng)
    task = np.linalg.svd(judge.value(case.task, lost), compute_uv=False) if len(lost) else np.empty((0, 1))
    for q in lost:
        if not any(holds(half, b, q) for b in (*found.locus.branches, *found.locus.open)):
            wrong.add("rank is lost off every branch")
    for branch in found.locus.branches:
        for point in filter(lambda p: p is not None, (real_point(half, branch, rng) for _ in range(4))):
            sigma = np.linalg.svd(judge.value(case.rows, point[None])[0], compute_uv=False)
            if sigma[joints - 1] > 1e-7 * sigma[0]:
                wrong.add("full rank on a branch")
    if found.verdict == "strict" and len(lost):
        wrong.add("strict, and rank is lost")
    if found.verdict == "loose" and (task[:, -1] > 1e-4 * task[:, 0]).any():
        wrong.add("loose, and the task keeps its rank where rank is lost")
    if found.verdict == "complete":
        assert found.certificate is not None
        if (task[:, -1] > found.certificate.eps).any():
            wrong.add("complete, and rank is lost outside the tube")
    if found.witness is not None:
        own, every = (
            np.linalg.svd(judge.value(rows, found.witness.q[None])[0], compute_uv=False)
            for rows in (case.task, case.rows)
        )
        if own[-1] < 1e-8 * own[0] or every[-1] > 1e-8 * every[0]:
            wrong.add("a witness that is none")
    return wrong


@pytest.mark.parametrize("seed", SEEDS)
def test_answers_of_random_arms(seed: int) -> None:
    case = case_of(seed)
    began = spent()
    q = np.random.default_rng(1).uniform(-np.pi, np.pi, (50, case.robot.nv))
    if np.linalg.svd(Judge(case.robot).value(case.task, q), compute_uv=False)[:, -1].max() < 1e-9:
        with pytest.raises(RangeError, match="task"):
            analyse(ExactModel(case.robot), case.task, case.constraints)
        return
    found = analyse(ExactModel(case.robot), case.task, case.constraints, budget=Budget(minutes=MINUTES))
    assert spent() - began < 60.0 * MINUTES + LATE
    assert judged(case, found) == set()


def test_the_judge_agrees_with_pinocchio() -> None:
    rng = np.random.default_rng(0)
    for joints in (4, 5, 6, 7):
        case = random_case(rng, joints, right_angles=False)
        q = rng.uniform(-np.pi, np.pi, (3, joints))
        for found, at in zip(Judge(case.robot).value(case.rows, q), q, strict=True):
            np.testing.assert_allclose(found, NumericRows(case.robot).value(case.rows, at), atol=1e-12)


@pytest.mark.parametrize(("robot", "tip", "point"), [("ssrms", "tip", "F5"), ("panda", "panda_link7", "panda_link5")])
def test_a_point_near_the_tip_does_not_lose_rank_everywhere(robot: str, tip: str, point: str) -> None:
    """The point's own velocity is among its equivalents: v of the tip cannot be had without it."""
    arm = operator_arm(robot).robot if robot == "ssrms" else load(robot)
    task, rows = (BodyRows(tip),), (JointRows(arm.dof_names[0]), BodyRows(point, rotation=()))
    model = ExactModel(arm)
    found = analyse(model, task, rows)
    assert found.verdict == "incomplete"
    assert LocusBranch() not in (*found.locus.branches, *found.locus.open)
    numeric, rng = NumericRows(arm), np.random.default_rng(0)
    splits = list(split_twists(model, (*task, *rows)))
    assert splits
    for q in rng.uniform(-np.pi, np.pi, (3, arm.nv)):
        for together in ((*task, *rows), *splits):
            assert np.linalg.svd(numeric.value(together, q), compute_uv=False)[-1] > 1e-3


def test_rows_that_leave_columns_without_one_are_never_complete() -> None:
    """Joints with parallel axes: omega has one row that is a number, and the other joints have none."""
    robot = from_dh([DHRow(a=1.0), DHRow(a=0.8), DHRow(a=0.5)])
    task = (BodyRows("tip", expressed="link3", translation=(), rotation=(2,)),)
    points = (BodyRows("link1", rotation=()),)
    assert certify(ExactModel(robot), task, points, workers=1).verdict == "incomplete"
    assert analyse(ExactModel(robot), task, points).verdict == "incomplete"


def test_a_task_of_full_rank_nowhere_is_refused() -> None:
    robot = from_dh([DHRow(a=1.0), DHRow(a=0.8), DHRow(a=0.5)])
    for ask in (analyse, certify):
        with pytest.raises(RangeError, match="rank 2 at most"):
            ask(ExactModel(robot), [BodyRows("tip", rotation=())], [JointRows("joint1")])


def test_lengths_of_rounding_size_are_no_lengths() -> None:
    """0.4 cos(pi/2) is 2e-17."""
    place = pin.SE3(np.eye(3), np.array([2.4e-17, 0.4, -1e-3]))
    assert [str(p) for p in exact_placement(RING, place, "frame", False, []).position] == ["0", "2/5", "-1/1000"]


def relation(p: Poly) -> Relation:
    (found,) = [c for c, _ in HALF.factors(p).conditions]
    assert isinstance(found, Relation)
    return found


def test_a_root_at_pi_stays_when_another_joint_gets_a_value() -> None:
    """2 s1 - 3 s2 + s12 = 0 at q1 = pi: -4 s2 = 0, which has the root pi as well as 0."""
    c, s = RING.cosine, RING.sine
    one = relation(2 * s(0) - 3 * s(1) + s(0) * c(1) + c(0) * s(1))
    found = EXACT.branches.with_condition(LocusBranch((), (one,)), Value(0, None))
    assert {b.values[1].value for b in found} == {0, None}


def test_angles_are_solved_for() -> None:
    c, s = RING.cosine, RING.sine
    text = Notation(HALF)
    same = [r for r, _ in HALF.factors(RING.normal(s(0) * c(1) - c(0) * s(1))).conditions]
    assert {text.relation(r) for r in same if isinstance(r, Relation)} == {"q1 = q2", "q1 = pi + q2"}
    # c1 + c12 = 2 cos(q1 + q2/2) cos(q2/2)
    sums = [r for r, _ in HALF.factors(RING.normal(c(0) + c(0) * c(1) - s(0) * s(1))).conditions]
    assert [text.relation(r) for r in sums if isinstance(r, Relation)] == ["q2 = pi - 2 q1"]
    assert [text.solved(r) for r in sums if isinstance(r, Relation)] == [""]
    assert (
        Notation(HALF, latex=True).relation(next(r for r in sums if isinstance(r, Relation)))
        == r"q_{2} = \pi - 2 q_{1}"
    )
    assert text.joints(["a", "b"]) == "q1 = a, q2 = b"


def test_relations_without_a_common_solution_are_proved_empty() -> None:
    c, s = RING.cosine, RING.sine
    high, low = relation(4 + 2 * c(0) + 1 * s(1) + c(0) * s(2)), relation(3 * c(0) + 2 * s(1) - 1)
    assert proved_empty(HALF, (high,), 4000) == bool(4 - 2 - 1 - 1 > 0)
    assert proved_empty(HALF, (relation(5 + 2 * c(0) + s(1) + c(0) * s(2)),))
    assert not proved_empty(HALF, (low,))
    assert proved_empty(HALF, (low, relation(c(0) + s(1) + RING.number(1.9))))


def test_work_in_a_process_ends_at_its_time() -> None:
    def endless(tell: object) -> None:
        assert callable(tell)
        tell("begun")
        while True:
            pass

    began = time.monotonic()
    with Child(endless, 0.3) as child:
        child.wait(5.0)
    assert time.monotonic() - began < 3.0
    assert (child.reports, child.done) == (["begun"], False)

    def wrong(tell: object) -> None:
        raise RangeError("symbols", 1, "wrong")

    with Child(wrong, 5.0) as child, pytest.raises(RangeError, match="symbols"):
        child.wait(5.0)
