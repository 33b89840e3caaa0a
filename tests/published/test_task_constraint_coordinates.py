"""Published arms under manual control: E. Dupuis, "A General Framework for the Manual Teleoperation of Kinematically
Redundant Space-Based Manipulators", PhD thesis, McGill University, 2001.

The thesis prints symbols and loci and hardly a number; the numbers here are its formulas at stated configurations,
with the dimensions of Nguyen and Hughes (1994) for the Space Station arm. Where a printed formula is wrong, the
corrected one is tested and the printed one is shown to fail.

Cases A1 to A25 and the misprints stand in this file and in others beside it; docs/task_constraint_published.md names
the tests of each, and test_task_constraint_table.py sees to it that none is without.
"""

from __future__ import annotations

from itertools import product
from math import cos, pi, sin

import numpy as np
import pytest

from tests.published.arm_machine import STATE, Machine, rank
from wbc.coordinates import parts
from wbc.robots import operator_arm

HALF = pi / 2


def test_a1_two_coordinates_of_the_rp_arm_and_its_system_jacobian() -> None:
    """Singular values of (x1, y1, x2, y2): sqrt(1 + (1 + q2)^2) and 1, everywhere."""
    arm = Machine(operator_arm("planar_rp").robot)

    def system(q: np.ndarray) -> np.ndarray:
        return np.vstack((arm.rows("end1", q)[:2], arm.rows("tip", q)[:2]))

    for q, largest in (((0.4, 0.3), 1.6401219467), ((2.0, 0.9), 2.1470910554)):
        np.testing.assert_allclose(np.linalg.svd(system(np.array(q)), compute_uv=False), (largest, 1.0), atol=1e-10)
    states = np.random.default_rng(0).uniform((0.0, 0.0), (2 * pi, 1.0), (10_000, 2))
    every = np.array([system(q) for q in states])
    sigma = np.linalg.svd(every, compute_uv=False)
    assert np.abs(sigma[:, 1] - 1.0).max() < 1e-12
    np.testing.assert_allclose(sigma[:, 0], np.sqrt(1.0 + (1.0 + states[:, 1]) ** 2), atol=1e-12)
    for q, J in zip(states[:200], every, strict=False):
        s, c = sin(q[0]), cos(q[0])
        charts = {(0, 2): -s * c, (1, 3): s * c, (0, 3): -s * s, (1, 2): c * c, (2, 3): -(1 + q[1]), (0, 1): 0.0}
        for rows, wanted in charts.items():
            assert abs(np.linalg.det(J[list(rows)]) - wanted) < 1e-12


def test_a3_planar_arm_and_the_entry_that_is_missing_in_print() -> None:
    """J_T and the middle's rows in the frame of link 3; the printed (2, 2) entry of J_T lacks L3 and fails."""
    arm, (l1, l2, l3) = Machine(parts("planar_3r").robot), (1.0, 0.8, 0.5)
    for q in np.random.default_rng(1).uniform(0.0, 2 * pi, (20, 3)):
        s23, c23, s3, c3 = sin(q[1] + q[2]), cos(q[1] + q[2]), sin(q[2]), cos(q[2])
        J = arm.turn("F3", q).T[:2] @ arm.rows("tip", q)[:3]
        right = np.array([[l1 * s23 + l2 * s3, l2 * s3, 0.0], [l1 * c23 + l2 * c3 + l3, l2 * c3 + l3, l3]])
        np.testing.assert_allclose(J, right, atol=1e-12)
        assert abs(J[1, 1] - l2 * c3) > 0.49
        middle = np.array([[l1 * s23 + l2 * s3 / 2, l2 * s3 / 2, 0.0], [l1 * c23 + l2 * c3 / 2, l2 * c3 / 2, 0.0]])
        np.testing.assert_allclose(arm.turn("F3", q).T[:2] @ arm.rows("middle", q)[:3], middle, atol=1e-12)
        for frame in ("tip", "middle"):
            steps = [(arm.place(frame, q + 1e-6 * e) - arm.place(frame, q - 1e-6 * e)) / 2e-6 for e in np.eye(3)]
            np.testing.assert_allclose(arm.rows(frame, q)[:3], np.transpose(steps), atol=1e-6)
        assert (rank(J), rank(np.vstack((J, middle)))) == (2, 3)
        assert rank(np.vstack((J, middle))[1:]) == 3
    for q2, q3 in product((0.0, pi), repeat=2):
        q = np.array([0.4, q2, q3])
        task = arm.rows("tip", q, 2)
        assert (rank(task), rank(np.vstack((task, arm.rows("middle", q, 2))))) == (1, 2)


def test_a4_planar_places() -> None:
    arm, q = Machine(parts("planar_3r").robot), np.array([0.3, 0.7, -0.4])
    np.testing.assert_allclose(arm.place("tip", q)[:2], (1.8002461413, 1.2510182312), atol=1e-10)
    np.testing.assert_allclose(arm.place("middle", q)[:2], (1.1714574115, 0.6321086006), atol=1e-10)


def test_a8_spherical_shoulder() -> None:
    arm, q = Machine(operator_arm("spherical_4r").robot), np.array([0.3, 0.5, -0.7, 1.1])
    np.testing.assert_allclose(arm.place("tip", q), (1.3178578196, -0.7861081106, 0.1050647423), atol=1e-10)
    np.testing.assert_allclose(arm.place("end3", q), (0.6712121662, -0.5406867876, 0.5070818728), atol=1e-10)
    alpha = arm.alpha(q, 1, "tip")
    np.testing.assert_allclose(alpha, (0.8568085373, -0.2162946881, 0.0, 0.0), atol=1e-10)
    # (4.5) to (4.7) and (4.9)
    s, c, c34, s34 = np.sin(q), np.cos(q), cos(q[2] + q[3]), sin(q[2] + q[3])
    r = arm.place("tip", q) - arm.place("F3", q)
    np.testing.assert_allclose(arm.turn("F3", q).T @ r, (1.0 + 0.8 * c[3], 0.0, -0.8 * s[3]), atol=1e-12)
    length = np.linalg.norm(r)
    assert abs(length - 1.5381007101) < 1e-10
    row = np.array([c[1] * (c[2] + 0.8 * c34), s[2] + 0.8 * s34, 0.0, 0.0]) / length
    np.testing.assert_allclose(alpha, row, atol=1e-12)
    np.testing.assert_allclose(arm.in_plane("F3", "F2", q, 1), (s[1], 0.0, 0.0, 0.0), atol=1e-12)
    J = arm.rows("tip", q, 3)
    assert abs(np.linalg.det(np.vstack((J, alpha))) - 0.9623687431) < 1e-10
    assert abs(0.8 * s[3] * c[1] * length - 0.9623687431) < 1e-10
    assert abs(np.linalg.det(np.vstack((J, arm.in_plane("F3", "F2", q, 1)))) - 0.5132990839) < 1e-10


def test_a8_jacobian_and_the_entry_that_is_missing_in_print() -> None:
    """(4.1) in F4: the (3, 1) entry is -s2 (L3 c4 + L4); printed without L4 s2."""
    arm, (l3, l4) = Machine(operator_arm("spherical_4r").robot), (1.0, 0.8)
    for q in np.random.default_rng(2).uniform(-pi, pi, (20, 4)):
        s, c = np.sin(q), np.cos(q)
        c34, s34 = cos(q[2] + q[3]), sin(q[2] + q[3])
        right = np.array(
            [
                [l3 * s[1] * s[3], 0.0, l3 * s[3], 0.0],
                [c[1] * (l3 * s[2] + l4 * s34), -l3 * c[2] - l4 * c34, 0.0, 0.0],
                [-s[1] * (l3 * c[3] + l4), 0.0, -l3 * c[3] - l4, -l4],
            ]
        )
        J = arm.turn("F4", q).T @ arm.rows("tip", q, 3)
        np.testing.assert_allclose(J, right, atol=1e-12)
        assert abs(J[2, 0] + l3 * s[1] * c[3] + l4 * s[1]) < 1e-12


def test_a15_simplified_space_station_arm() -> None:
    """det(xi; alpha) = c2 c6 L^3 s4 sqrt(2 (1 + c4)), the task loci of (4.20), and the algorithmic ones of (4.21)."""
    arm, L = Machine(operator_arm("ssrms_simplified").robot), 7.11
    rng = np.random.default_rng(3)
    for q in rng.uniform(-pi, pi, (100, 7)):
        s, c = np.sin(q), np.cos(q)
        wanted = c[1] * c[5] * L**3 * s[3] * np.sqrt(2 * (1 + c[3]))
        found = np.linalg.det(np.vstack((arm.rows("tip", q), arm.alpha(q, 1))))
        assert abs(found - wanted) < 1e-9 * L**3
    for branch, side in product(range(4), (HALF, -HALF)):
        q = rng.uniform(-1.0, 1.0, 7)
        assert rank(arm.rows("tip", q)) == 6
        if branch == 0:
            q[3] = 0.0
        elif branch == 1:
            q[1], q[5] = side, -HALF
        elif branch == 2:
            q[1], q[3] = side, pi - 2 * q[2]
        else:
            q[5], q[3] = side, pi - 2 * q[4]
        assert rank(arm.rows("tip", q)) == 5
    # Folded, the centres of shoulder and wrist are one point
    q[[3, 5]] = pi, 0.3
    assert rank(arm.rows("tip", q)) == 4
    for joint, side in product((1, 5), (HALF, -HALF)):
        q = rng.uniform(-1.0, 1.0, 7)
        q[joint] = side
        J = arm.rows("tip", q)
        assert rank(J) == 6
        assert rank(np.vstack((J, arm.alpha(q, 1)))) == 6
        assert rank(np.vstack((J, arm.rows("end3", q, 3)))) == 6


def test_a16_elbow_and_both_in_plane_rates_complete_the_simplified_arm() -> None:
    """Deficient on the families of (4.22) only: q4, q2 or q3, q6 or q5; there the task is, too."""
    arm, rng = Machine(operator_arm("ssrms_simplified").robot), np.random.default_rng(5)

    def tall(q: np.ndarray) -> np.ndarray:
        plane = [arm.in_plane("F3", "F2", q, 1), arm.in_plane("F5", "F6", q, 1)]
        return np.vstack((arm.rows("tip", q), arm.rows("end3", q, 3), *plane))

    places = ((1, 0.0), (1, pi), (2, HALF), (2, -HALF)), ((5, 0.0), (5, pi), (4, HALF), (4, -HALF))
    for q4, shoulder, wrist in product((0.0, pi), *places):
        q = rng.uniform(-1.0, 1.0, 7)
        q[3], q[shoulder[0]], q[wrist[0]] = q4, shoulder[1], wrist[1]
        assert rank(tall(q)) == 6
        assert rank(arm.rows("tip", q)) < 6
    for q in rng.uniform(-pi, pi, (1000, 7)):
        assert rank(tall(q)) == 7


def test_a17_space_station_arm() -> None:
    """Places, singular values, and the determinants of roll lock, yaw lock and pitch plane."""
    arm = Machine(operator_arm("ssrms").robot)
    np.testing.assert_allclose(arm.place("tip", STATE), (9.964186073, -4.401697152, -3.134509474), atol=1e-9)
    np.testing.assert_allclose(arm.place("F4", STATE), (5.340432612, -4.455087714, 2.925406042), atol=1e-9)
    J = arm.rows("tip", STATE)
    wanted = (14.155442691, 11.419436233, 4.468617988, 1.330576318, 1.119487979, 0.591979818)
    np.testing.assert_allclose(np.linalg.svd(J, compute_uv=False), wanted, rtol=1e-9)
    locks = np.eye(7)
    for row, value in (
        (locks[0], 427.183403246789),
        (locks[1], 21.0781357206829),
        (arm.alpha(STATE, 1), 393.600601349982),
    ):
        assert np.linalg.det(np.vstack((J, row))) == pytest.approx(value, rel=1e-12)


def test_a20_branches_of_the_space_station_arm() -> None:
    """(4.30), (4.31) and the corrected (4.32) are roots with a regular task; (4.32) as printed is not."""
    arm, locks, (L, D) = Machine(operator_arm("ssrms").robot), np.eye(7), (7.11, -0.7026)

    def det(q: np.ndarray, row: np.ndarray | None) -> float:
        return float(np.linalg.det(np.vstack((arm.rows("tip", q), arm.alpha(q, 1) if row is None else row))))

    q3, q4, q5 = -0.5, 1.2, 0.7
    roll = -q4 - np.arctan((L * (1 + cos(q4)) + D * sin(q5)) / (L * sin(q4) + D * cos(q5)))
    argument = (L * (sin(-0.55) + sin(-0.55 + q4)) + D) / D
    assert argument == pytest.approx(0.1651449657, abs=1e-9)
    both, across = 2 * L + D * (sin(q3) + sin(q5)), D * (cos(q3) + cos(q5))
    squares = D * D * (sin(q3) ** 2 - cos(q5) ** 2 + sin(q3) * sin(q5) - cos(q3) * cos(q5))
    plane = np.arctan2(-across * both, -(2 * L * (L + D * (sin(q3) + sin(q5))) + squares))
    assert np.tan(plane / 2) == pytest.approx(-both / across, rel=1e-12)
    yaw = 0.55 - q4 + np.arccos(argument)
    np.testing.assert_allclose((roll, yaw, plane), (-2.187788992, 0.7548913334, 2.978321908), atol=1e-9)
    for changes, row, least in (
        ((roll, q4, q5), locks[0], 0.605769),
        ((roll + pi, q4, q5), locks[0], 0.601564),
        ((-0.55, q4, yaw), locks[1], 0.593796),
        ((q3, plane, q5), None, 0.233673),
    ):
        q = STATE.copy()
        q[[2, 3, 4]] = changes
        assert abs(det(q, row)) < 1e-10
        assert np.linalg.svd(arm.rows("tip", q), compute_uv=False)[-1] == pytest.approx(least, abs=1e-6)
    q[[2, 3, 4]] = q3, 0.162021849, q5
    assert det(q, None) == pytest.approx(86.5680895, rel=1e-8)
    rows = np.vstack((arm.rows("tip", q), arm.alpha(q, 1)))
    assert np.linalg.svd(rows, compute_uv=False)[-1] == pytest.approx(0.20961, abs=1e-5)


def test_a21_what_completes_the_space_station_arm() -> None:
    """{xi, elbow, beta, gamma} is deficient on (4.33) only, where the task is; neither beta nor gamma can go."""
    arm, rng = Machine(operator_arm("ssrms").robot), np.random.default_rng(6)

    def tall(q: np.ndarray, beta: bool = True, gamma: bool = True) -> np.ndarray:
        plane = [arm.in_plane("F3", "F2", q, 1)] * beta + [arm.in_plane("F5", "F6", q, 1)] * gamma
        return np.vstack((arm.rows("tip", q), arm.rows("end3", q, 3), *plane))

    for q4, q3, q5 in product((0.0, pi), (HALF, -HALF), (HALF, -HALF)):
        q = rng.uniform(-1.0, 1.0, 7)
        q[[2, 3, 4]] = q3, q4, q5
        assert rank(arm.rows("tip", q)) == 5
        assert rank(tall(q)) == 6
    for q in rng.uniform(-pi, pi, (200, 7)):
        assert rank(tall(q)) == 7
    q = rng.uniform(-1.0, 1.0, 7)
    q[[4, 5]] = HALF
    assert (rank(arm.rows("tip", q)), rank(tall(q, False, False)), rank(tall(q, False, True))) == (6, 6, 7)
    q = rng.uniform(-1.0, 1.0, 7)
    q[[1, 2]] = HALF
    assert (rank(arm.rows("tip", q)), rank(tall(q, False, False)), rank(tall(q, True, False))) == (6, 6, 7)


def test_a22_dexterous_arm() -> None:
    """Determinants and roots; the printed sign of the arcsine in (4.37) is wrong."""
    arm, locks = Machine(operator_arm("spdm_arm_simplified").robot), np.eye(7)

    def det(q: np.ndarray, row: np.ndarray | None) -> float:
        return float(np.linalg.det(np.vstack((arm.rows("tip", q), arm.alpha(q, 2) if row is None else row))))

    def at(**changes: float) -> np.ndarray:
        q = STATE.copy()
        for name, value in changes.items():
            q[int(name[1:]) - 1] = value
        return q

    for row, value in ((locks[0], 1.289576388549845), (locks[1], 0.256401285169675), (None, 1.207441981487824)):
        assert det(STATE, row) == pytest.approx(value, rel=1e-12)
    L, D = 1.0, 0.2
    fold = np.arctan2(2 * D * sin(0.7) * (2 * L + D * cos(0.7)), -(4 * L * (L + D * cos(0.7)) + D * D * cos(1.4)))
    roll = -1.2 - np.arctan((L * (1 + cos(1.2)) + D * cos(0.7)) / (L * sin(1.2) - D * sin(0.7)))
    bend = np.arcsin(L * (sin(-0.62) + sin(-0.62 + 1.3)) / D)
    yaw, printed = 0.62 - 1.3 - bend, 0.62 - 1.3 + bend
    np.testing.assert_allclose((fold, roll), (3.022046029, -2.283400310), atol=1e-9)
    np.testing.assert_allclose((yaw, printed), (-0.921118910, -0.438881090), atol=1e-9)
    folded = at(q4=fold, q5=0.7)
    assert abs(det(folded, None)) < 1e-12
    assert abs(np.linalg.svd(arm.rows("tip", folded), compute_uv=False)[-1] - 0.083719) < 1e-6
    assert abs(det(at(q3=roll, q4=1.2, q5=0.7), locks[0])) < 1e-12
    assert abs(det(at(q3=-0.62, q4=1.3, q5=yaw), locks[1])) < 1e-12
    assert abs(det(at(q3=-0.62, q4=1.3, q5=pi - 2 * 0.68 - yaw), locks[1])) < 1e-12
    assert det(at(q3=-0.62, q4=1.3, q5=printed), locks[1]) == pytest.approx(0.069963545, rel=1e-6)


def test_a23_dexterous_arm_with_both_rolls() -> None:
    """{xi, alpha, q1, q7}: deficient at q4 = 0 or pi only; there the elbow helps unless the task is deficient, too."""
    arm, locks = Machine(operator_arm("spdm_arm_simplified").robot), np.eye(7)
    rng = np.random.default_rng(7)
    for q in rng.uniform(-pi, pi, (100, 7)):
        assert rank(np.vstack((arm.rows("tip", q), arm.alpha(q, 2), locks[0], locks[6]))) == 7
        q[3] = 0.0
        J = arm.rows("tip", q)
        assert (rank(J), rank(np.vstack((J, arm.alpha(q, 2), locks[0], locks[6])))) == (6, 6)
        assert rank(np.vstack((J, arm.rows("end3", q, 3)))) == 7
    for joint, value in ((1, HALF), (1, -HALF), (4, 0.0), (4, pi)):
        q = rng.uniform(-1.0, 1.0, 7)
        q[3], q[joint] = 0.0, value
        J = arm.rows("tip", q)
        assert (rank(J), rank(np.vstack((J, arm.rows("end3", q, 3))))) == (5, 6)
