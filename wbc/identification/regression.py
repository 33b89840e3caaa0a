"""Torques as a linear function of what is to be identified, sample by sample and stacked.

    tau - armature a = Y(q, v, a) phi + diag(v) f_v + diag(sign v) f_c

phi has ten numbers a joint (:mod:`wbc.identification.pseudo_inertia`), f_v and f_c viscous and Coulomb friction, one
each for a degree of freedom of a joint.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca
import numpy as np

from wbc import validation
from wbc.errors import ShapeError, UnsupportedJointError
from wbc.robot import Robot
from wbc.stack.evaluation import ManyStates
from wbc.symbolic import Kinematics, TwoVelocityDynamics
from wbc.symbolic.two_velocities import PER_BODY
from wbc.validation import Array

#: Coulomb's friction grows from 0 to its size over speeds of this order [rad/s, m/s]
SLOW = 0.05


class Samples(NamedTuple):
    """States of a motion and the torques that were measured there.

    Attributes:
        q, v, a, torque: configurations ``[m, nq]``, velocities, accelerations and torques ``[m, nv]``.
    """

    q: Array
    v: Array
    a: Array
    torque: Array


class Regression:
    """The regressor of a robot.

    Args:
        robot: on a fixed or floating base; only masses and inertias of its model are not used. friction: whether it is
            identified as well.

    Attributes:
        names: of the columns, such as ``"elbow.m"``, ``"elbow.Ixx"``, ``"elbow.viscous"``.

    Raises:
        ShapeError: no robot. UnsupportedJointError: another base, or coupled joints.
    """

    def __init__(self, robot: Robot, friction: bool = False) -> None:
        self.robot = validation.instance("robot", robot, Robot, "a wbc Robot")
        if robot.base not in ("fixed", "floating") or robot.couplings:
            raise UnsupportedJointError("robot", robot.name, "expected a fixed or floating base and no coupled joints")
        robot.require_tree("identification")
        self.friction = validation.flag("friction", friction)
        kin = Kinematics(robot.model)
        dynamics = TwoVelocityDynamics(kin)
        given = [kin.q, kin.v, dynamics.acceleration]
        Y = ca.substitute(dynamics.regressor, dynamics.reference, kin.v)
        self._evaluate = ManyStates(ca.Function("regressor", given, [ca.densify(ca.vec(Y.T))]))
        parts = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
        names = [f"{joint}.{part}" for joint in robot.joint_names for part in parts]
        driven = robot.dof_names[robot.base_nv :]
        for kind in ("viscous", "Coulomb") if self.friction else ():
            names += [f"{dof}.{kind}" for dof in driven]
        self.names = tuple(names)

    @property
    def bodies(self) -> int:
        """Columns that belong to bodies, the first ones."""
        return PER_BODY * len(self.robot.joint_names)

    def matrix(self, q: Array, v: Array, a: Array) -> Array:
        """Y and the friction of m states, stacked: ``[m nv, columns]``.

        Raises:
            ShapeError, NotFiniteError: other shapes than of m states.
        """
        nv, base = self.robot.nv, self.robot.base_nv
        count = len(validation.ordinary_array("q", q))
        for name, value, width in (("q", q, self.robot.nq), ("v", v, nv), ("a", a, nv)):
            validation.ordinary_array(name, value, (count, width))
        if count == 0:
            raise ShapeError("q", q, "expected at least one state")
        Y = self._evaluate(q, v, a).reshape(count * nv, self.bodies)
        if not self.friction:
            return Y
        rubbing = []
        for rates in (v, np.tanh(v / SLOW)):
            block = np.zeros((count, nv, nv - base))
            block[:, np.arange(base, nv), np.arange(nv - base)] = rates[:, base:]
            rubbing.append(block.reshape(count * nv, nv - base))
        return np.hstack([Y, *rubbing])

    def stacked(self, samples: Samples) -> tuple[Array, Array]:
        """(matrix, what it is to give) of samples: torques less those of the motors' armatures.

        Raises:
            ShapeError, NotFiniteError: other shapes than of m states.
        """
        torque = validation.ordinary_array("torque", samples.torque, (len(samples.q), self.robot.nv))
        armature = np.array(self.robot.model.armature, dtype=float)
        return self.matrix(samples.q, samples.v, samples.a), np.asarray((torque - armature * samples.a).ravel())
