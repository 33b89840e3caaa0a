"""How fixed forces and torques on a robot's bodies turn into joint torques that change with the configuration.

For a force f at a point p of a body and a torque m on it, with joint torques J_lin' f + J_ang' m,

    K = symmetric part of d (J_lin' f + J_ang' m) / dq

so that v' K v is the power that f and m have on the accelerations J_dot v. With joint i on the way to joint k:

    K_ik = w_i . (J_k x f + w_k x m / 2)        w: axes of rotation, J_k: velocity of p by joint k

It is the part of the second derivative of an error that one step along a Jacobian does not see.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

import casadi as ca

from wbc.quick_dataclasses import dataclass
from wbc.symbolic.kinematics import Kinematics


@dataclass(frozen=True, eq=False)
class AppliedForce:
    """A force at the origin of ``frame``, a torque on it, or a force on every body in proportion to its mass.

    ``vector``: world axes, 3 entries; for ``mass`` the force on the whole robot. What is no force but knows its
    curvature, or an estimate of it, gives that as ``own``: nv x nv, symmetric.
    """

    kind: Literal["force", "torque", "mass", "own"]
    frame: str
    vector: ca.SX


@dataclass(eq=False)
class _JointLoad:
    """What acts on a joint and on all that it carries: force, sum of f p', torque."""

    force: ca.SX
    moment: ca.SX
    torque: ca.SX


def curvature(kinematics: Kinematics, forces: Iterable[AppliedForce]) -> ca.SX:
    """K of the module, nv x nv, symmetric, for all forces together."""
    known = list(forces)
    loads = _loads(kinematics, [force for force in known if force.kind != "own"])
    turned = {j: _turned(kinematics, j, load) for j, load in loads.items()}
    K = ca.SX(kinematics.nv, kinematics.nv)
    for force in known:
        if force.kind == "own":
            K += force.vector
    for k in turned:
        support, columns = kinematics.support(k), kinematics.joint_columns(k)
        own = ca.sparsify(kinematics.joint_twist(k)[1].T @ turned[k])
        K[columns, columns] += 0.5 * (own + own.T)
        for before in _distinct(kinematics, support[:-1]):
            rows = [row for i in before for row in _rows(kinematics, i)]
            block = ca.sparsify(ca.horzcat(*(kinematics.joint_twist(i)[1] for i in before)).T @ turned[k])
            K[rows, columns] += block
            K[columns, rows] += block.T
    return ca.sparsify(K)


def _rows(kinematics: Kinematics, joint: int) -> range:
    return range(*kinematics.joint_columns(joint).indices(kinematics.nv))


def _distinct(kinematics: Kinematics, joints: list[int]) -> list[list[int]]:
    """The joints together; one by one where a mimic joint has the velocities of another."""
    rows = [row for j in joints for row in _rows(kinematics, j)]
    return [joints][: len(joints)] if len(rows) == len(set(rows)) else [[j] for j in joints]


def _loads(kinematics: Kinematics, forces: Iterable[AppliedForce]) -> dict[int, _JointLoad]:
    """Per joint that carries a force, all that it carries."""
    loads: dict[int, _JointLoad] = {}

    def at(joint: int) -> _JointLoad:
        return loads.setdefault(joint, _JointLoad(ca.SX(3, 1), ca.SX(3, 3), ca.SX(3, 1)))

    for force in forces:
        if force.kind == "mass":
            for j, share, moment in kinematics.body_shares():
                load = at(j)
                load.force += share * force.vector
                load.moment += force.vector @ moment.T
            continue
        joint = kinematics.frame(force.frame)[0]
        if joint == 0:
            continue
        load = at(joint)
        if force.kind == "torque":
            load.torque += force.vector
        else:
            load.force += force.vector
            load.moment += force.vector @ kinematics.pose(force.frame).position.T
    for j in range(kinematics.njoints - 1, 0, -1):
        parent = kinematics.parents[j]
        if j in loads and parent > 0:
            below, load = loads[j], at(parent)
            load.force += below.force
            load.moment += below.moment
            load.torque += below.torque
    return loads


def _turned(kinematics: Kinematics, joint: int, load: _JointLoad) -> ca.SX:
    """J_k x f + w_k x m / 2 of a joint's columns, 3 x nv_j, summed over the load."""
    linear, angular = kinematics.joint_twist(joint)
    origin = kinematics.joint_pose(joint).position
    # sum of f (p - origin)'
    moment = load.moment - load.force @ origin.T
    columns = []
    for c in range(linear.shape[1]):
        v, w = linear[:, c], angular[:, c]
        turned = moment.T @ w - ca.trace(moment) * w
        columns.append(ca.cross(v, load.force) + turned + 0.5 * ca.cross(w, load.torque))
    return ca.horzcat(*columns)
