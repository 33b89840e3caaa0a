"""Rank analysis of the published arms by symbols: E. Dupuis, "A General Framework for the Manual Teleoperation of
Kinematically Redundant Space-Based Manipulators", PhD thesis, McGill University, 2001, chapters 3 and 4.

Where a printed locus or formula is wrong, the corrected one is what comes out, and the printed one is shown to fail.
"""

from __future__ import annotations

import time
from functools import cache
from math import atan2, cos, pi, sin

import numpy as np
import pytest

from tests.analysis.jacobians import jacobians
from wbc import analysis
from wbc.analysis.algebra.points import real_point
from wbc.analysis.jacobians.numeric import NumericRows, rank

STATE = np.array([0.3, 0.4, -0.5, 1.2, 0.7, -0.6, 0.9])
L, D = 7.11, -0.7026


def lines(found: analysis.Analysis) -> set[str]:
    return set(analysis.Notation(found.exact.half).branches(found.locus.branches))


@cache
def run(name: str, chosen: str) -> analysis.Analysis:
    sets = analysis.published_sets(name)
    return analysis.analyse(analysis.ExactModel(sets.robot, sets.symbols), sets.task, sets.sets[chosen])


#: det of task and one constraint; alpha without its factor 1/|r|, |r| = L sqrt(2 (1 + c4)) or its like
DETERMINANTS = {
    ("spherical_4r", "alpha"): "L3 L4 c2 s4 (L3^2 + 2 L3 L4 c4 + L4^2)",
    ("ssrms_simplified", "alpha"): "2 L^4 c2 s4 c6 (1 + c4)",
    ("ssrms", "q1"): "L^2 s4 c6 (L (c3 + c34) + D s345)",
    ("ssrms", "q2"): "L^2 c2 s4 c6 (L (s3 + s34) + D (1 - c345))",
    ("ssrms", "alpha"): "L^3 c2 s4 c6 (2 L (1 + c4) + D (s3 + s5 + s34 + s45))",
    ("spdm_arm_simplified", "q1"): "L^2 s4 c6 (L (c3 + c34) + D c345)",
    ("spdm_arm_simplified", "q2"): "L^2 c2 s4 c6 (L (s3 + s34) + D s345)",
    ("spdm_arm_simplified", "alpha"): "L^3 c2 s4 c6 (2 L (1 + c4) + D (c5 + c45))",
    ("spdm_arm", "q1"): "1/20 L^2 s4 c6 (20 L (c3 + c34) + 20 D c345 + s345)",
}


@pytest.mark.parametrize(("name", "chosen"), DETERMINANTS)
def test_determinants_in_factors(name: str, chosen: str) -> None:
    """Sections 4.3 to 4.6; the last one is of the arm with all offsets, on which the published programs failed."""
    sets = analysis.published_sets(name)
    model = analysis.ExactModel(sets.robot, sets.symbols)
    rows = (*sets.task, *sets.sets[chosen])
    J = analysis.symbolic_jacobian(model, rows)
    det = analysis.factored_determinant(analysis.Exact(model.ring), J)
    assert det.text() == DETERMINANTS[name, chosen]
    q = STATE[: model.robot.nv]
    numeric = abs(np.linalg.det(NumericRows(model.robot).value(rows, q)))
    assert abs(model.ring.value(det.poly, list(q))) == pytest.approx(numeric, rel=1e-12)


def test_a3_planar_arm_and_rows_of_its_middle() -> None:
    """det of rows 2 to 4 is L1 L2 L3 s2 / 2; the task's entry (2, 2) in the axes of link 3 is printed without L3."""
    sets = analysis.published_sets("planar_3r")
    model = analysis.ExactModel(sets.robot, sets.symbols)
    J = analysis.symbolic_jacobian(model, (*sets.task, *sets.sets["middle"]))
    assert str(J.matrix[1][1]) == "c3*L2 + L3"
    square = analysis.SymbolicJacobian(J.ring, J.matrix[1:], J.names[1:], J.axes)
    det = analysis.factored_determinant(analysis.Exact(model.ring), square)
    assert det.text() == "2/5 L1 L3 s2"  # L2 = 0.8, the middle at 0.4
    assert abs(model.ring.value(det.poly, [0.3, 0.7, -0.4])) == pytest.approx(0.1288435374, abs=1e-10)
    for chosen in ("sub_determinants", "singular_vectors"):
        found = analysis.analyse(model, sets.task, sets.sets["middle"], algorithm=chosen)
        assert lines(found) == {"q2 in {0, pi} and q3 in {0, pi}"}
        assert found.verdict == "loose"


def test_a14_alpha_and_beta_complete_the_spherical_arm_on_more_than_is_printed() -> None:
    """(4.10) repeats the second branch of (4.2); on it the set has full rank, so it is no branch."""
    found = run("spherical_4r", "alpha, beta")
    assert lines(found) == {"q4 in {0, pi}"}
    sets = analysis.published_sets("spherical_4r")
    task = analysis.symbolic_jacobian(analysis.ExactModel(sets.robot, sets.symbols), sets.task)
    printed = [b for b in analysis.sub_determinant_locus(found.exact, task.matrix).branches if b.relations]
    assert len(printed) == 2
    rng = np.random.default_rng(0)
    for branch in printed:
        assert not found.exact.deficient(found.augmented.matrix, branch)
        points = [p for p in (real_point(found.exact.half, branch, rng) for _ in range(8)) if p is not None]
        assert {tuple(rank(J) for J in jacobians("spherical_4r", "alpha, beta", p)) for p in points} == {(2, 4)}


def test_a15_simplified_space_station_arm() -> None:
    """(4.20) and (4.21)."""
    sets = analysis.published_sets("ssrms_simplified")
    model = analysis.ExactModel(sets.robot, sets.symbols)
    exact = analysis.Exact(model.ring)
    task = analysis.sub_determinant_locus(exact, analysis.symbolic_jacobian(model, sets.task).matrix)
    assert set(analysis.Notation(exact.half).branches(task.branches)) == {
        "q4 in {0, pi}",
        "q2 = +-pi/2 and q6 = +-pi/2",
        "q2 = +-pi/2 and q4 = pi - 2 q3",
        "q6 = +-pi/2 and q4 = pi - 2 q5",
    }
    found = run("ssrms_simplified", "alpha")
    assert lines(found) == {"q4 in {0, pi}", "q2 = +-pi/2", "q6 = +-pi/2"}
    assert found.verdict == "incomplete"


def test_a16_elbow_beta_gamma_complete_the_simplified_arm() -> None:
    """(4.22), in four lines, all of them where the task is deficient."""
    found = run("ssrms_simplified", "elbow, beta, gamma")
    shoulder, wrist = ("q2 in {0, pi}", "q3 = +-pi/2"), ("q5 = +-pi/2", "q6 in {0, pi}")
    assert lines(found) == {f"{a} and q4 in {{0, pi}} and {b}" for a in shoulder for b in wrist}
    assert found.verdict == "loose"


def test_a21_elbow_beta_gamma_complete_the_space_station_arm() -> None:
    """(4.33), 11 x 7, within 60 s of one core (published: 937 s); the task is deficient there."""
    began = time.process_time()
    found = run("ssrms", "elbow, beta, gamma")
    assert found.augmented.shape == (11, 7)
    assert lines(found) == {"q3 = +-pi/2 and q4 in {0, pi} and q5 = +-pi/2"}
    assert (found.verdict, found.algorithmic) == ("loose", ())
    assert time.process_time() - began < 60.0


def relation_of(found: analysis.Analysis) -> analysis.Relation:
    (relation,) = {r for b in found.locus.branches for r in b.relations}
    return relation


def test_a20_flight_software_and_pitch_plane_of_the_space_station_arm() -> None:
    """(4.30), (4.31) and the corrected (4.32), as loci and as numbers."""
    roll, yaw, plane = (run("ssrms", chosen) for chosen in ("q1", "q2", "alpha"))
    assert lines(roll) == {"q4 in {0, pi}", "q6 = +-pi/2", "L (c3 + c34) + D s345 = 0"}
    assert lines(yaw) == {"q2 = +-pi/2", "q4 in {0, pi}", "q6 = +-pi/2", "L (s3 + s34) + D (1 - c345) = 0"}
    bracket = "2 L cos(q4/2) + D (sin(q3 + q4/2) + sin(q4/2 + q5))"
    assert lines(plane) == {"q2 = +-pi/2", "q4 in {0, pi}", "q6 = +-pi/2", f"{bracket} = 0"}
    solved = analysis.Notation(plane.exact.half).solved(relation_of(plane))
    assert solved == "tan(q4/2) = (-2 L - D (s3 + s5)) / (D (c3 + c5))"
    assert (
        analysis.Notation(roll.exact.half).solved(relation_of(roll))
        == "tan(q3) = (L (1 + c4) + D s45) / (L s4 - D c45)"
    )
    closed = analysis.Notation(yaw.exact.half).solved(relation_of(yaw))
    assert closed == "q5 = atan2(-D s34, D c34) +- acos((L (s3 + s34) + D) / sqrt((D c34)^2 + (-D s34)^2))"
    cases = ((roll, {3: 1.2, 4: 0.7}, 2, -2.187788992), (yaw, {2: -0.55, 3: 1.2}, 4, 0.7548913334))
    for found, changes, joint, value in (*cases, (plane, {2: -0.5, 4: 0.7}, 3, 2.978321908)):
        q = STATE.copy()
        q[list(changes)] = list(changes.values())
        roots = analysis.joint_roots(found.exact.half, relation_of(found), joint, q)
        assert min(abs(r - value) for r in roots) < 1e-8
        assert found.verdict == "incomplete"


def test_a20_the_printed_pitch_plane_formula_is_no_root() -> None:
    """(4.32) as printed: 0.162021849, where det is 86.57 |r|; corrected: 2.978321908."""
    found, (q3, q5) = run("ssrms", "alpha"), (-0.5, 0.7)
    s3, c3, s5, c5 = sin(q3), cos(q3), sin(q5), cos(q5)
    cross = 2 * L * (L + D * (s3 + s5)) + D * D * (s3 * s3 - c5 * c5 + s3 * s5 - c3 * c5)
    corrected = atan2(-D * (c3 + c5) * (2 * L + D * (s3 + s5)), -cross)
    q = STATE.copy()
    q[[2, 4]] = q3, q5
    (root,) = analysis.joint_roots(found.exact.half, relation_of(found), 3, q)
    assert root == pytest.approx(corrected, abs=1e-12)
    assert abs(root - 0.162021849) > 2.8


def test_flight_software_set_is_not_complete() -> None:
    """{q1 lock, q2 lock}: both lose rank at q4 in {0, pi} and at q6 = +-pi/2, where the task does not."""
    found = run("ssrms", "q1, q2")
    assert lines(found) == {"q4 in {0, pi}", "q6 = +-pi/2"}
    assert (found.verdict, len(found.algorithmic)) == ("incomplete", 4)
    assert found.witness is not None
    assert found.witness.task[-1] > 0.1
    assert found.witness.augmented[-1] < 1e-12 * found.witness.augmented[0]


def test_a22_dexterous_arm() -> None:
    """(4.36), (4.39) and (4.37), whose printed arcsine has the wrong sign."""
    roll, yaw, plane = (run("spdm_arm_simplified", chosen) for chosen in ("q1", "q2", "alpha"))
    assert "L (c3 + c34) + D c345 = 0" in lines(roll)
    assert "L (s3 + s34) + D s345 = 0" in lines(yaw)
    assert "2 L cos(q4/2) + D cos(q4/2 + q5) = 0" in lines(plane)
    for found, changes, joint, value in (
        (roll, {3: 1.2, 4: 0.7}, 2, -2.283400310),
        (yaw, {2: -0.62, 3: 1.3}, 4, -0.921118910),
        (plane, {4: 0.7}, 3, 3.022046029),
    ):
        q = STATE.copy()
        q[list(changes)] = list(changes.values())
        roots = analysis.joint_roots(found.exact.half, relation_of(found), joint, q)
        assert min(abs(r - value) for r in roots) < 1e-8
        assert min(abs(r + 0.438881090) for r in roots) > 0.1


def test_a23_dexterous_arm_with_both_rolls() -> None:
    """(4.41) is q4 in {0, pi}; there is more: F6 on F1, an isolated fold of the pitch joints with the task deficient.

    2 L c5 + D = 0, q5 = q3 or q3 + pi, q4 = -2 q3. With the elbow the set is never deficient, offsets or not.
    """
    found = run("spdm_arm_simplified", "alpha, q1, q7")
    folded = "q4 = -2 q3 and 2 L c5 + D = 0"
    assert lines(found) == {"q4 in {0, pi}", f"q3 = q5 and {folded}", f"q3 = pi + q5 and {folded}"}
    assert {v.joint for b in found.algorithmic for v in b.values} == {3}
    fold = np.arccos(-0.1)
    for q3, q5 in ((fold, fold), (pi - fold, -fold)):
        q = np.array([0.2, 0.5, q3, -2 * q3, q5, -0.7, 0.3])
        assert [rank(J) for J in jacobians("spdm_arm_simplified", "alpha, q1, q7", q)] == [5, 6]
    for name in ("spdm_arm_simplified", "spdm_arm"):
        assert run(name, "alpha, q1, q7, elbow").verdict == "strict"


def test_dexterous_arm_with_all_offsets_by_subdivision() -> None:
    """The published programs failed on it. Elbow and both rolls locked suffice at every configuration."""
    sets, rows = analysis.published_sets("spdm_arm"), analysis.candidate_rows("spdm_arm")
    found = analysis.certify(
        analysis.ExactModel(sets.robot), sets.task, [rows[name] for name in ("elbow", "q1", "q7")], workers=1
    )
    assert (found.verdict, found.everywhere, found.joints) == ("complete", True, (2, 3, 4))
    assert found.counts.regular_part == pytest.approx(1.0, abs=1e-9)
