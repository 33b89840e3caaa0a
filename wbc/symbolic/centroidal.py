"""Centroidal momentum and the motion of the centre of mass (Orin, Goswami, Lee 2013).

    h = A_g(q) v     momentum (linear [kg m/s]; angular about the centre of mass [kg m^2/s]), world axes
    dh/dt = A_g dv/dt + dA_g/dt v

Bodies welded to the world do not count, as in Pinocchio. For a model without mass everything is zero.
"""

from __future__ import annotations

from functools import cached_property

import casadi as ca

from wbc.symbolic import kernels
from wbc.symbolic.dynamics import Dynamics, sum_to_root


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
