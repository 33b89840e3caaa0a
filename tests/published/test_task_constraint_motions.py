"""Motions of arms under manual control: E. Dupuis, "A General Framework for the Manual Teleoperation of Kinematically
Redundant Space-Based Manipulators", PhD thesis, McGill University, 2001; the tests A2 to A25 of its formulas that move.

The thesis prints symbols; the numbers are its formulas (the corrected ones) at stated configurations.
"""

from __future__ import annotations

from math import comb, pi

import numpy as np
import pinocchio as pin
import pytest

from wbc.coordinates import (
    Adviser,
    BodyRows,
    Conditioning,
    CoordinatePair,
    JointRows,
    PairController,
    PitchPlaneRows,
    mode_pairs,
    parts,
)
from wbc.robots import operator_arm

ALPHA, ROLL, YAW = PitchPlaneRows("F3", "F5"), JointRows("joint1"), JointRows("joint2")
XI, ELBOW = BodyRows("tip", name="xi"), BodyRows("end3", rotation=(), name="elbow")
STATE = np.array([0.3, 0.4, -0.5, 1.2, 0.7, -0.6, 0.9])
PLANAR = parts("planar_3r")
TIP2, MIDDLE = PLANAR.arms[0].tip, PLANAR.arms[0].middle
assert MIDDLE is not None
MIDDLE_X, MIDDLE_Y = PLANAR.arms[0].components()
PLANAR_STATE = np.array([0.3, 0.7, -0.4])
FOUR = parts("spherical_4r").arms[0]
FOUR_STATE = np.array([0.3, 0.5, -0.7, 1.1])


@pytest.fixture(scope="module")
def planar() -> PairController:
    pairs = [
        CoordinatePair(TIP2, MIDDLE_X, "x"),
        CoordinatePair(TIP2, MIDDLE_Y, "y"),
        CoordinatePair(MIDDLE, TIP2, "m"),
    ]
    return PairController(PLANAR.robot, pairs, limits=False, backend="vm")


@pytest.fixture(scope="module")
def spherical() -> PairController:
    assert FOUR.alpha is not None
    assert FOUR.middle is not None
    first = CoordinatePair(FOUR.tip, FOUR.alpha, "drive")
    pairs = [first, CoordinatePair(FOUR.alpha, FOUR.tip, "self"), CoordinatePair(FOUR.middle, FOUR.tip, "elbow")]
    return PairController(parts("spherical_4r").robot, pairs, limits=False, backend="vm")


@pytest.fixture(scope="module")
def station() -> PairController:
    pairs = [CoordinatePair(XI, held) for held in (ALPHA, ROLL, YAW)]
    pairs += [pairs[0].swapped(), CoordinatePair(ELBOW, XI)]
    return PairController(operator_arm("ssrms").robot, pairs, limits=False, length=1.0)


def rates(control: PairController, name: str, q: np.ndarray, command: object) -> np.ndarray:
    """Joint rates of a pair at a configuration, from rest; what is held is exact."""
    control.switch(name, 0.0)
    control.reset(q)
    control.command(command)
    v = control.step(q).v
    for one in control.pair.constraint:
        assert np.abs(control.rates(q)[one] @ v).max() < 1e-10
    return v


def test_a2_counting() -> None:
    """Coordinates of seven bodies; pairs with one and two constraints; square sub-matrices."""
    coordinates = 7 * 6
    left = coordinates - 6
    assert (coordinates, 7 * left, 7 * comb(left, 2)) == (42, 252, 4410)
    assert (comb(7, 6), comb(8, 6), comb(11, 7)) == (7, 28, 330)


def test_a4_tip_of_the_planar_arm_with_a_coordinate_of_the_middle(planar: PairController) -> None:
    for name, wanted in (
        ("x", (0.1450390886, -0.2723815111, -0.0750441186)),
        ("y", (0.0493438309, -0.2674622880, 0.3323506828)),
    ):
        np.testing.assert_allclose(rates(planar, name, PLANAR_STATE, (0.1, 0.0)), wanted, atol=1e-9)


def test_a5_over_determined_self_motion_of_the_planar_arm(planar: PairController) -> None:
    v = rates(planar, "m", PLANAR_STATE, (0.0, 0.1))
    np.testing.assert_allclose(v, (0.0672901922, -0.0034590582, -0.2864684741), atol=1e-9)
    matrices = planar.rates(PLANAR_STATE)
    reached = matrices[MIDDLE] @ v
    np.testing.assert_allclose(reached, (-0.0413704303, 0.0780800195), atol=1e-9)
    assert np.linalg.norm(reached - (0.0, 0.1)) == pytest.approx(0.0468187789, abs=1e-9)
    # (B.5) to (B.15), joints 1 and 2 dependent
    held, free = matrices[TIP2][:, :2], matrices[TIP2][:, 2:]
    through = -np.linalg.solve(held, free)
    reduced = matrices[MIDDLE][:, 2:] + matrices[MIDDLE][:, :2] @ through
    last = np.linalg.lstsq(reduced, np.array((0.0, 0.1)), rcond=None)[0]
    np.testing.assert_allclose(v, np.concatenate((through @ last, last)), atol=1e-9)


def test_a6_a_limit_that_is_reached_takes_from_the_task_and_not_from_the_constraint() -> None:
    robot = PLANAR.robot.with_limits(position_lower={"joint2": 0.7, "joint3": -2.0}, velocity=np.inf)
    pair = CoordinatePair(TIP2, MIDDLE_X)
    control = PairController(robot, pair, backend="vm")
    control.reset(PLANAR_STATE)
    control.command((0.1, 0.0))
    step = control.step(PLANAR_STATE)
    np.testing.assert_allclose(step.v, (0.0, 0.0, -0.1129285), atol=1e-7)
    np.testing.assert_allclose(control.rates(PLANAR_STATE)[TIP2] @ step.v, (0.031882, -0.046602), atol=1e-6)
    assert abs(control.rates(PLANAR_STATE)[MIDDLE_X] @ step.v) < 1e-12
    assert [(b.item, b.side) for b in step.binding if b.item == "joint_limits"] == [("joint_limits", "lower")]


@pytest.mark.parametrize("unit", [1.0, 1000.0])
def test_a7_three_points_make_over_determined_answers_free_of_units(unit: float) -> None:
    """sum |v + w x d_i|^2 = e'We with the eigenvalues of W; the least squares of a pose in metres or millimetres."""
    control = PairController(
        operator_arm("spdm_arm").robot, CoordinatePair(XI, ELBOW, metric=1.0), limits=False, length=unit, backend="vm"
    )
    command = np.array((0.01, 0.02, 0.0, 0.01, 0.0, 0.02))
    v = rates(control, control.active, STATE, command)
    matrices, data = control.rates(STATE), control.robot.model.createData()
    pin.framesForwardKinematics(control.robot.model, data, STATE)
    turn = data.oMf[control.robot.model.getFrameId("tip")].rotation
    spread = np.vstack([np.hstack((np.eye(3), -pin.skew(turn[:, k]))) for k in range(3)])
    one = np.ones(3)
    own = np.block([[3 * np.eye(3), -pin.skew(one)], [pin.skew(one), 2 * np.eye(3)]])
    both = np.kron(np.eye(2), turn)
    np.testing.assert_allclose(spread.T @ spread, both @ own @ both.T, atol=1e-12)
    eigenvalues = (0.6972244, 0.6972244, 2.0, 3.0, 4.3027756, 4.3027756)
    np.testing.assert_allclose(np.linalg.eigvalsh(own), eigenvalues, atol=1e-7)
    # The same least squares by elimination of the held rows
    free = np.linalg.svd(matrices[ELBOW])[2][3:].T
    wanted = free @ np.linalg.lstsq(spread @ matrices[XI] @ free, spread @ command, rcond=None)[0]
    np.testing.assert_allclose(v, wanted, atol=1e-6)
    plain = free @ np.linalg.lstsq(matrices[XI] @ free, command, rcond=None)[0]
    assert np.abs(plain - wanted).max() > 1e-3


def test_a9_self_motion_and_drive_of_the_spherical_shoulder(spherical: PairController) -> None:
    v = rates(spherical, "self", FOUR_STATE, [0.1])
    np.testing.assert_allclose(v, (0.1112519970, -0.0216294688, -0.0533370486, 0.0), atol=1e-9)
    v = rates(spherical, "drive", FOUR_STATE, (0.05, 0.0, 0.0))
    np.testing.assert_allclose(v, (-0.0038411765, -0.0152160595, 0.0471905478, -0.0924208186), atol=1e-9)


def test_a11_over_determined_elbow_command(spherical: PairController) -> None:
    v = rates(spherical, "elbow", FOUR_STATE, (0.0, 0.1, 0.0))
    np.testing.assert_allclose(v, (-0.20121863, 0.03912067, 0.09646935, 0.0), atol=1e-8)
    matrices = spherical.rates(FOUR_STATE)
    assert FOUR.middle is not None
    assert FOUR.alpha is not None
    reached = matrices[FOUR.middle] @ v
    np.testing.assert_allclose(reached, (0.04019440, 0.07028922, 0.02174300), atol=1e-8)
    assert np.linalg.norm(reached - (0.0, 0.1, 0.0)) == pytest.approx(0.0545076, abs=1e-7)
    assert matrices[FOUR.alpha] @ v == pytest.approx(-0.1808674, abs=1e-7)


def test_a18_motions_of_the_space_station_arm(station: PairController) -> None:
    wanted = (0.01085322, 0.000535521, -0.005913812, 0.000851588, 0.002359217, 0.009760005, -0.002698056)
    v = rates(station, "alpha | xi", STATE, [0.01])
    np.testing.assert_allclose(v, wanted, atol=1e-7)
    np.testing.assert_allclose(station.rates(STATE)[ELBOW] @ v, (-0.020383479, -0.037887441, -0.011625537), atol=1e-7)
    wanted = (-0.003176443, -0.000156732, 0.001730812, -0.000249237, -0.000690479, -0.002856489, 0.000789648)
    v = rates(station, "elbow | xi", STATE, (0.0, 0.0, 0.05))
    np.testing.assert_allclose(v, wanted, atol=1e-7)
    np.testing.assert_allclose(station.rates(STATE)[ELBOW] @ v, (0.005965691, 0.011088626, 0.003402479), atol=1e-7)
    command = (0.02, 0.0, 0.0, 0.0, 0.0, 0.005)
    for name, wanted in (
        ("alpha", (0.000074111, -0.000680329, 0.002826383, -0.005746076, 0.007088329, -0.000061946, -0.005023596)),
        ("joint1", (0.0, -0.000683985, 0.002866765, -0.005751891, 0.00707222, -0.000128591, -0.005005172)),
        ("joint2", (0.0138621, 0.0, -0.004686555, -0.004664214, 0.010085492, 0.012337217, -0.008451221)),
    ):
        np.testing.assert_allclose(rates(station, f"xi | {name}", STATE, command), wanted, atol=1e-7)


def test_a25_a_held_pose_does_not_drift(station: PairController) -> None:
    """Self-motion at 0.01 rad/s of the pitch plane for 100 s: the pose stays within 1e-6 m, rows exact at each step."""
    station.switch("alpha | xi", 0.0)
    station.reset(STATE)
    station.command([0.01])
    data, model = station.robot.model.createData(), station.robot.model
    tip = model.getFrameId("tip")
    pin.framesForwardKinematics(model, data, STATE)
    held, q, farthest = data.oMf[tip].copy(), STATE, 0.0
    for k in range(5000):
        step = station.step(q)
        assert step.certificate.violation < 1e-10
        q = q + 0.02 * step.v
        if k % 50 == 0:
            pin.framesForwardKinematics(model, data, q)
            farthest = max(farthest, float(np.linalg.norm(data.oMf[tip].translation - held.translation)))
    assert farthest < 1e-6
    assert np.abs(q - STATE).max() > 0.5


def test_a24_hands_held_while_the_carrier_moves() -> None:
    """Self-motion of 22 joints: both hands stay in space, the arm that is not commanded and the body joint at rest."""
    robot = parts("spdm_on_ssrms").robot
    pairs = (*mode_pairs("spdm_on_ssrms", "M7"), mode_pairs("spdm_on_ssrms", "M6")[0])
    control = PairController(robot, pairs, limits=False, backend="vm")
    q = np.concatenate((STATE, [0.1], STATE, STATE[::-1]))
    command = (0.001, 0.0, 0.002, 0.0, 0.0005, 0.0)
    v = rates(control, "carrier_xi | hands", q, command)
    matrices = control.rates(q)
    for k in (1, 2):
        assert np.abs(matrices[BodyRows(f"arm{k}_tip")] @ v).max() < 1e-10
    np.testing.assert_allclose(matrices[BodyRows("carrier_tip")] @ v, command, atol=1e-8)
    v = rates(control, "arm1_xi | the rest", q, command)
    moved = [robot.dofs(f"arm1_joint{k}").start for k in range(1, 8)]
    assert np.abs(np.delete(v, moved)).max() < 1e-12
    assert np.abs(v[moved]).min() > 1e-6
    assert pi > np.abs(v).max()


def test_a12_advice_along_the_second_joint_of_the_spherical_shoulder() -> None:
    assert FOUR.alpha is not None
    assert FOUR.middle is not None
    (beta,), robot = FOUR.in_plane, parts("spherical_4r").robot
    pairs = [CoordinatePair(FOUR.tip, FOUR.alpha, "alpha"), CoordinatePair(FOUR.tip, beta, "beta")]
    adviser = Adviser(robot, pairs, length=1.0, backend="vm")
    for q2, first, second, best in (
        (0.0, 0.424124, 0.0, "alpha"),
        (0.5, 0.421499, 0.390733, "alpha"),
        (1.2, 0.261023, 0.414274, "beta"),
        (1.5, 0.050729, 0.414638, "beta"),
        (pi / 2, 0.0, 0.414650, "beta"),
    ):
        q = np.array([0.3, q2, -0.7, 1.1])
        np.testing.assert_allclose(adviser.sigmas(q), (first, second), atol=5e-6)
        assert adviser.recommend(q) == best
    rows = [(FOUR.tip,), (FOUR.tip, FOUR.alpha), (FOUR.tip, FOUR.middle), (FOUR.tip, beta)]
    ranks = [np.linalg.matrix_rank(J, 1e-9) for J in Conditioning(robot, rows, backend="vm").matrices(q)]
    assert ranks == [3, 3, 3, 4]


@pytest.mark.parametrize(
    ("name", "held", "least", "seen"),
    [
        ("spdm_arm_simplified", ("alpha", "joint1", "joint7", "elbow x", "elbow y", "elbow z"), 0.3, 0.4727),
        ("spdm_arm", ("alpha", "joint1", "joint7", "elbow x", "elbow y", "elbow z"), 0.3, 0.3426),
        ("ssrms", ("beta", "gamma", "elbow x", "elbow y", "elbow z"), 0.1, 0.1260),
    ],
)
def test_a23_the_best_pair_keeps_what_the_task_has(name: str, held: tuple[str, ...], least: float, seen: float) -> None:
    """Over 10^4 configurations; rows in metres and radians."""
    arm = parts(name).arms[0]
    groups = [(arm.tip,), *((arm.tip, one) for one in arm.candidates() if str(one) in held)]
    assert len(groups) == 1 + len(held)
    made, worst = Conditioning(parts(name).robot, groups, length=1.0), np.inf
    for q in np.random.default_rng(7).uniform(-pi, pi, (10_000, 7)):
        task, *every = made.sigmas(q)
        worst = min(worst, max(every) / task) if task > 1e-3 else worst
    assert worst > least
    assert worst == pytest.approx(seen, abs=1e-3)


def test_a14_loci_of_the_spherical_shoulder() -> None:
    """Ranks on the loci of (4.2) to (4.11), (4.10) as corrected; searches from random starts find no others."""
    assert FOUR.alpha is not None
    assert FOUR.middle is not None
    (beta,), robot = FOUR.in_plane, parts("spherical_4r").robot
    sets = {
        "task": (FOUR.tip,),
        "elbow": (FOUR.tip, FOUR.middle),
        "alpha": (FOUR.tip, FOUR.alpha),
        "alpha, beta": (FOUR.tip, FOUR.alpha, beta),
        "elbow, beta": (FOUR.tip, FOUR.middle, beta),
    }
    made = Conditioning(robot, list(sets.values()), length=1.0)
    # tan q3 of the second branch of (4.2): L3 c3 + L4 c34 = 0 at q4 = 1.1
    across = np.arctan2(1.0 + 0.8 * np.cos(1.1), 0.8 * np.sin(1.1))
    for q, wanted in (
        ((0.3, 0.5, -0.7, 0.0), (2, 3, 3, 3, 4)),
        ((0.3, 0.5, -0.7, pi), (2, 3, None, None, 4)),
        ((0.3, pi / 2, -0.7, 1.1), (3, 3, 3, 4, 4)),
        ((0.3, -pi / 2, across, 1.1), (2, 3, 3, 4, 4)),
        ((0.3, 0.0, -0.7, 0.0), (2, 3, 3, 3, 3)),
        ((0.3, 0.5, pi / 2, 0.0), (2, 3, 3, 3, 3)),
        ((0.3, 0.5, -0.7, 1.1), (3, 4, 4, 4, 4)),
    ):
        ranks = [np.linalg.matrix_rank(J, 1e-9 * np.linalg.norm(J)) for J in made.matrices(np.array(q))]
        assert [a for a, b in zip(ranks, wanted, strict=True) if b is not None] == [b for b in wanted if b is not None]
    folded = [np.linalg.svd(J, compute_uv=False)[-1] for J in made.matrices(np.array([0.3, 0.5, -0.7, 1.1]))]
    assert min(folded) > 0.1
    for start in np.random.default_rng(3).uniform(-pi, pi, (20, 4)):
        for k, name in enumerate(sets):
            q = start.copy()
            for _ in range(40):
                sigma, slopes, _ = made.slopes(q)
                steep = float(slopes[k] @ slopes[k])
                if sigma[k] < 1e-9 or steep < 1e-12:
                    break
                step = -sigma[k] / steep * slopes[k]
                q = q + step * min(1.0, 0.3 / float(np.linalg.norm(step)))
            if sigma[k] >= 1e-9:
                continue
            flat = abs(np.sin(q[3])) < 1e-4
            upright, reach = abs(np.cos(q[1])) < 1e-4, abs(np.cos(q[2]) + 0.8 * np.cos(q[2] + q[3])) < 1e-4
            both = flat and (abs(np.sin(q[1])) < 1e-4 or abs(np.cos(q[2])) < 1e-4)
            known = {"task": flat or (upright and reach), "alpha, beta": flat, "elbow, beta": both}
            assert known.get(name, flat or upright), (name, q)
