"""From a ``pin.JointModel`` to its symbolic maps (:mod:`wbc.symbolic.joint_maps`)."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import Any

import casadi as ca
import numpy as np

from wbc.errors import UnsupportedJointError
from wbc.symbolic import joint_maps as maps, rotations as rot
from wbc.symbolic.joint_maps import AXES, SymbolicJoint

__all__ = ["SUPPORTED", "SymbolicJoint", "follower_of", "mimic_joint", "motion_at", "symbolic_joint"]

_MAKERS: dict[str, Callable[[Any], SymbolicJoint]] = {
    "RevoluteUnaligned": lambda j: maps.revolute(np.array(j.axis)),
    # Python sees no axis on this type, so it is read from the motion that Pinocchio computes
    "RevoluteUnboundedUnaligned": lambda j: maps.unbounded(motion_at(j, np.array([1.0, 0.0]))[0][3:]),
    "PrismaticUnaligned": lambda j: maps.prismatic(np.array(j.axis)),
    "HelicalUnaligned": lambda j: maps.helical(np.array(j.axis), float(j.pitch)),
    "Universal": lambda j: maps.universal(np.array(j.axis1), np.array(j.axis2)),
    "FreeFlyer": lambda j: maps.free_flyer(),
    "Planar": lambda j: maps.planar(),
    "Spherical": lambda j: maps.spherical(),
    "SphericalZYX": lambda j: maps.spherical_zyx(),
    "Translation": lambda j: maps.translation(),
}


def _along(name: str, axis: maps.Vector) -> dict[str, Callable[[Any], SymbolicJoint]]:
    # A robot has many of these, which are all the same
    turn, endless, slide = (cache(partial(kind, axis)) for kind in (maps.revolute, maps.unbounded, maps.prismatic))
    return {
        f"R{name}": lambda _: turn(),
        f"RUB{name}": lambda _: endless(),
        f"P{name}": lambda _: slide(),
        f"H{name}": lambda joint: maps.helical(axis, float(joint.pitch)),
    }


for _name, _axis in AXES.items():
    _MAKERS |= _along(_name, _axis)

#: Pinocchio joint types that have a symbolic model, without the prefix ``JointModel``.
SUPPORTED = (*_MAKERS, "Composite", "Mimic")


def symbolic_joint(joint: Any, name: str = "joint") -> SymbolicJoint:
    """The maps of a ``pin.JointModel`` that owns its coordinates (see :func:`mimic_joint` for one that does not).

    Raises:
        UnsupportedJointError: a joint type without a symbolic model.
    """
    kind = joint.shortname().removeprefix("JointModel")
    maker = _MAKERS.get(kind)
    if maker is not None:
        return maker(joint.extract())
    if kind == "Composite":
        return _composite(joint.extract(), name)
    raise UnsupportedJointError(f"joint {name!r}", kind, "this joint type has no symbolic model", SUPPORTED)


def _composite(joint: Any, name: str) -> SymbolicJoint:
    parts = [symbolic_joint(part, f"{name}[{i}]") for i, part in enumerate(joint.joints)]
    fixed = [(rot.constant(m.rotation), rot.constant(m.translation)) for m in joint.jointPlacements]
    return maps.composite(parts, fixed)


def mimic_joint(joint: Any, leader: SymbolicJoint, name: str = "joint") -> SymbolicJoint:
    """A ``pin.JointModelMimic``: a one-dof joint at scaling * q + offset, read from its leader's coordinate.

    ``placement`` and ``subspace`` take the leader's q; ``nq`` and ``nv`` are the leader's, and the manifold maps are
    the leader's. For an unbounded leader q is its angle in (-pi, pi], so an uneven scaling jumps once a turn.

    Raises:
        UnsupportedJointError: as of :func:`follower_of`.
    """
    turns, axis, scaling, offset = follower_of(joint, leader.nq, name)
    follower = maps.revolute(axis) if turns else maps.prismatic(axis)

    def angle(q: ca.SX) -> ca.SX:
        coordinate = q if leader.nq == 1 else ca.atan2(q[1], q[0])
        return scaling * coordinate + offset

    def placement(q: ca.SX) -> tuple[ca.SX, ca.SX]:
        return follower.placement(angle(q))

    def subspace(q: ca.SX) -> ca.SX:
        return scaling * follower.subspace(q)

    return SymbolicJoint(leader.nq, leader.nv, placement, subspace, leader.tangent, leader.integrate, leader.difference)


def follower_of(joint: Any, leader_nq: int, name: str) -> tuple[bool, maps.Vector, float, float]:
    """(whether it turns, not shifts; axis; scaling; offset) of a ``pin.JointModelMimic``.

    The type of the follower is not visible from Python, so it is recovered from the motion that Pinocchio computes
    for it: a shift or a turn. A helical follower is refused; Pinocchio 4.1 drops its pitch from the motion.

    Raises:
        UnsupportedJointError: the scaling is 0 (then the follower's axis cannot be recovered), or it is helical.
    """
    inner = joint.extract()
    scaling, offset = float(inner.scaling), float(inner.offset)
    if scaling == 0.0:
        raise UnsupportedJointError(f"joint {name!r}", scaling, "a mimic joint of scaling 0 is a fixed joint")
    start = np.zeros(leader_nq)
    if leader_nq == 2:
        start[0] = 1.0
    twist, _ = motion_at(joint, start)
    turned = motion_at(joint, np.array([1.0]) if leader_nq == 1 else np.array([np.cos(1.0), np.sin(1.0)]))[1]
    if not twist[3:].any():
        return False, twist[:3] / scaling, scaling, offset
    if twist[:3].any() or np.abs(turned).max() > rot.SNAP:
        raise UnsupportedJointError(f"joint {name!r}", "helical follower", "a mimic joint follows by a turn or a shift")
    return True, twist[3:] / scaling, scaling, offset


def motion_at(joint: Any, coordinates: Any) -> tuple[Any, Any]:
    """(motion axis, 6 numbers; position) that Pinocchio computes for a one-dof joint at its coordinates."""
    data = joint.createData()
    q = np.concatenate([np.zeros(joint.idx_q), coordinates])
    joint.calc(data, q)
    return np.asarray(data.S, dtype=float).reshape(6), np.array(data.M.translation)
