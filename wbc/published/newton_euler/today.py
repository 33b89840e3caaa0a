"""What the field does today on the same seam, for any ``pin.Model`` of turning and sliding joints.

    computed torque   tau = M (a_d + k_d e' + k_p e) + h,  e = q_d - q
    Slotine and Li    tau = Y(q, v, v_r, a_r) theta + K s,  theta' = Gamma Y' s
                      v_r = v_d + lambda e, a_r = v_r', s = v_r - v

Y theta = M a_r + C(q, v) v_r + g with C by Christoffel's symbols, so that M' - 2 C is skew: C(q, v) w is bilinear and
symmetric in v and w, and half of c(v + w) - c(v) - c(w), where c(v) = C(q, v) v. Source: Slotine and Li, On the
adaptive control of robot manipulators, IJRR 6(3), 1987.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc import validation
from wbc.errors import RangeError
from wbc.published.newton_euler.control import measured
from wbc.published.newton_euler.simulation import rigid
from wbc.published.newton_euler.three_link import Motion
from wbc.validation import Array


class ComputedTorque:
    """Computed torque with a model, poles both at -omega [1/s]."""

    def __init__(self, model: pin.Model, motion: Motion, omega: float) -> None:
        self.equations, self.motion = rigid(model), motion
        self.omega = validation.scalar("omega", omega, low=0.0, open_low=True, unit="1/s")

    def command(self, time: float, q: Array, v: Array) -> Array:
        """Torques [n]."""
        q, v = measured(q, v, len(q))
        qd, vd, ad = self.motion(time)
        return self.equations(q, v).torque(ad + 2.0 * self.omega * (vd - v) + self.omega**2 * (qd - q))


class SlotineLi:
    """Passivity-based adaptive control; what is not known of the last link is learned.

    The unknown is what is held in the last link's hand: its mass, first moment and inertia, 10 numbers in the axes of
    that link. Estimates stay those of a body: mass is at least 0, and the 4 x 4 pseudo-inertia has no negative
    eigenvalue (Wensing, Kim and Slotine 2018); where a step would leave them it is projected.

    Attributes:
        theta: the estimate [10] in Pinocchio's order: mass, first moment, inertia about the link's origin.
        rate: Gamma, of each parameter [10]. damping: K [n]. stiffness: lambda [1/s].
    """

    def __init__(
        self, model: pin.Model, motion: Motion, dt: float, *, stiffness: float, damping: Array, rate: Array
    ) -> None:
        self.model, self.data, self.motion = model, model.createData(), motion
        self.dt = validation.scalar("dt", dt, low=0.0, open_low=True, unit="s")
        self.stiffness = validation.scalar("stiffness", stiffness, low=0.0, open_low=True, unit="1/s")
        self.damping = validation.ordinary_array("damping", damping, (model.nv,))
        self.rate = validation.ordinary_array("rate", rate, (10,))
        if self.damping.min() <= 0.0 or self.rate.min() < 0.0:
            raise RangeError("damping", damping, "expected positive damping and no negative rate")
        self.known = np.concatenate([np.array(body.toDynamicParameters()) for body in model.inertias[1:]])
        self.theta = np.zeros(10)

    def regressor(self, q: Array, v: Array, w: Array, a: Array) -> Array:
        """Y [n, 10 n] of M a + C(q, v) w + g = Y theta, with all links' parameters."""

        def torque(v: Array, a: Array) -> Array:
            return np.array(pin.computeJointTorqueRegressor(self.model, self.data, q, v, a))

        none = np.zeros_like(v)
        rest = torque(none, none)
        return torque(none, a) + 0.5 * (torque(v + w, none) - torque(v, none) - torque(w, none) + rest)

    def command(self, time: float, q: Array, v: Array) -> Array:
        """Torques [n]; the estimate moves on by one step."""
        q, v = measured(q, v, self.model.nv)
        qd, vd, ad = self.motion(time)
        wanted = vd + self.stiffness * (qd - q)
        s = wanted - v
        Y = self.regressor(q, v, wanted, ad + self.stiffness * (vd - v))
        torque = Y @ self.known + Y[:, -10:] @ self.theta + self.damping * s
        self.theta = physical(self.theta + self.dt * self.rate * (Y[:, -10:].T @ s))
        return np.asarray(torque)


def physical(theta: Array) -> Array:
    """The parameters of a body that are nearest in pseudo-inertia to [10] numbers: no negative eigenvalue."""
    mass, first = theta[0], theta[1:4]
    xx, xy, yy, xz, yz, zz = theta[4:]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    P = np.zeros((4, 4))
    P[:3, :3] = np.trace(inertia) / 2.0 * np.eye(3) - inertia
    P[:3, 3] = P[3, :3] = first
    P[3, 3] = mass
    values, vectors = np.linalg.eigh(P)
    if values[0] >= 0.0:
        return theta
    P = (vectors * np.maximum(values, 0.0)) @ vectors.T
    inertia = np.trace(P[:3, :3]) * np.eye(3) - P[:3, :3]
    moments = (inertia[0, 0], inertia[0, 1], inertia[1, 1], inertia[0, 2], inertia[1, 2], inertia[2, 2])
    return np.array([P[3, 3], *P[:3, 3], *moments])
