"""What the thesis on Newton and Euler's equations has wrong in print, each beside what is right.

Two misprints cannot be shown by physics: the mass of link 3, 6.25 kg in the table and 4.25 kg in the list of inputs,
and everything that depends on which of them the lost plots had.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from tests.published.newton_euler_arm import (
    ARM,
    DRIVE,
    DT,
    STIFF,
    Q,
    R,
    at,
    referee,
    step_model,
)
from wbc.errors import RangeError
from wbc.published.newton_euler import Decoupling, Estimator, External, SerialChain, discretised, equations, gain
from wbc.published.newton_euler.recursion import Inertial, inertial
from wbc.published.newton_euler.three_link import GRAVITY, closed_form, tip
from wbc.validation import Array


def with_link(i: int, **changes: object) -> SerialChain:
    """The arm with a number of the table as printed."""
    links = list(ARM.links)
    links[i] = replace(links[i], **changes)  # type: ignore[arg-type]
    return replace(ARM, links=tuple(links))


def chained_tip(arm: SerialChain, q: Array) -> Array:
    """The tip from joint 1 by the vectors of the links."""
    rotations, *_ = arm.place(q)
    joints, centres = arm.positions(q)
    return np.asarray(centres[-1] - rotations[-1] @ arm.links[-1].next_lever - joints[0])


def test_table_1_inertia_of_link_2() -> None:
    """6.100 for 0.100 kg m^2: no body has a moment above the sum of the two others."""
    with pytest.raises(RangeError, match="none above the sum"):
        with_link(1, inertia=np.array([0.108, 0.018, 6.100]))


@pytest.mark.parametrize(
    ("i", "lever", "off"),
    [(1, np.array([0.0, -0.1054, 6.0]), 6.0), (2, np.array([0.0, 0.0, -0.6647]), 0.02)],
)
def test_table_1_levers(i: int, lever: Array, off: float) -> None:
    """6.0 for 0.0 m of link 2 and -0.6647 for -0.6447 m of link 3: the tip is not where (A.69) has it."""
    q = np.array([0.3, 0.7, 0.45])
    np.testing.assert_allclose(chained_tip(ARM, q), tip(q), atol=1e-12)
    assert np.linalg.norm(chained_tip(with_link(i, lever=lever), q) - tip(q)) == pytest.approx(off)


def test_classes_of_joints() -> None:
    """1, 4, 4 are given (6 in the table); by the definitions of the text 1, 3, 3: no r_i-1,i lies on an axis.

    1: no lever lies along the axis, 2: that of the link before, 3: its own, 4: both.
    """

    def along(lever: Array, axis: Array) -> bool:
        return bool(np.linalg.norm(np.cross(axis, lever)) <= 1e-9 * np.linalg.norm(lever))

    pairs = [(ARM.before(i)[:2], link) for i, link in enumerate(ARM.links)]
    assert [1 + along(lever, axis) + 2 * along(own.lever, own.axis) for (axis, lever), own in pairs] == [1, 3, 3]


def test_b88_leaves_the_base_turning_out_of_the_accelerations() -> None:
    """With alpha_0 in the moments only, as printed, torques are wrong; Pinocchio has the corrected ones."""
    rng, model = np.random.default_rng(1), ARM.model.copy()
    q, v, turning = rng.normal(size=(3, 3))
    model.gravity = pin.Motion(np.array([0, 0, -GRAVITY]), -turning)
    right = equations(ARM, q, v, External(angular=turning)).h
    np.testing.assert_allclose(right, pin.nonLinearEffects(model, model.createData(), q, v), atol=1e-12)
    rotations, axes, _, _ = ARM.place(q)
    moments = [A @ (link.inertia * (A.T @ turning)) for A, link in zip(rotations, ARM.links, strict=True)]
    added = [0.0 if ARM.links[i].prismatic else sum(moments[i:]) @ axes[i] for i in range(3)]
    printed = equations(ARM, q, v).h + added
    assert np.abs(printed - right).min() > 0.1


def parts(k: int) -> tuple[Inertial, Array]:
    q, v, a = at(k)
    return inertial(ARM, q, v, None, derivatives=False), a


def test_listing_inertia_takes_the_wrong_acceleration() -> None:
    """BIJ(I,J)*QDD(I) for QDD(J) in the moments: at step 50 torque 2 is 9.78 N m for 14.78."""
    found, a = parts(50)

    def torques(defect: bool) -> list[float]:
        out = []
        for i in range(3):
            total = np.zeros(3)
            for j in range(i, 3):
                force = a @ found.forces[j][0, :3] + found.forces[j][0, 3]
                factor = a[j] if defect else a[:, None]
                moment = (factor * found.moments[j][0, :3]).sum(axis=0) + found.moments[j][0, 3]
                arm = found.lever(j, i)[0]
                total += force if ARM.links[i].prismatic else moment + np.cross(arm, force)
            out.append(float(-total @ found.axes[i][0]))
        return out

    np.testing.assert_allclose(torques(False), (0.6218, 14.7777, 43.1215), atol=1e-4)
    np.testing.assert_allclose(torques(True), (1.2518, 9.7772, 43.1215), atol=1e-4)


def test_listing_sums_h_from_the_wrong_link() -> None:
    """DO J=K for J=max(I,K): links before joint i are counted, and H is not symmetric."""
    found, _ = parts(50)

    def mass_matrix(defect: bool) -> Array:
        H = np.zeros((3, 3))
        for i in range(3):
            for k in range(3):
                for j in range(k if defect else max(i, k), 3):
                    arm = found.lever(j, i)[0]
                    for last in range(j, i):  # back from joint i to the centre of a link before it
                        arm = arm - found.levers[last][0] + found.before[last + 1][0]
                    force, moment = found.forces[j][0, k], found.moments[j][0, k]
                    total = force if ARM.links[i].prismatic else moment + np.cross(arm, force)
                    H[i, k] -= total @ found.axes[i][0]
        return H

    right, wrong = mass_matrix(False), mass_matrix(True)
    np.testing.assert_allclose(right, pin.crba(referee(), referee().createData(), at(50)[0]), atol=1e-12)
    np.testing.assert_allclose(np.triu(wrong), np.triu(right), atol=1e-12)
    assert wrong[1, 0] == pytest.approx(0.160, abs=1e-4)
    assert right[1, 0] == pytest.approx(0.178, abs=1e-4)
    assert wrong[2, 0] == pytest.approx(0.0636, abs=1e-4)
    assert right[2, 0] == pytest.approx(-0.2874, abs=1e-4)


def test_listing_reads_the_wrong_vector_for_h() -> None:
    """Without the step from joint to joint in RJI, h1 has the wrong sign at step 50."""
    found, _ = parts(50)

    def h1(defect: bool) -> float:
        total = np.zeros(3)
        for j in range(3):
            arm = sum((found.levers[k][0] for k in range(j + 1)), np.zeros(3)) if defect else found.lever(j, 0)[0]
            total += found.moments[j][0, 3] + np.cross(arm, found.forces[j][0, 3])
        return float(-total @ found.axes[0][0])

    assert h1(False) == pytest.approx(0.345, abs=1e-3)
    assert h1(True) == pytest.approx(-0.489, abs=1e-3)


def test_3_3_needs_the_inverse_of_h() -> None:
    """q'' = B (tau - h) is printed: B is the input matrix of the motors, and has other rows."""
    q, v, a = at(50)
    model = equations(ARM, q, v)
    torque = model.torque(a)
    np.testing.assert_allclose(np.linalg.inv(model.H) @ (torque - model.h), a, atol=1e-12)
    assert DRIVE.system[1].shape == (6, 3)
    assert np.abs(model.H @ (torque - model.h) - a).max() > 1.0


def test_c128_sign_of_gravity() -> None:
    """+k6 sin q2 gives q2'' = 6.577370 at step 50 for 2.704364; its own Lagrangian gives the minus."""
    q, v, a = at(50)
    torque = equations(ARM, q, v).torque(a)
    c, d = closed_form(q, v, printed=True)
    assert c[0] + d[0] * torque[1] == pytest.approx(6.577370, abs=1e-6)
    s = ca.SX.sym("s", 4)
    q2, q3, v2, v3 = (s[k] for k in range(4))
    m3, k3 = 4.25, 0.6447
    kinetic = ((0.018 + 2.51 + m3 * (q3 - k3) ** 2) * v2**2 + m3 * v3**2) / 2
    lagrangian = kinetic - m3 * GRAVITY * ((q3 - k3) * ca.cos(q2) + k3)
    momentum = ca.jacobian(lagrangian, s[2:]).T
    force = ca.jacobian(lagrangian, s[:2]).T - ca.jacobian(momentum, s[:2]) @ s[2:]
    free = ca.Function("free", [s], [ca.solve(ca.jacobian(momentum, s[2:]), force)])
    found = np.array(free([*q[1:], *v[1:]])).ravel()
    np.testing.assert_allclose(closed_form(q, v)[0], found, atol=1e-12)


def test_sign_of_g_in_the_decoupling_law() -> None:
    """G = D*^-1 Lambda: with a minus, as the smeared print can be read, y'' + a1 y' + a0 y = -a0 v."""
    x, t = ca.SX.sym("x", 2), ca.SX.sym("t")
    law = Decoupling(
        x, t, ca.vertcat(x[1], -ca.sin(x[0])), ca.vertcat(0, 2), x[0], ca.SX.zeros(1, 1), poles=((-100, -100),)
    )
    state, v = np.array([0.3, -2.0]), np.array([0.5])
    second = -np.sin(0.3) + 2 * law.input(state, v)[0]
    assert second + 200 * state[1] + 1e4 * state[0] == pytest.approx(1e4 * v[0])
    second = -np.sin(0.3) + 2 * law.input(state, -v)[0]
    assert second + 200 * state[1] + 1e4 * state[0] == pytest.approx(-1e4 * v[0])


@pytest.mark.parametrize(("forgets", "wanted"), [(True, 1.0 + 0.2775 / (1 - 0.85**40)), (False, 1.05)])
def test_7_59_forgets_nothing(forgets: bool, wanted: float) -> None:
    """rho is called a forgetting factor: as printed, the estimate of a value is the mean of all samples.

    With 1/rho it weighs a sample by 0.85 to the power of its age: 2 of 40 samples count for 28 of 100.
    """
    found = Estimator(np.zeros((1, 1)), rho=0.85, start=1e9, forgets=forgets)
    for k in range(40):
        found.update(np.ones(1), np.array([1.0 if k < 38 else 2.0]))
    assert found.theta[0, 0] == pytest.approx(wanted, rel=1e-6)


def test_equal_weights_have_no_stiffness() -> None:
    """The published Q leaves errors of positions time constants of minutes; 10^4 times more on them a few steps."""
    Phi, E = discretised(np.array([[0.0, 1.0], [0.0, 0.0]]), DT)
    Gamma = E @ np.array([[0.0], [1.0]])
    slowest = []
    for weights in (1e5 * np.eye(2), np.diag([1e9, 1e5])):
        K = gain(Phi, Gamma, weights, 0.01 * np.eye(1))
        slowest.append(float(np.abs(np.linalg.eigvals(Phi - Gamma @ K)).max()))
    assert -DT / np.log(slowest[0]) == pytest.approx(200.0, rel=0.02)
    assert slowest[1] == pytest.approx(0.59979, abs=1e-4)
    Phi, Gamma = step_model(50)
    poles = [np.abs(np.linalg.eigvals(Phi - Gamma @ gain(Phi, Gamma, w, R))).max() for w in (Q, STIFF)]
    assert poles[0] > 0.9999
    assert poles[1] < 0.7
