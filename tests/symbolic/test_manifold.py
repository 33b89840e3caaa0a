"""Integration, difference and the tangent map on a model with every kind of configuration space."""

from __future__ import annotations

from functools import cache

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings, strategies as st

from tests.symbolic.chains import chain, composite
from wbc.symbolic import Kinematics

#: Where the mixed model's planar joint stands in q; it has a test of its own.
PLANAR = slice(7, 11)
few = settings(max_examples=20)


@cache
def mixed() -> tuple[pin.Model, Kinematics]:
    joints = [
        pin.JointModelFreeFlyer(),
        pin.JointModelPlanar(),
        pin.JointModelSpherical(),
        pin.JointModelRUBY(),
        pin.JointModelPX(),
        composite(pin.JointModelRUBX(), pin.JointModelSpherical(), pin.JointModelRZ()),
        pin.JointModelSphericalZYX(),
    ]
    model = chain(joints)
    return model, Kinematics(model)


@cache
def maps() -> dict[str, ca.Function]:
    _, kin = mixed()
    other = ca.SX.sym("q1", kin.nq)
    return {
        "integrate": ca.Function("integrate", [kin.q, kin.v], [kin.integrate(kin.q, kin.v)]),
        "difference": ca.Function("difference", [kin.q, other], [kin.difference(kin.q, other)]),
        "tangent": ca.Function("tangent", [kin.q], [kin.tangent_map]),
    }


def call(name: str, *args: np.ndarray) -> np.ndarray:
    out = maps()[name](*args).full()
    return out if name == "tangent" else out.ravel()


def velocities(size: float) -> st.SearchStrategy[np.ndarray]:
    """Velocities of the mixed model with entries up to ``size``."""
    nv = mixed()[0].nv
    entry = st.floats(-size, size, allow_subnormal=False)
    return st.lists(entry, min_size=nv, max_size=nv).map(np.array)


@st.composite
def configurations(draw: st.DrawFn) -> np.ndarray:
    model, _ = mixed()
    return np.array(pin.integrate(model, pin.neutral(model), draw(velocities(3.0))))


@few
@given(configurations(), velocities(1.5))
def test_difference_undoes_integration(q: np.ndarray, v: np.ndarray) -> None:
    """Turns stay under pi: |(1.5, 1.5, 1.5)| = 2.6."""
    moved = call("integrate", q, v)
    assert np.abs(call("difference", q, moved) - v).max() < 1e-12
    gap = np.abs(moved - pin.integrate(mixed()[0], q, v))
    gap[PLANAR] = 0.0
    assert gap.max() < 1e-12


@pytest.mark.parametrize("turn", [0.0, *(10.0**-k for k in range(14)), 0.009, 0.011, 2.0, 3.0, -1e-5, -3.0])
def test_planar_integration_follows_the_arc(turn: float) -> None:
    """x = v sin(w)/w, y = v (1 - cos(w))/w to rounding, where pin 4.1.0 is off by up to 6e-7 for tiny turns."""
    kin = Kinematics(chain([pin.JointModelPlanar()]))
    start, step = np.array([0.3, -0.2, 1.0, 0.0, 0.0]), np.array([1.5, 0.0, turn, 0.0])
    function = ca.Function("f", [kin.q, kin.v], [kin.integrate(kin.q, kin.v)])
    x, y = 1.5 * np.sinc(turn / np.pi), 1.5 * np.sin(turn / 2) * np.sinc(turn / 2 / np.pi)
    truth = np.array([0.3 + x, -0.2 + y, np.cos(turn), np.sin(turn), 0.0])
    moved = function(start, step).full().ravel()
    assert np.abs(moved - truth).max() < 1e-13
    back = ca.Function("d", [kin.q, kin.v], [kin.difference(kin.q, kin.integrate(kin.q, kin.v))])(start, step)
    assert np.abs(back.full().ravel() - step).max() < 1e-13


@few
@given(configurations(), configurations())
def test_integration_of_the_difference_arrives(q0: np.ndarray, q1: np.ndarray) -> None:
    model, _ = mixed()
    step = call("difference", q0, q1)
    assert np.isfinite(step).all()
    arrived = call("integrate", q0, step)
    assert pin.isNormalized(model, arrived, 1e-12)
    # Pinocchio's distance, as a quaternion and its negative are one rotation
    assert np.abs(pin.difference(model, arrived, q1)).max() < 1e-9


@few
@given(configurations(), velocities(1.0))
def test_no_step_goes_nowhere(q: np.ndarray, v: np.ndarray) -> None:
    assert np.abs(call("integrate", q, 0.0 * v) - q).max() < 1e-15
    assert np.abs(call("difference", q, q)).max() < 1e-14


@few
@given(configurations(), velocities(1.0))
def test_tangent_map_is_the_derivative_of_integration(q: np.ndarray, v: np.ndarray) -> None:
    """Central difference, step 1e-4, of our integrate: 1e-8 of truncation."""
    h = 1e-4
    rate = (call("integrate", q, h * v) - call("integrate", q, -h * v)) / (2 * h)
    assert np.abs(call("tangent", q) @ v - rate).max() < 1e-7


@cache
def derivatives() -> tuple[ca.Function, ca.Function]:
    """(value, (whole derivative, derivative along v)) of an expression of poses and the centre of mass."""
    _, kin = mixed()
    pose = kin.pose("tip")
    f = ca.vertcat(pose.position, pose.rotation[:, 0], ca.sumsqr(kin.center_of_mass))
    both = ca.Function("d", [kin.q, kin.v], [kin.derivative(f), kin.directional(f, kin.v)])
    return ca.Function("f", [kin.q], [f]), both


@few
@given(configurations(), velocities(1.0))
def test_the_derivative_of_an_expression_is_taken_on_the_tangent_space(q: np.ndarray, v: np.ndarray) -> None:
    model, _ = mixed()
    function, both = derivatives()
    whole, along = (m.full() for m in both(q, v))
    assert np.abs(whole @ v - along.ravel()).max() < 1e-12 * (1.0 + np.abs(whole).max())
    h = 1e-4
    plus, minus = (function(pin.integrate(model, q, s * v)).full().ravel() for s in (h, -h))
    assert np.abs(along.ravel() - (plus - minus) / (2 * h)).max() < 1e-5
