"""Inverse dynamics with two velocities, linear in the inertias of the bodies.

    tau = M(q) a_r + C(q, v) v_r + g(q) = Y(q, v, v_r, a_r) phi,      dM/dt - 2 C skew

With C v_r in place of C v a controller can follow a reference velocity passively (Slotine and Li 1987). The recursion
is that of Niemeyer and Slotine (1991, Performance in adaptive manipulator control) with the factors of a body's
Coriolis wrench of Echeandia and Wensing (2021, Numerical methods to compute the Coriolis matrix and Christoffel
symbols), and rates of components in place of accelerations, so that joints of any subspace S(q) and moving bases are
no special case. phi has ten numbers a body in the order of ``pin.Inertia.toDynamicParameters``: mass, first moment,
inertia about the joint's origin (xx, xy, yy, xz, yz, zz).
"""

from __future__ import annotations

from functools import cached_property

import casadi as ca
import numpy as np

from wbc.symbolic import kernels, rotations as rot
from wbc.symbolic.dynamics import sum_to_root
from wbc.symbolic.kinematics import Kinematics
from wbc.symbolic.velocity import Velocities

#: Numbers of a body in phi
PER_BODY = 10
_ZERO = ca.SX(3, 1)


class TwoVelocityDynamics:
    """tau and Y of one :class:`Kinematics`, in its q and v and in symbols of its own.

    Attributes:
        reference: v_r, nv numbers. acceleration: a_r, nv numbers. parameters: phi, 10 numbers for each joint from
            the first on.
    """

    def __init__(self, kinematics: Kinematics) -> None:
        self.kinematics = kinematics
        self.reference = ca.SX.sym("v_r", kinematics.nv)
        self.acceleration = ca.SX.sym("a_r", kinematics.nv)
        self.parameters = ca.SX.sym("phi", PER_BODY * (kinematics.njoints - 1))
        self._true = Velocities(kinematics)
        self._moved = Velocities(kinematics, self.reference)

    @cached_property
    def torques(self) -> ca.SX:
        """tau, nv numbers [N m or N]; ``model.armature`` adds its part, which phi has no share in."""
        kin = self.kinematics
        wrenches = sum_to_root(kin, [(_ZERO, _ZERO), *(self._wrench(j) for j in range(1, kin.njoints))])
        blocks = []
        for j in range(1, kin.njoints):
            linear, angular = kin.joint_subspace(j)
            blocks.append((j, kernels.joint_effort(linear.shape[1], 1)(linear, angular, *wrenches[j]).T))
        armature = ca.SX(ca.DM(np.array(kin.model.armature, dtype=float)))
        return ca.densify(kin.columns(1, blocks).T + armature * self.acceleration)

    @cached_property
    def regressor(self) -> ca.SX:
        """Y, nv x 10 bodies, the derivative of tau along phi; zero where a body hangs on other joints."""
        return ca.jacobian(self.torques, self.parameters)

    def gradient(self, direction: ca.SX) -> ca.SX:
        """Y's transpose times nv numbers, by one backward sweep: 10 numbers a body."""
        return ca.gradient(ca.dot(direction, self.torques), self.parameters)

    def _wrench(self, joint: int) -> tuple[ca.SX, ca.SX]:
        """(force, moment) that a body needs, in its axes, at its origin."""
        own = self.parameters[PER_BODY * (joint - 1) : PER_BODY * joint]
        force, moment = kernels.two_velocity_wrench()(
            own, *self._rates[joint], *self._true.body(joint), *self._moved.body(joint)
        )
        return force, moment

    @cached_property
    def _rates(self) -> list[tuple[ca.SX, ca.SX]]:
        """(angular, linear) rates of the components of every body's reference twist; gravity lifts the root."""
        kin = self.kinematics
        out = [(_ZERO, ca.SX(-rot.constant(np.array(kin.model.gravity.linear))))]
        for j in range(1, kin.njoints):
            pose, columns = kin.local_pose(j), kin.joint_columns(j)
            turn, slide = self._moved.joint_velocity(j)
            whole = self._moved.body(j)
            rate = self._subspace_rate(j, self._true.rates[columns], self.reference[columns])
            step = kernels.joint_velocity(columns.stop - columns.start)
            spin, shift = step(*kin.joint_subspace(j), self.acceleration[columns])
            out.append(
                kernels.reference_step()(
                    pose.rotation,
                    pose.position,
                    *out[kin.parents[j]],
                    whole[0] - turn,
                    whole[1] - slide,
                    *self._true.joint_velocity(j),
                    spin + rate[3:],
                    shift + rate[:3],
                )
            )
        return out

    def _subspace_rate(self, joint: int, v: ca.SX, reference: ca.SX) -> ca.SX:
        """dS/dt v_r, 6 numbers (linear; angular)."""
        maps, q = self.kinematics.symbolic(joint), self.kinematics.joint_q(joint)
        if maps.subspace(q).is_constant():
            return ca.SX(6, 1)
        at = ca.SX.sym("q", maps.nq)
        rate = ca.jtimes(maps.subspace(at) @ reference, at, maps.tangent(at) @ v)
        return ca.sparsify(ca.substitute(rate, at, q))
