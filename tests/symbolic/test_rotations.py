"""Logarithm, exponential and quaternions of rotations: near 0, generic, near pi, and at pi."""

from __future__ import annotations

from functools import cache

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, strategies as st
from scipy.spatial.transform import Rotation

from wbc.symbolic import rotations as rot

R = ca.SX.sym("R", 3, 3)
W = ca.SX.sym("w", 3)
QUAT = ca.SX.sym("quat", 4)


def unit(*axis: float) -> np.ndarray:
    return np.array(axis) / np.linalg.norm(axis)


AXES = {
    "x": unit(1, 0, 0),
    "y": unit(0, 1, 0),
    "z": unit(0, 0, 1),
    "minus y": unit(0, -1, 0),
    "diagonal": unit(1, 1, 1),
    "xy": unit(1, 1, 0),
    "yz": unit(0, 1, -1),
    "slanted": unit(0.3, -0.5, 0.9),
    "almost x": unit(1, 1e-7, -1e-9),
}
SMALL = [10.0**-k for k in range(3, 13)]
LARGE = [np.pi - 10.0**-k for k in range(3, 10)]
GENERIC = [0.1, 0.5, 1.0, 1.9, 2.0, 2.1, 3.0]


@cache
def function(name: str) -> ca.Function:
    if name == "log3":
        return ca.Function(name, [R], [rot.log3(R), ca.jacobian(rot.log3(R), R)])
    if name == "log_quaternion":
        return ca.Function(name, [QUAT], [rot.log_quaternion(QUAT), ca.jacobian(rot.log_quaternion(QUAT), QUAT)])
    if name == "exp3":
        return ca.Function(name, [W], [rot.exp3(W), ca.jacobian(rot.exp3(W), W)])
    maps = {"left": rot.left_jacobian, "left_inverse": rot.left_jacobian_inverse}
    return ca.Function(name, [W], [maps[name](W), ca.jacobian(maps[name](W), W)])


def value(name: str, at: np.ndarray) -> np.ndarray:
    out = function(name)(at)[0].full()
    return out if name.startswith("left") else out.ravel()


def quaternion(axis: np.ndarray, angle: float) -> np.ndarray:
    return np.append(np.sin(angle / 2) * axis, np.cos(angle / 2))


def matrix(axis: np.ndarray, angle: float) -> np.ndarray:
    return Rotation.from_quat(quaternion(axis, angle)).as_matrix()


@pytest.mark.parametrize("angle", [0.0, *SMALL, *GENERIC, *LARGE])
def test_logarithm(angle: float) -> None:
    """Absolute error 4e-15 rad everywhere, relative error 1e-14 for small angles."""
    for axis in AXES.values():
        truth = angle * axis
        gap = np.abs(value("log3", matrix(axis, angle)) - truth).max()
        assert gap <= (min(4e-15, 1e-14 * angle) if angle < 1e-2 else 4e-15)
        for sign in (1.0, -1.0):
            assert np.abs(value("log_quaternion", sign * quaternion(axis, angle)) - truth).max() <= 4e-15


@pytest.mark.parametrize("axis", AXES)
def test_logarithm_at_pi_is_one_of_the_two(axis: str) -> None:
    a = AXES[axis]
    log = value("log3", 2 * np.outer(a, a) - np.eye(3))
    assert min(np.abs(log - np.pi * a).max(), np.abs(log + np.pi * a).max()) < 4e-15


@pytest.mark.parametrize("angle", [0.0, *SMALL, *GENERIC, np.pi - 1e-3])
def test_derivative_of_the_logarithm(angle: float) -> None:
    """d log3(R exp(d)) / dd through every branch against the closed form of Pinocchio."""
    for axis in AXES.values():
        turn = matrix(axis, angle)
        partial = function("log3")(turn)[1].full()
        columns = [(turn @ pin.skew(e)).ravel(order="F") for e in np.eye(3)]
        assert np.abs(partial @ np.array(columns).T - pin.Jlog3(turn)).max() < 1e-8


def test_value_and_derivative_are_finite_where_branches_meet() -> None:
    half_turns = [2 * np.outer(a, a) - np.eye(3) for a in AXES.values()]
    thirds = [matrix(AXES["diagonal"], 2 * np.pi / 3), matrix(AXES["diagonal"], np.pi / 2)]
    for turn in [np.eye(3), *half_turns, *thirds]:
        for out in function("log3")(turn):
            assert np.isfinite(out.full()).all()


@pytest.mark.parametrize("name", ["exp3", "left", "left_inverse"])
@pytest.mark.parametrize("angle", [0.0, *SMALL, 1e-4, 0.99e-2, 1.01e-2, *GENERIC, *LARGE, np.pi])
def test_maps_of_a_rotation_vector(name: str, angle: float) -> None:
    for axis in AXES.values():
        w = angle * axis
        ours, derivative = (out.full() for out in function(name)(w))
        theirs = {
            "exp3": lambda w=w: quaternion(w / max(angle, 1e-300), angle).reshape(4, 1),
            "left": lambda w=w: pin.Jexp3(-w),
            "left_inverse": lambda w=w: np.linalg.inv(pin.Jexp3(-w)),
        }[name]()
        assert np.abs(ours - theirs).max() < 1e-12
        assert np.isfinite(derivative).all()


@pytest.mark.parametrize("name", ["exp3", "left", "left_inverse"])
@pytest.mark.parametrize("angle", [0.0, 1e-5, 1e-4, 0.99e-2, 1.01e-2, 1.0, 3.0])
def test_derivatives_of_maps_of_a_rotation_vector(name: str, angle: float) -> None:
    """Against central differences, step 1e-5: 1e-9 of truncation and rounding."""
    w, h = angle * AXES["slanted"], 1e-5
    derivative = function(name)(w)[1].full()
    for k, e in enumerate(np.eye(3)):
        difference = (value(name, w + h * e) - value(name, w - h * e)) / (2 * h)
        assert np.abs(derivative[:, k] - difference.ravel(order="F")).max() < 1e-9


numbers = st.floats(-3.0, 3.0, allow_subnormal=False)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)


@given(vectors)
def test_rotation_of_a_quaternion(w: np.ndarray) -> None:
    turn = Rotation.from_rotvec(w)
    ours = ca.Function("f", [QUAT], [rot.from_quaternion(QUAT)])(turn.as_quat()).full()
    assert np.abs(ours - turn.as_matrix()).max() < 1e-14


@given(vectors, vectors)
def test_product_of_quaternions(u: np.ndarray, w: np.ndarray) -> None:
    a, b = Rotation.from_rotvec(u), Rotation.from_rotvec(w)
    product = rot.quaternion_product(ca.SX(a.as_quat()), ca.SX(b.as_quat()))
    assert np.abs(Rotation.from_quat(ca.DM(product).full().ravel()).as_matrix() - (a * b).as_matrix()).max() < 1e-14
    home = rot.quaternion_product(product, rot.quaternion_conjugate(product))
    assert np.abs(ca.DM(home).full().ravel() - (0, 0, 0, 1)).max() < 1e-14


@given(vectors, st.floats(-10, 10))
def test_rotation_about_an_axis(w: np.ndarray, angle: float) -> None:
    axis = w / np.linalg.norm(w) if np.linalg.norm(w) > 1e-3 else AXES["x"]
    ours = ca.DM(rot.from_axis_angle(axis, ca.SX(np.cos(angle)), ca.SX(np.sin(angle)))).full()
    assert np.abs(ours - Rotation.from_rotvec(angle * axis).as_matrix()).max() < 1e-13


def test_constants_lose_rounding_dust_only() -> None:
    quarter = pin.rpy.rpyToMatrix(np.pi / 2, 0.0, 0.0)
    assert rot.constant(quarter).nnz() == 3
    assert rot.constant(quarter)[2, 1].is_one()
    assert float(rot.constant(np.array([1e-13]))) == 1e-13
