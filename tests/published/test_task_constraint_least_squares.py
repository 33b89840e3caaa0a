"""Misprints in the planar example and in the constrained least squares: E. Dupuis, "A General Framework for the Manual
Teleoperation of Kinematically Redundant Space-Based Manipulators", PhD thesis, McGill University, 2001, chapter 3 and
appendices A and B. What is right is shown to hold, and what is printed not to.
"""

from __future__ import annotations

from math import cos, sin

import numpy as np
import pinocchio as pin
import pytest

from tests.published.arm_machine import STATE, Machine
from wbc.analysis import BodyRows, JointRows
from wbc.coordinates import CoordinatePair, parts
from wbc.errors import RangeError
from wbc.robots import operator_arm

PLANAR, (L1, L2, L3) = parts("planar_3r"), (1.0, 0.8, 0.5)
Q = np.array([0.3, 0.7, -0.4])
#: Cases A4 and A6: the tip is wanted at 0.1 m/s along x, the middle's x is held
WANTED = np.array([0.1, 0.0])


def planar_rows(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """J_T and the rows of the middle, in the axes of link 3."""
    arm = Machine(PLANAR.robot)
    turn = arm.turn("F3", q).T[:2]
    return turn @ arm.rows("tip", q)[:3], turn @ arm.rows("middle", q)[:3]


def test_minors_of_the_planar_task() -> None:
    """(3.42): joints 1, 2: L1 L2 s2 + L1 L3 s23, printed L1 L2 s2 - L2 L3 s3; 1, 3: L2 L3 s3 + L1 L3 s23."""
    for q in np.random.default_rng(0).uniform(-3.0, 3.0, (20, 3)):
        J, _ = planar_rows(q)
        s2, s3, s23 = sin(q[1]), sin(q[2]), sin(q[1] + q[2])
        minors = [float(np.linalg.det(J[:, pair])) for pair in ([0, 1], [0, 2], [1, 2])]
        right = (L1 * L2 * s2 + L1 * L3 * s23, L2 * L3 * s3 + L1 * L3 * s23, L2 * L3 * s3)
        np.testing.assert_allclose(minors, right, atol=1e-12)
        assert abs(minors[0] - (L1 * L2 * s2 - L2 * L3 * s3)) > 1e-3


def test_null_vector_of_the_planar_rows() -> None:
    """After (3.31), at q2 = 0: (1, -(2 L1 + L2) / L2, L1 (L2 c3 + 2 L3) / (L2 L3)); printed without L1 before 2 L3.

    The first row times it is -L1 s3, so that q3 in {0, pi} is what is left.
    """
    for q3, lengths in ((0.7, 1.0), (-2.0, 1.0), (1.1, 2.0)):
        # With L1 = 1 both forms are one: the arm is taken at twice its first length, too
        c3, s3, first = cos(q3), sin(q3), lengths * L1
        rows = np.array(
            [
                [first * s3 + L2 * s3, L2 * s3, 0.0],
                [first * c3 + L2 * c3 + L3, L2 * c3 + L3, L3],
                [first * s3 + L2 * s3 / 2, L2 * s3 / 2, 0.0],
                [first * c3 + L2 * c3 / 2, L2 * c3 / 2, 0.0],
            ]
        )
        if lengths == 1.0:
            np.testing.assert_allclose(np.vstack(planar_rows(np.array([0.3, 0.0, q3]))), rows, atol=1e-12)
        right = np.array([1.0, -(2 * first + L2) / L2, first * (L2 * c3 + 2 * L3) / (L2 * L3)])
        printed = np.array([1.0, right[1], (first * L2 * c3 + 2 * L3) / (L2 * L3)])
        np.testing.assert_allclose(rows[1:] @ right, 0.0, atol=1e-12)
        assert rows[0] @ right == pytest.approx(-first * s3, abs=1e-12)
        assert (np.abs(rows[1:] @ printed).max() > 0.5) == (lengths != 1.0)


def test_singular_values_are_roots_of_eigenvalues() -> None:
    """Footnote of page 45: the eigenvalues of J'J are sigma^2, not sigma."""
    J, _ = planar_rows(Q)
    sigma = np.linalg.svd(J, compute_uv=False)
    eigenvalues = np.sort(np.linalg.eigvalsh(J.T @ J))[:0:-1]
    np.testing.assert_allclose(eigenvalues, sigma**2, rtol=1e-12)
    assert np.abs(eigenvalues - sigma).max() > 0.5


def test_a_smooth_map_need_not_be_open() -> None:
    """Appendix A, proposition A.4: the tip's place is smooth in q, yet about the stretched arm none is further out."""
    arm = Machine(PLANAR.robot)
    near = np.random.default_rng(1).uniform(-0.1, 0.1, (200, 3)) + (0.4, 0.0, 0.0)
    reached = [float(np.linalg.norm(arm.place("tip", q))) for q in near]
    assert max(reached) <= L1 + L2 + L3 + 1e-12
    assert min(reached) > 0.99 * (L1 + L2 + L3)


def reduced(dependent: int, held_rate: float) -> tuple[np.ndarray, ...]:
    """(v_T+, J_T+, v_I+, J_I+, map from the independent rates, its constant) of (B.8) to (B.13), case A6."""
    arm, free = Machine(PLANAR.robot), [k for k in range(3) if k != dependent]
    task, held = arm.rows("tip", Q, 2), arm.rows("middle", Q, 1)
    limit = np.array([[0.0, 1.0, 0.0]])
    through = -held[:, free] / held[0, dependent]
    constant = np.array([held_rate / held[0, dependent]])
    spread, start = np.zeros((3, 2)), np.zeros(3)
    spread[free], spread[dependent], start[dependent] = np.eye(2), through[0], constant[0]
    return WANTED - task @ start, task @ spread, -limit @ start, limit @ spread, spread, start


@pytest.mark.parametrize("dependent", [0, 1])
def test_limits_reduced_to_independent_rates(dependent: int) -> None:
    """(B.7): v_I - J_I1 J_C1^-1 (v_C - J_C2 r) - J_I2 r <= 0 is v_I - J_I v <= 0; printed with + before J_I1."""
    wanted, matrix, bound, rows, spread, start = reduced(dependent, 0.02)
    limit, arm = np.array([[0.0, 1.0, 0.0]]), Machine(PLANAR.robot)
    free = [k for k in range(3) if k != dependent]
    for r in np.random.default_rng(2).uniform(-1.0, 1.0, (5, 2)):
        v = start + spread @ r
        assert arm.rows("middle", Q, 1) @ v == pytest.approx(0.02, abs=1e-12)
        np.testing.assert_allclose(bound - rows @ r, -limit @ v, atol=1e-12)
        np.testing.assert_allclose(wanted - matrix @ r, WANTED - arm.rows("tip", Q, 2) @ v, atol=1e-12)
        printed = limit[:, dependent] * v[dependent] - limit[:, free] @ r
        assert (abs(float((printed + limit @ v)[0])) > 1e-6) == (dependent == 1)


def test_stationarity_has_its_second_factor_of_two() -> None:
    """(B.22): -2 v_T+' J_T+ + 2 r' J_T+' J_T+ - mu' J_I+ = 0, printed without the second 2, which gives other rates.

    The solution is A6's: (0, 0, -0.1129285), the multiplier of q2' >= 0 positive.
    """
    wanted, matrix, bound, rows, spread, start = reduced(0, 0.0)
    found = {}
    for factor in (2.0, 1.0):
        left = np.block([[factor * matrix.T @ matrix, -rows.T], [rows, np.zeros((1, 1))]])
        *r, mu = np.linalg.solve(left, np.concatenate((2.0 * matrix.T @ wanted, bound)))
        found[factor] = start + spread @ r
        if factor == 2.0:
            assert mu > 0.01
            # (B.23): without the limit the rate that it forbids is negative
            alone = start + spread @ np.linalg.lstsq(matrix, wanted, rcond=None)[0]
            assert alone[1] == pytest.approx(-0.2723815111, abs=1e-9)
    np.testing.assert_allclose(found[2.0], (0.0, 0.0, -0.1129285), atol=1e-7)
    assert np.abs(found[1.0] - found[2.0]).max() > 0.1


def test_points_on_the_axes_of_a_frame() -> None:
    """(B.25) to (B.29): J_pi = J_Tt - D_i J_Tr with D_i = [0, -dz, dy; dz, 0, -dx; -dy, dx, 0], garbled in (B.27)."""
    robot = operator_arm("ssrms").robot
    for x, y, z in np.random.default_rng(3).uniform(-2.0, 2.0, (3, 3)):
        arm = Machine(robot.with_frame("point", "tip", pin.SE3(np.eye(3), np.array((x, y, z)))))
        dx, dy, dz = arm.turn("tip", STATE) @ (x, y, z)
        D = np.array([[0.0, -dz, dy], [dz, 0.0, -dx], [-dy, dx, 0.0]])
        J = arm.rows("tip", STATE)
        np.testing.assert_allclose(arm.rows("point", STATE, 3), J[:3] - D @ J[3:], atol=1e-12)


def test_how_many_constraint_rows_there_may_be() -> None:
    """m - n <= p < m (the range is cut off in print): 7 joints, 6 task rows, 1 to 6 constraint rows.

    With fewer rows, which the thesis does not have, the joints' rates are of the least norm.
    """
    robot, pose = operator_arm("ssrms").robot, BodyRows("tip")
    locks = [JointRows(f"joint{k}") for k in range(1, 8)]
    for p in range(7):
        pair = CoordinatePair(pose, locks[:p])
        assert pair.counts(robot) == (6, p)
        assert (pair.under_determined(robot), pair.over_determined(robot)) == (p < 1, p > 1)
    with pytest.raises(RangeError, match="leave the task none"):
        CoordinatePair(pose, locks).counts(robot)
