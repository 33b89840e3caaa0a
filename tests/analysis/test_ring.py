"""Exact numbers and polynomials: what is written is what is computed with."""

from __future__ import annotations

from fractions import Fraction
from math import pi

import numpy as np
import pinocchio as pin
import pytest

from wbc.analysis import ExactModel, Relation, Value
from wbc.analysis.algebra.half_angles import HalfAngles
from wbc.analysis.algebra.points import joint_roots, univariate_roots
from wbc.analysis.algebra.ring import Coordinate, Poly, TrigRing, written
from wbc.analysis.algebra.transforms import dot
from wbc.errors import DuplicateNameError, NotFiniteError, RangeError, RotationError, UnsupportedJointError
from wbc.robot import Limits, Robot
from wbc.robots import operator_arm

RING = TrigRing([Coordinate(k, k, str(k + 1)) for k in range(3)])
HALF = HalfAngles(RING)


def conditions(p: Poly) -> list[Value | Relation]:
    return [factor for factor, _ in HALF.factors(p).conditions]


def relation_of(p: Poly) -> Relation:
    (found,) = conditions(p)
    assert isinstance(found, Relation)
    return found


def test_floats_are_taken_as_written() -> None:
    assert written(7.11) == Fraction(711, 100)
    assert written(0.1 + 0.2) == Fraction(3, 10)
    assert written(-1e-3) == Fraction(-1, 1000)
    with pytest.raises(NotFiniteError):
        written(float("nan"))


def test_equal_functions_are_equal_polynomials() -> None:
    c, s = RING.cosine(0), RING.sine(0)
    assert RING.normal(s**3 + s * c * c) == s
    assert RING.times(1 - c, 1 + c) == RING.times(s, s)


def test_factors_are_found_that_the_normal_form_hides() -> None:
    """s1 (c1 + s1 c2) is written without a factor s1 once s1^2 is replaced."""
    c, s = RING.cosine(0), RING.sine(0)
    found = conditions(RING.normal(s * (c + s * RING.cosine(1))))
    assert Value(0, Fraction(0)) in found
    assert Value(0, None) in found
    assert len(found) == 3


def test_roots_of_one_joint_are_exact_and_all_there() -> None:
    c, s = RING.cosine(0), RING.sine(0)
    assert conditions(c) == [Value(0, Fraction(-1)), Value(0, Fraction(1))]
    assert conditions(s) == [Value(0, Fraction(0)), Value(0, None)]
    assert conditions(1 + c) == [Value(0, None)]
    assert conditions(3 * c + 4 * s - 5) == [Value(0, Fraction(1, 2))]
    np.testing.assert_allclose(
        univariate_roots(HALF, relation_of(3 * c - 1)), (-np.arccos(1 / 3), np.arccos(1 / 3)), atol=1e-14
    )
    assert univariate_roots(HALF, relation_of(c - 3)) == ()
    assert univariate_roots(HALF, relation_of(c * c + 1)) == ()


def test_roots_in_one_joint_with_the_others_given() -> None:
    """cos q1 + cos q2 = 0 falls apart in half angles: q2 = pi - q1 and q2 = q1 - pi."""
    found = conditions(RING.cosine(0) + RING.cosine(1))
    q = np.array([0.4, 0.0, 0.0])
    roots = [r for relation in found if isinstance(relation, Relation) for r in joint_roots(HALF, relation, 1, q)]
    np.testing.assert_allclose(sorted(roots), (0.4 - pi, pi - 0.4), atol=1e-12)


def test_a_sign_of_a_length_is_kept_by_its_symbol() -> None:
    model = ExactModel(operator_arm("ssrms").robot, {"D": -0.7026})
    shift = model.frame_in("F2", "F3").position[2]
    assert str(shift) == "-D"
    with pytest.raises(DuplicateNameError):
        ExactModel(operator_arm("ssrms").robot, {"D": -0.7026, "E": 0.7026})
    with pytest.raises(RangeError):
        ExactModel(operator_arm("ssrms").robot, {"D": 0.0})
    with pytest.raises(DuplicateNameError):
        ExactModel(operator_arm("ssrms").robot, {"c3": 7.11})


def _one_joint(joint: pin.JointModel, placement: pin.SE3) -> Robot:
    model = pin.Model()
    model.addJoint(0, joint, placement, "joint")
    model.addFrame(pin.Frame("end", 1, 0, pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.0])), pin.FrameType.OP_FRAME))
    free = np.full(model.nv, np.inf)
    return Robot("one", model, Limits(-free, free, free, free, free))


def test_rotations_that_are_not_exact_are_refused_or_named() -> None:
    turned = pin.SE3(pin.AngleAxis(0.3, np.array([0.0, 0.6, 0.8])).matrix(), np.zeros(3))
    robot = _one_joint(pin.JointModelRX(), turned)
    with pytest.raises(RotationError, match="joint 'joint'"):
        ExactModel(robot)
    model = ExactModel(robot, approximate=True)
    assert len(model.notes) == 1
    assert "deg off" in model.notes[0]
    rotation = model.joint_in("world", 1).rotation
    gram = [[str(dot(list(a), list(b), model.ring)) for b in rotation] for a in rotation]
    assert gram == [["1", "0", "0"], ["0", "1", "0"], ["0", "0", "1"]]


def test_joints_with_more_than_one_axis_are_refused() -> None:
    with pytest.raises(UnsupportedJointError):
        ExactModel(_one_joint(pin.JointModelFreeFlyer(), pin.SE3.Identity()))
