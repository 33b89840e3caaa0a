"""What motors with limits T have to brake a joint by, of all that it carries and takes along: (T - |g'h|) / (g'M g).

g is the motion of all joints that a motor's joint makes at unit velocity: of a joint that closes loops the velocities
nearest to it that keep them closed, in the metric of W, the limits T of the motors and a small part of these of joints
without one. With J the rows of its linkage and e the joint's unit velocity,

    g = e - W^-2 J' (J W^-2 J')^-1 J e

As many motors as motions: g is what moves where the other motors stand. At dead points nothing does.
"""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from wbc.robot import Robot
from wbc.robot.loops import Linkage
from wbc.symbolic.kinematics import Kinematics
from wbc.symbolic.tracer import Tracer
from wbc.tasks._linkage_speed import dependent_solver

#: Part of a motor's torque that braking counts on where forces of motion and weight take more of it
LEAST_SHARE = 0.1
#: W of joints without a motor, as a part of the least T
PASSIVE = 1e-4
#: W of motors without a limit, as so many times the largest T
STRONG = 1e3


def decelerations(
    robot: Robot, kinematics: Kinematics, mass: ca.SX, still: ca.SX, limits: Mapping[int, ca.SX]
) -> dict[int, ca.SX]:
    """By degree of freedom [rad/s^2 or m/s^2].

    Args:
        mass, still: M [nv, nv] and h [nv] as motors have to give them.
        limits: T by degree of freedom [N m or N].
    """
    out, linkages = dict[int, ca.SX](), {dof: part for part in robot.loops.linkages for dof in part.dofs}
    for dof, most in limits.items():
        motion = ca.SX(robot.nv, 1)
        motion[dof] = 1.0
        if dof in linkages:
            motion = taken_along(robot, kinematics, linkages[dof], motion)
        left = ca.fmax(most - ca.fabs(ca.dot(motion, still)), LEAST_SHARE * most)
        out[dof] = left / ca.bilin(mass, motion, motion)
    return out


def taken_along(robot: Robot, kinematics: Kinematics, linkage: Linkage, motion: ca.SX) -> ca.SX:
    """The velocities of a linkage nearest to some that keep its loops closed; g of the module."""
    dofs, tracer, efforts = list(linkage.dofs), Tracer(kinematics), robot.limits.effort
    limited = efforts[[dof for dof in dofs if dof in robot.motors and np.isfinite(efforts[dof])]]
    weights = np.full(len(dofs), PASSIVE * limited.min())
    for k, dof in enumerate(dofs):
        if dof in robot.motors:
            weights[k] = min(efforts[dof], STRONG * limited.max())
    jacobian = ca.densify(tracer.jacobian(robot.loops.error(tracer)))[list(linkage.rows), dofs]
    solve, out = dependent_solver(jacobian @ ca.diag(ca.DM(1.0 / weights))), ca.SX(motion)
    out[dofs] -= (jacobian.T @ solve(jacobian @ motion[dofs])) / ca.DM(weights) ** 2
    return out
