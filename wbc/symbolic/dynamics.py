"""Rigid-body dynamics as expressions: inverse dynamics, gravity, mass matrix, kinetic energy, centroidal momentum.

    M(q) dv/dt + b(q, v) + g(q) = tau

Recursive algorithms in body axes (Featherstone 2008, chapters 5 and 6; Luh, Walker, Paul 1980). Inertias are
kept as mass m, first moment h = int r dm and second moment Sigma = int r r' dm about the body's origin: zeros and
symmetries of the description stay zeros in the expression. ``model.armature`` adds to the diagonal of M, as in
Pinocchio; friction and damping of the description are not part of these maps, nor of Pinocchio's.
"""

from __future__ import annotations

from functools import cached_property

import casadi as ca
import numpy as np

from wbc.symbolic import kernels, rotations as rot
from wbc.symbolic.kinematics import Kinematics
from wbc.symbolic.velocity import AccelerationField, Velocities

_ZERO = ca.SX(3, 1)


class Inertias:
    """Constant inertias of a model's bodies, per joint: (mass, first moment, second moment) in joint axes."""

    def __init__(self, kinematics: Kinematics) -> None:
        self.kinematics = kinematics
        inertias = [kinematics.model.inertias[j] for j in range(kinematics.njoints)]
        self.masses = [float(i.mass) for i in inertias]
        self.moments: list[tuple[ca.SX, ca.SX]] = []
        for inertia in inertias:
            lever = np.array(inertia.lever)
            about_center = np.array(inertia.inertia)
            second = 0.5 * np.trace(about_center) * np.eye(3) - about_center + inertia.mass * np.outer(lever, lever)
            self.moments.append((rot.constant(inertia.mass * lever), rot.constant(second)))

    @cached_property
    def composite(self) -> tuple[list[float], list[tuple[ca.SX, ca.SX]]]:
        """(mass, (first moment, second moment)) of every joint's subtree, in that joint's axes."""
        kin = self.kinematics
        masses, moments = list(self.masses), list(self.moments)
        for j in range(kin.njoints - 1, 0, -1):
            parent = kin.parents[j]
            if parent > 0:
                pose = kin.local_pose(j)
                moments[parent] = kernels.inertia_to_parent()(
                    pose.rotation, pose.position, masses[j], *moments[j], *moments[parent]
                )
                masses[parent] += masses[j]
        return masses, moments

    def column_forces(self, joint: int) -> tuple[ca.SX, ca.SX]:
        """(force, moment), 3 x nv_j each, body axes: momentum of the subtree for unit velocities of the joint."""
        masses, moments = self.composite
        linear, angular = self.kinematics.joint_subspace(joint)
        step = kernels.column_momentum(linear.shape[1])
        force, moment = step(masses[joint], *moments[joint], linear, angular)
        return force, moment


class Dynamics:
    """Dynamics of one :class:`Kinematics` in its q and v and a joint acceleration symbol ``a`` (nv).

    Each property is built on first use. ``motion`` may be shared with whoever asks for frame velocities.
    """

    def __init__(self, kinematics: Kinematics, motion: Velocities | None = None) -> None:
        self.kinematics = kinematics
        self.motion = motion if motion is not None else Velocities(kinematics)
        self.bodies = Inertias(kinematics)
        self.a = ca.SX.sym("a", kinematics.nv)
        self._up = ca.SX(-rot.constant(np.array(kinematics.model.gravity.linear)))
        self._armature = np.array(kinematics.model.armature, dtype=float)

    @cached_property
    def inverse_dynamics(self) -> ca.SX:
        """tau = M a + b + g, nv numbers [N m or N], as ``pin.rnea(model, data, q, v, a)``."""
        field = AccelerationField(self.motion, self.a, self._up)
        return self._torques(field) + ca.SX(ca.DM(self._armature)) * self.a

    @cached_property
    def nonlinear_effects(self) -> ca.SX:
        """b(q, v) + g(q), nv numbers, as ``pin.nonLinearEffects``."""
        return self._torques(AccelerationField(self.motion, None, self._up, self.motion.drift))

    @cached_property
    def gravity(self) -> ca.SX:
        """g(q), nv numbers, as ``pin.computeGeneralizedGravity``: minus the transposed CoM Jacobian times m gravity."""
        kin = self.kinematics
        mass = kin.mass
        return mass * (kin.center_of_mass_jacobian.T @ self._up) if mass > 0.0 else ca.SX.zeros(kin.nv)

    def _torques(self, field: AccelerationField) -> ca.SX:
        """Joint torques that make the bodies accelerate as ``field`` says."""
        kin = self.kinematics
        wrenches = self.wrenches(field)
        blocks = []
        for j in range(1, kin.njoints):
            linear, angular = kin.joint_subspace(j)
            effort = kernels.joint_effort(linear.shape[1], 1)
            blocks.append((j, effort(linear, angular, *wrenches[j]).T))
        return ca.densify(kin.columns(1, blocks).T)

    def wrenches(self, field: AccelerationField) -> list[tuple[ca.SX, ca.SX]]:
        """Per joint (force, moment) that its subtree needs, body axes; entry 0 is their sum in the world."""
        kin = self.kinematics
        out = [(_ZERO, _ZERO)]
        for j in range(1, kin.njoints):
            if self.bodies.masses[j] == 0.0 and not any(m.nnz() for m in self.bodies.moments[j]):
                out.append((_ZERO, _ZERO))
                continue
            omega, linear = field.angular(j)[1], field.linear(j)
            out.append(kernels.body_wrench()(self.bodies.masses[j], *self.bodies.moments[j], omega, linear))
        return sum_to_root(kin, out)

    @cached_property
    def mass_matrix(self) -> ca.SX:
        """M(q), nv x nv, symmetric, zero where no subtree couples, as ``pin.crba``; armature included."""
        kin = self.kinematics
        # Every joint has columns of its own here; those of a mimic joint are added to its leader's at the end
        ends = np.cumsum([0] + [kin.symbolic(j).nv for j in range(1, kin.njoints)])
        waiting: list[list[tuple[list[int], ca.SX, ca.SX]]] = [[] for _ in range(kin.njoints)]
        rows, columns, values = [], [], []
        for j in range(kin.njoints - 1, 0, -1):
            linear, angular = kin.joint_subspace(j)
            dofs = list(range(ends[j - 1], ends[j]))
            parts = [(dofs, *self.bodies.column_forces(j)), *waiting[j]]
            every = [d for part in parts for d in part[0]]
            force, moment = ca.horzcat(*[part[1] for part in parts]), ca.horzcat(*[part[2] for part in parts])
            values.append(ca.vec(kernels.joint_effort(len(dofs), len(every))(linear, angular, force, moment)))
            rows += dofs * len(every)
            columns += [d for d in every for _ in dofs]
            if kin.parents[j] > 0:
                pose, step = kin.local_pose(j), kernels.columns_to_parent(len(every))
                waiting[kin.parents[j]].append((every, *step(pose.rotation, pose.position, force, moment)))
        size = int(ends[-1])
        matrix = ca.triu2symm(ca.triu(ca.SX.triplet(rows, columns, ca.vertcat(*values), size, size)))
        if kin.followers:
            gather = np.zeros((size, kin.nv))
            for j in range(1, kin.njoints):
                gather[ends[j - 1] : ends[j], kin.joint_columns(j)] = np.eye(kin.symbolic(j).nv)
            matrix = rot.constant(gather.T) @ matrix @ rot.constant(gather)
        return ca.sparsify(matrix + ca.SX(ca.diag(ca.sparsify(ca.DM(self._armature)))))

    @cached_property
    def kinetic_energy(self) -> ca.SX:
        """1/2 v' M v [J], body by body, armature included, as ``pin.computeKineticEnergy``."""
        kin = self.kinematics
        total = 0.5 * ca.dot(ca.SX(ca.DM(self._armature)), kin.v * kin.v)
        for j in range(1, kin.njoints):
            w, v = self.motion.body(j)
            linear, angular = kernels.body_momentum()(self.bodies.masses[j], *self.bodies.moments[j], w, v)
            total += 0.5 * (ca.dot(v, linear) + ca.dot(w, angular))
        return total

    @cached_property
    def inverse_dynamics_derivatives(self) -> tuple[ca.SX, ca.SX]:
        """(d tau/dq on the tangent space, d tau/dv), nv x nv each, as ``pin.computeRNEADerivatives``.

        d tau/da is :attr:`mass_matrix`.
        """
        tau = self.inverse_dynamics
        return self.kinematics.derivative(tau), ca.jacobian(tau, self.kinematics.v)


def sum_to_root(kinematics: Kinematics, own: list[tuple[ca.SX, ca.SX]]) -> list[tuple[ca.SX, ca.SX]]:
    """Each body's wrench (or momentum) plus those of its subtree, body axes; entry 0 in the world, at its origin."""
    total = list(own)
    for j in range(kinematics.njoints - 1, 0, -1):
        pose, parent = kinematics.local_pose(j), kinematics.parents[j]
        total[parent] = kernels.wrench_to_parent()(pose.rotation, pose.position, *total[j], *total[parent])
    return total


class Centroidal:
    """Centroidal quantities as expressions in q and v, each built on first use."""

    def __init__(self, dynamics: Dynamics) -> None:
        self.dynamics = dynamics
        self.kinematics = dynamics.kinematics

    @cached_property
    def momentum(self) -> ca.SX:
        """h, 6 numbers, summed over the bodies without the matrix, as ``data.hg``."""
        bodies, motion = self.dynamics.bodies, self.dynamics.motion
        own = [(ca.SX(3, 1), ca.SX(3, 1))]
        for j in range(1, self.kinematics.njoints):
            own.append(kernels.body_momentum()(bodies.masses[j], *bodies.moments[j], *motion.body(j)))
        return self._about_center(*sum_to_root(self.kinematics, own)[0])

    @cached_property
    def matrix(self) -> ca.SX:
        """A_g(q), 6 x nv, as ``data.Ag`` of ``pin.computeCentroidalMap``."""
        kin = self.kinematics
        blocks = []
        for j in range(1, kin.njoints):
            pose = kin.joint_pose(j)
            force, moment = self.dynamics.bodies.column_forces(j)
            step = kernels.columns_to_parent(force.shape[1])
            arm = pose.position - kin.center_of_mass
            linear, angular = step(pose.rotation, arm, force, moment)
            blocks.append((j, ca.vertcat(linear, angular)))
        return kin.columns(6, blocks)

    @cached_property
    def drift(self) -> ca.SX:
        """dA_g/dt v, 6 numbers: the rate of momentum at zero joint acceleration, as ``data.dhg``."""
        return self._about_center(*self.dynamics.wrenches(self.dynamics.motion.drift)[0])

    @cached_property
    def center_of_mass_velocity(self) -> ca.SX:
        """Velocity of the centre of mass in the world [m/s], as ``data.vcom[0]``."""
        return self._per_mass(self.momentum)

    @cached_property
    def center_of_mass_drift(self) -> ca.SX:
        """Acceleration of the centre of mass at zero joint acceleration [m/s^2], as ``data.acom[0]``: dJ_c/dt v."""
        return self._per_mass(self.drift)

    def _about_center(self, linear: ca.SX, angular: ca.SX) -> ca.SX:
        """From the world's origin to the centre of mass; its own velocity times momentum has no moment there."""
        return ca.densify(ca.vertcat(linear, angular - ca.cross(self.kinematics.center_of_mass, linear)))

    def _per_mass(self, total: ca.SX) -> ca.SX:
        mass = self.kinematics.mass
        return total[:3] / mass if mass > 0.0 else ca.SX.zeros(3)
