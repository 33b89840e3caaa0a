"""Motions of arms under manual control: E. Dupuis, "A General Framework for the Manual Teleoperation of Kinematically
Redundant Space-Based Manipulators", PhD thesis, McGill University, 2001; the tests A2 to A25 of its formulas that move.

The thesis prints symbols; the numbers are its formulas (the corrected ones) at stated configurations.
"""

from __future__ import annotations

from itertools import combinations
from math import pi

import numpy as np
import pinocchio as pin
import pytest

from tests.models import placement
from tests.published.arm_machine import STATE, rates
from wbc.coordinates import (
    BodyRows,
    CoordinatePair,
    JointRows,
    PairController,
    PitchPlaneRows,
    expressions,
    parts,
)
from wbc.robots import operator_arm

ALPHA, ROLL, YAW = PitchPlaneRows("F3", "F5"), JointRows("joint1"), JointRows("joint2")
XI, ELBOW = BodyRows("tip", name="xi"), BodyRows("end3", rotation=(), name="elbow")
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


def test_a2_counting() -> None:
    """Coordinates of seven bodies; pairs with a body's pose and one or two of the rest; square sub-matrices."""
    robot = operator_arm("ssrms").robot
    bodies = [f"F{k}" for k in range(1, robot.model.njoints)]
    every = [(body, row) for body in bodies for row in range(6)]
    assert len(every) == 42
    for count, wanted in ((1, 252), (2, 4410)):
        pairs = 0
        for body in bodies:
            rest = [one for one in every if one[0] != body]
            pairs += sum(1 for _ in combinations(rest, count))
        assert pairs == wanted
    # Of the rows that all those coordinates have, seven determine the joints wherever the arm is
    whole = expressions.rate_function(robot, tuple(BodyRows(body) for body in bodies))
    for q in (np.zeros(7), STATE, np.array([0.0, pi / 2, -pi / 2, pi, pi / 2, pi / 2, 0.0])):
        matrix = np.asarray(whole(q).full())
        assert (matrix.shape, np.linalg.matrix_rank(matrix, 1e-9)) == ((42, 7), 7)
    counts = [sum(1 for _ in combinations(range(tall), wide)) for tall, wide in ((7, 6), (8, 6), (11, 7))]
    assert counts == [7, 28, 330]


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
    (binding,) = [b for b in step.binding if b.item == "joint_limits"]
    assert (binding.bound, binding.row) == ("lower", "joint2")
    # -mu / 2 of (B.21) to (B.23), whose mu is 0.0500165; metres count by the characteristic length
    assert binding.multiplier == pytest.approx(-0.0500165 / 2 / robot.characteristic_length**2, rel=1e-5)


@pytest.mark.parametrize("unit", [1.0, 1000.0])
def test_a7_three_points_make_over_determined_answers_free_of_units(unit: float) -> None:
    """sum |v + w x d_i|^2 = e'We with the eigenvalues of W; the least squares of a pose in metres or millimetres."""
    control = PairController(
        operator_arm("spdm_arm").robot, CoordinatePair(XI, ELBOW, metric=1.0), limits=False, length=unit, backend="vm"
    )
    command = np.array((0.01, 0.02, 0.0, 0.01, 0.0, 0.02))
    v = rates(control, control.active, STATE, command)
    matrices, turn = control.rates(STATE), placement(control.robot, "tip", STATE).rotation
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
    held, q, farthest = placement(station.robot, "tip", STATE), STATE, 0.0
    for k in range(5000):
        step = station.step(q)
        assert step.certificate.violation < 1e-10
        q = q + 0.02 * step.v
        if k % 50 == 0:
            off = placement(station.robot, "tip", q).translation - held.translation
            farthest = max(farthest, float(np.linalg.norm(off)))
    assert farthest < 1e-6
    assert np.abs(q - STATE).max() > 0.5
