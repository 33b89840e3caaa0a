"""Equations of motion by Newton and Euler, by coefficients of the joint accelerations, and their derivatives.

    tau = H(q) q'' + h(q, q')
    d tau = H dq'' + H1 dq' + H2 dq,   H1 = dh/dq',   H2 = dH/dq q'' + dh/dq

Every vector below is a jet, [rows, ..., 3]: row 0 is its value and row 1 + l its derivative by coordinate l of
(q, q'). Derivatives come from the rules da/dq_l = e_l x a (B.119, B.121) and the product rule, which the thesis
writes out by hand, array by array. Source: appendix B, equations B.75 to B.118.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.published.newton_euler.links import SerialChain
from wbc.validation import Array

#: A mass matrix of a larger condition has no inverse worth having
SINGULAR = 1e12


@dataclass(frozen=True, eq=False)
class External:
    """What acts on an arm besides its motors.

    Attributes:
        forces, moments: on each link at its centre of mass, in the base, [n, 3] [N, N m]; None: none.
        angular: acceleration of the base's turning, alpha_0 [3] [rad/s^2].
    """

    forces: Array | None = None
    moments: Array | None = None
    angular: Array | None = None


@dataclass(frozen=True, eq=False)
class Inertial:
    """Forces and moments of inertia of the links, by coefficients (B.95 to B.103).

    Attributes:
        forces, moments: a_ij and b_ij, n jets [rows, n + 1, 3]; the last column is a_i0 and b_i0, gravity and external
            loads included.
        axes, levers, before: e_i, r_ii and r_i-1,i, n jets [rows, 3].
    """

    forces: list[Array]
    moments: list[Array]
    axes: list[Array]
    levers: list[Array]
    before: list[Array]

    def lever(self, j: int, i: int) -> Array:
        """r_ji, from joint i to the centre of mass of link j >= i, a jet [rows, 3]."""
        return self.levers[j] + sum((self.levers[k] - self.before[k + 1] for k in range(i, j)), np.zeros(3))


@dataclass(frozen=True, eq=False)
class Equations:
    """H [n, n] and h [n] of tau = H q'' + h."""

    H: Array
    h: Array

    def torque(self, acceleration: Array) -> Array:
        """tau [n] for q'' [n] (B.111)."""
        return np.asarray(self.H @ acceleration + self.h)

    def acceleration(self, torque: Array) -> Array:
        """q'' = H^-1 (tau - h) [n].

        Raises:
            RangeError: H is singular.
        """
        return np.asarray(np.linalg.solve(regular(self.H), torque - self.h))


@dataclass(frozen=True, eq=False)
class LinearModel(Equations):
    """The model along a motion, with H1 and H2 [n, n] (B.116)."""

    H1: Array
    H2: Array

    @property
    def system(self) -> tuple[Array, Array]:
        """A [2n, 2n] and B [2n, n] of x' = A x + B dtau with x = (dq, dq') (B.118)."""
        n = len(self.h)
        inverse = np.linalg.inv(regular(self.H))
        zero = np.zeros((n, n))
        A = np.block([[zero, np.eye(n)], [-inverse @ self.H2, -inverse @ self.H1]])
        return A, np.vstack([zero, inverse])


def regular(H: Array) -> Array:
    """H, if it has an inverse.

    Raises:
        RangeError: it has none.
    """
    if not np.linalg.cond(H) < SINGULAR:
        raise RangeError("H", H, "the mass matrix is singular")
    return H


def equations(arm: SerialChain, q: Array, v: Array, external: External | None = None) -> Equations:
    """H and h at joint positions q and velocities v, [n] each."""
    H, h = _sums(inertial(arm, q, v, external, derivatives=False), arm)
    return Equations(H[0], h[0])


def linear_model(arm: SerialChain, q: Array, v: Array, a: Array, external: External | None = None) -> LinearModel:
    """The model linearised about positions q, velocities v and accelerations a, [n] each."""
    H, h = _sums(inertial(arm, q, v, external, derivatives=True), arm)
    n = arm.n
    return LinearModel(H[0], h[0], h[1 + n :].T, (H[1 : 1 + n] @ a + h[1 : 1 + n]).T)


def inertial(arm: SerialChain, q: Array, v: Array, external: External | None, *, derivatives: bool) -> Inertial:
    """The recursion from the base to the tip (B.75 to B.103)."""
    n, external = arm.n, external or External()
    q, v = validation.ordinary_array("q", q, (n,)), validation.ordinary_array("v", v, (n,))
    load = np.zeros((n, 3)) if external.forces is None else validation.ordinary_array("forces", external.forces, (n, 3))
    moment = (
        np.zeros((n, 3)) if external.moments is None else validation.ordinary_array("moments", external.moments, (n, 3))
    )
    rotations, axes, levers, before = _place(arm, q, derivatives)
    rows = len(axes[0])
    rate = np.zeros((rows, n, 1))
    rate[0, :, 0] = v
    if derivatives:
        rate[1 + n + np.arange(n), np.arange(n)] = 1.0
    omega, theta, eta = (np.zeros((rows, 3)) for _ in range(3))
    if external.angular is not None:
        # As part of theta it reaches the accelerations of the centres as well, which (B.88) leaves out
        theta[0] = validation.ordinary_array("angular", external.angular, (3,))
    eta[0, 2] = arm.gravity
    alpha, beta = np.zeros((rows, n, 3)), np.zeros((rows, n, 3))
    out = Inertial([], [], axes, levers, before)
    for i, link in enumerate(arm.links):
        e, own, last = axes[i], levers[i], before[i]
        step = own - last
        spin = _times(rate[:, i], _cross(omega, e))
        beta = beta + _cross(alpha, step[:, None])
        eta = eta + _cross(theta, step) - _cross(omega, _cross(omega, last))
        if link.prismatic:
            beta[:, i] = e
            eta = eta + 2.0 * spin
        else:
            alpha = alpha.copy()
            alpha[:, i] = e
            beta[:, i] = _cross(e, own)
            eta = eta + _cross(spin, own)
            theta = theta + spin
            omega = omega + _times(rate[:, i], e)
        eta = eta + _cross(omega, _cross(omega, own))
        forces = -link.mass * np.concatenate([beta, eta[:, None]], axis=1)
        forces[0, -1] += load[i]
        turned = np.concatenate([alpha, theta[:, None]], axis=1)
        moments = -_about(rotations[i], link.inertia, turned)
        moments[:, -1] += _gyroscopic(rotations[i], link.inertia, omega)
        moments[0, -1] += moment[i]
        out.forces.append(forces)
        out.moments.append(moments)
    return out


def _place(arm: SerialChain, q: Array, derivatives: bool) -> tuple[list[Array], ...]:
    """Columns of A_i [rows, 3, 3], and e_i, r_ii, r_i-1,i [rows, 3], n of each."""
    rotations, axes, levers, before = arm.place(q)
    rows = 1 + 2 * arm.n if derivatives else 1
    turning = np.array([0.0 * e if link.prismatic else e for link, e in zip(arm.links, axes, strict=True)])

    def jet(value: Array, links: int) -> Array:
        """Of vectors [..., 3] that go with the first ``links`` joints (B.119, B.121)."""
        out = np.zeros((rows, *value.shape))
        out[0] = value
        if derivatives:
            out[1 : 1 + links] = _crossed(turning[:links].reshape(links, *[1] * (value.ndim - 1), 3), value)
        return out

    own = [jet(lever, i + 1) for i, lever in enumerate(levers)]
    for i, link in enumerate(arm.links):
        if derivatives and link.prismatic:
            own[i][1 + i] += axes[i]
    return (
        [jet(rotation.T, i + 1) for i, rotation in enumerate(rotations)],
        [jet(axis, i) for i, axis in enumerate(axes)],
        own,
        [jet(lever, i) for i, lever in enumerate(before)],
    )


def _sums(found: Inertial, arm: SerialChain) -> tuple[Array, Array]:
    """H [rows, n, n] and h [rows, n]: what the joints carry of all links beyond them (B.104 to B.115)."""
    n = arm.n
    out = np.zeros((len(found.axes[0]), n, n + 1))
    force, moment = np.zeros_like(found.forces[0]), np.zeros_like(found.forces[0])
    for i in range(n - 1, -1, -1):
        if i + 1 < n:
            moment = moment + _cross((found.levers[i] - found.before[i + 1])[:, None], force)
        force = force + found.forces[i]
        moment = moment + found.moments[i] + _cross(found.levers[i][:, None], found.forces[i])
        out[:, i] = -_dot(force if arm.links[i].prismatic else moment, found.axes[i][:, None])[..., 0]
    return out[..., :n], out[..., n]


def _product(rule: Callable[[Array, Array], Array], a: Array, b: Array) -> Array:
    """Jet of a bilinear product."""
    if len(a) == 1:
        return rule(a, b)
    out = rule(a, b[:1]) + rule(a[:1], b)
    out[0] *= 0.5
    return out


_LEFT = [1, 2, 0]
_RIGHT = [2, 0, 1]


def _crossed(x: Array, y: Array) -> Array:
    return np.asarray(x[..., _LEFT] * y[..., _RIGHT] - x[..., _RIGHT] * y[..., _LEFT])


def _cross(a: Array, b: Array) -> Array:
    return _product(_crossed, a, b)


def _dot(a: Array, b: Array) -> Array:
    return _product(lambda x, y: np.asarray((x * y).sum(axis=-1, keepdims=True)), a, b)


def _times(a: Array, b: Array) -> Array:
    return _product(np.multiply, a, b)


def _about(rotation: Array, inertia: Array, turned: Array) -> Array:
    """T turned, with T = A diag(J) A', for vectors [rows, k, 3]."""
    return np.asarray(
        sum(inertia[k] * _times(_dot(turned, rotation[:, k, None]), rotation[:, k, None]) for k in range(3))
    )


def _gyroscopic(rotation: Array, inertia: Array, omega: Array) -> Array:
    """lambda = A ((J2 - J3) w2 w3, (J3 - J1) w3 w1, (J1 - J2) w1 w2) (B.103)."""
    w = [_dot(omega, rotation[:, k]) for k in range(3)]
    parts = [
        (inertia[j] - inertia[k]) * _times(_times(w[j], w[k]), rotation[:, i])
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    ]
    return np.asarray(sum(parts))
