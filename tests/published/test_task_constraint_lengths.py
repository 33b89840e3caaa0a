"""Determinants of pairs of task and constraint coordinates for arms of any lengths: E. Dupuis, "A General Framework for
the Manual Teleoperation of Kinematically Redundant Space-Based Manipulators", PhD thesis, McGill University, 2001,
eqs. 4.29 to 4.42. What the thesis prints wrong or leaves open is tested both ways.
"""

from __future__ import annotations

from itertools import product
from math import cos, pi, sin, sqrt

import numpy as np
import pytest

from tests import models
from tests.published.arm_machine import Machine, rank

HALF = pi / 2


def determinants(arm: Machine, q: np.ndarray, pitch: int) -> list[float]:
    """Of (xi; q1), (xi; q2) and (xi; alpha), the constraint last."""
    J = arm.rows("tip", q)
    return [float(np.linalg.det(np.vstack((J, row)))) for row in (np.eye(7)[0], np.eye(7)[1], arm.alpha(q, pitch))]


def brackets(q: np.ndarray, L: float) -> tuple[list[float], list[float]]:
    """Factors before the brackets of the three, and c3, s3, c5, s5, c34, s34, c45, s45, c345, s345."""
    s, c = np.sin(q), np.cos(q)
    before = L * L * s[3] * c[5]
    sums = (q[2], q[4], q[2] + q[3], q[3] + q[4], q[2] + q[3] + q[4])
    parts = [f(x) for x in sums for f in (cos, sin)]
    return [before, c[1] * before, c[1] * before / sqrt(2 * (1 + c[3]))], parts


def test_a17_space_station_arm_of_any_lengths() -> None:
    """100 random configurations, as many lengths; Y_J3, Y_J5 and X_J7 do not matter."""
    rng = np.random.default_rng(4)
    for _ in range(100):
        L, D, y3, y5, x7 = rng.uniform((1.0, -1.0, -2.0, -2.0, 0.1), (9.0, 1.0, 2.0, 2.0, 2.0))
        arm, q = Machine(models.arm("any", models.ssrms_links(L, D, y3, y5, x7))), rng.uniform(-pi, pi, 7)
        before, (c3, s3, _, s5, c34, s34, _, s45, c345, s345) = brackets(q, L)
        wanted = (
            before[0] * (L * (c3 + c34) + D * s345),
            before[1] * (L * (s3 + s34) + D * (1 - c345)),
            before[2] * (2 * L * (1 + cos(q[3])) + D * (s3 + s34 + s5 + s45)),
        )
        # To 1e-12 of the determinant's own size: near a locus its entries cancel
        np.testing.assert_allclose(determinants(arm, q, 1), wanted, rtol=1e-11, atol=1e-12 * L**4)


@pytest.mark.parametrize("shoulder", [0.0, 1.0], ids=["as in the formulas", "as in the text"])
def test_a22_dexterous_arm_of_any_lengths(shoulder: float) -> None:
    """The formulas hold with the wrist's offset D alone; the text's second one, at the shoulder, changes two."""
    rng = np.random.default_rng(5)
    for _ in range(40):
        L, D, z12, z15, z16, x17 = rng.uniform((0.5, 0.05, -0.3, -0.3, -0.3, 0.1), (2.0, 0.5, 0.3, 0.3, 0.3, 0.5))
        links = models.spdm_links(L, D, z12, z15, z16, x17)
        links[1] = (links[1][0], (shoulder * D, 0.0, z12))
        arm, q = Machine(models.arm("any", links)), rng.uniform(-pi, pi, 7)
        before, (c3, s3, c5, _, c34, s34, c45, _, c345, s345) = brackets(q, L)
        wanted = (
            before[0] * (L * (c3 + c34) + D * (shoulder + c345)),
            before[1] * (L * (s3 + s34) + D * s345),
            before[2] * (2 * L * (1 + cos(q[3])) + D * (c5 + c45 + shoulder * (c3 + c34))),
        )
        np.testing.assert_allclose(determinants(arm, q, 2), wanted, rtol=1e-11, atol=1e-12 * L**4)


def test_offset_at_the_shoulder_ends_the_deficiency_of_the_elbow() -> None:
    """(4.42): at q4 = 0 the pose with the elbow point is deficient at q2 = +pi/2, -pi/2 (printed: +pi/2 only) and q5 in
    {0, pi}. With the offset at the shoulder that the text names as well it is not.
    """
    rng = np.random.default_rng(6)
    for offset, wanted in ((0.0, 6), (0.2, 7)):
        links = models.spdm_links()
        links[1] = (links[1][0], (offset, 0.0, 0.15))
        arm = Machine(models.arm("any", links))
        for joint, value in ((1, HALF), (1, -HALF), (4, 0.0), (4, pi)):
            q = rng.uniform(-1.0, 1.0, 7)
            q[3], q[joint] = 0.0, value
            assert rank(np.vstack((arm.rows("tip", q), arm.rows("F4", q, 3)))) == wanted


def test_pitch_plane_row_of_the_dexterous_arm() -> None:
    """(4.38) corrected: [c2 L (c3 + c34), L (s3 + s34), 0 ...] / |r|, |r| = L sqrt(2 (1 + c4)), seven columns. Printed:
    c2 in both entries, 1 - c4 below the root, six columns.
    """
    rng = np.random.default_rng(7)
    for L in (0.7, 1.0, 1.8):
        arm, q = Machine(models.arm("any", models.spdm_links(boom=L))), rng.uniform(-1.2, 1.2, 7)
        # From F3 to F5: the wrist's offset is beyond it, and along the pitch axis it does not count
        entries = np.array((L * (cos(q[2]) + cos(q[2] + q[3])), L * (sin(q[2]) + sin(q[2] + q[3]))))
        r, c2 = L * sqrt(2 * (1 + cos(q[3]))), cos(q[1])
        found = arm.alpha(q, 2)
        assert found.shape == (7,)
        right = np.array((c2, 1.0)) * entries / r
        np.testing.assert_allclose(found, (*right, 0.0, 0.0, 0.0, 0.0, 0.0), atol=1e-12)
        printed = c2 * entries / (L * sqrt(2 * (1 - cos(q[3]))))
        assert np.abs(found[:2] - printed).max() > 0.1


def test_in_plane_row_of_the_wrist() -> None:
    """gamma = [s2, 0, 1, 1, 1, 0, 0], of which parts are printed; with the pose held it is s6 times the last rate."""
    rng = np.random.default_rng(8)
    arm = Machine(models.ssrms())
    for q in rng.uniform(-pi, pi, (10, 7)):
        gamma = arm.in_plane("F5", "F6", q, 1)
        np.testing.assert_allclose(gamma, (sin(q[1]), 0.0, 1.0, 1.0, 1.0, 0.0, 0.0), atol=1e-12)
        within = np.linalg.svd(arm.rows("tip", q))[2][-1]
        assert abs(gamma @ within) == pytest.approx(abs(sin(q[5]) * within[6]), abs=1e-10)


def test_locks_are_rows_or_missing_columns() -> None:
    """(4.29), which is lost, is the row e1: the determinant is that without column 1, up to its sign; so is q2's."""
    arm = Machine(models.ssrms())
    for q, joint in product(np.random.default_rng(9).uniform(-pi, pi, (10, 7)), (0, 1)):
        J = arm.rows("tip", q)
        row, column = np.linalg.det(np.vstack((J, np.eye(7)[joint]))), np.linalg.det(np.delete(J, joint, axis=1))
        assert abs(row) == pytest.approx(abs(column), rel=1e-10)
