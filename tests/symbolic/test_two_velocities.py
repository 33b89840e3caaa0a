"""M a + C(q, v) w + g and its regressor: Pinocchio's, on fixed, planar and floating bases, and dM/dt - 2 C skew."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from tests.symbolic.chains import chain
from tests.symbolic.referee import Array, load, random_state
from wbc.symbolic import Kinematics, TwoVelocityDynamics

CASES = [
    ("ur_description/urdf/ur5_robot.urdf", "fixed"),
    ("panda_description/urdf/panda.urdf", "floating"),
    ("double_pendulum_description/urdf/double_pendulum_continuous.urdf", "planar"),
    ("kinova_description/robots/kinova.urdf", "fixed"),
]


class Case:
    def __init__(self, model: pin.Model) -> None:
        self.model, self.data = model, model.createData()
        kin = Kinematics(model)
        self.dynamics = TwoVelocityDynamics(kin)
        own = self.dynamics
        given = [kin.q, kin.v, own.reference, own.acceleration, own.parameters]
        self.torques = ca.Function("torques", given, [own.torques, own.regressor])
        self.phi = np.concatenate([np.array(body.toDynamicParameters()) for body in model.inertias[1:]])
        self.q, self.v, self.a = random_state(model, "two velocities")
        self.w = np.random.default_rng(3).normal(size=model.nv)

    def __call__(self, v: Array, w: Array, a: Array) -> Array:
        return np.asarray(self.torques(self.q, v, w, a, self.phi)[0]).ravel()

    def coriolis(self) -> Array:
        """Column by column, C is linear in the second velocity."""
        none = np.zeros(self.model.nv)
        rest = self(self.v, none, none)
        return np.column_stack([self(self.v, unit, none) - rest for unit in np.eye(self.model.nv)])

    def mass_matrix(self, step: float) -> Array:
        return pin.crba(self.model, self.data, pin.integrate(self.model, self.q, step * self.v)).copy()


def check(case: Case) -> None:
    model, data, h = case.model, case.data, 1e-5
    C = case.coriolis()
    size = 1.0 + np.abs(C).max()
    np.testing.assert_allclose(C, pin.computeCoriolisMatrix(model, data, case.q, case.v), atol=1e-12 * size)
    still = pin.computeGeneralizedGravity(model, data, case.q) + case.mass_matrix(0.0) @ case.a
    np.testing.assert_allclose(case(case.v, case.w, case.a), C @ case.w + still, rtol=1e-11, atol=1e-11 * size)
    # The same velocity twice: inverse dynamics, and Pinocchio's regressor
    tau, Y = (np.asarray(out) for out in case.torques(case.q, case.v, case.v, case.a, case.phi))
    wanted = pin.rnea(model, data, case.q, case.v, case.a)
    np.testing.assert_allclose(tau.ravel(), wanted, rtol=1e-11, atol=1e-11 * np.abs(wanted).max())
    theirs = pin.computeJointTorqueRegressor(model, data, case.q, case.v, case.a)
    np.testing.assert_allclose(Y, theirs, atol=1e-11 * np.abs(theirs).max())
    # The rate of M by central differences, 1e-10 off at best
    rate = (case.mass_matrix(h) - case.mass_matrix(-h)) / (2.0 * h)
    skew = rate - 2.0 * C
    assert np.abs(skew + skew.T).max() < 1e-7 * size


@pytest.mark.parametrize(("file", "base"), CASES, ids=[f"{base}-{file}" for file, base in CASES])
def test_agrees_with_pinocchio(file: str, base: str) -> None:
    check(Case(load(file, base)))


def test_joints_whose_axes_move() -> None:
    """S(q) of universal and Euler joints turns: Pinocchio's Coriolis matrix is not asked, M' - 2 C is."""
    model = chain([pin.JointModelFreeFlyer(), pin.JointModelSphericalZYX(), pin.JointModelUniversal(*np.eye(3)[:2])])
    case, h = Case(model), 1e-5
    C = case.coriolis()
    rate = (case.mass_matrix(h) - case.mass_matrix(-h)) / (2.0 * h)
    skew = rate - 2.0 * C
    assert np.abs(skew + skew.T).max() < 1e-7 * (1.0 + np.abs(C).max())
    wanted = pin.rnea(model, case.data, case.q, case.v, case.a)
    np.testing.assert_allclose(case(case.v, case.v, case.a), wanted, atol=1e-10 * np.abs(wanted).max())


def test_the_gradient_is_the_regressor_transposed() -> None:
    case = Case(load("ur_description/urdf/ur5_robot.urdf", "floating"))
    kin, own = case.dynamics.kinematics, case.dynamics
    s = ca.SX.sym("s", kin.nv)
    gradient = ca.Function("gradient", [kin.q, kin.v, own.reference, own.acceleration, s], [own.gradient(s)])
    Y = np.asarray(case.torques(case.q, case.v, case.w, case.a, case.phi)[1])
    found = np.asarray(gradient(case.q, case.v, case.w, case.a, case.w)).ravel()
    np.testing.assert_allclose(found, Y.T @ case.w, atol=1e-11 * np.abs(found).max())
