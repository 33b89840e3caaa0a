"""A ``pin.JointModel`` as a row of plain turns and shifts, for kinematics in C."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np

from wbc.errors import UnsupportedJointError
from wbc.multibody import own
from wbc.symbolic.joint_maps import AXES, Vector
from wbc.symbolic.joints import SUPPORTED, follower_of, motion_at


class JointKind(IntEnum):
    """What a step does; the same numbers stand in ``wbc/proximity/native/steps.h``."""

    #: a turn about an axis by scale q + offset
    TURN = 0
    #: a shift along an axis by scale q + offset
    SHIFT = 1
    #: a turn about an axis, of which q has (cos, sin)
    CIRCLE = 2
    #: a turn about an axis by scale a + offset, where q has (cos a, sin a)
    FOLLOW = 3
    #: a rotation that q has as a quaternion (x, y, z, w)
    QUATERNION = 4
    #: a constant pose
    PLACE = 5


@dataclass(frozen=True, eq=False)
class JointStep:
    """One step.

    Attributes:
        q: where it reads the configuration.
        numbers: axis, scale and offset; of a pose the rotation row by row, then the position [12].
    """

    kind: JointKind
    q: int
    numbers: Vector


def place(pose: own.SE3) -> Vector:
    """Twelve numbers of a pose: rotation row by row, then position."""
    return np.concatenate([np.asarray(pose.rotation).ravel(), pose.translation])


def joint_steps(model: own.Model, joint: int) -> list[JointStep]:
    """What joint number ``joint`` does after its placement.

    Raises:
        UnsupportedJointError: a joint type without a symbolic model.
    """
    followers = {int(f): int(k) for f, k in zip(model.mimicking_joints, model.mimicked_joints, strict=True)}
    start, name = int(model.idx_qs[joint]), str(model.names[joint])
    if joint not in followers:
        return _steps(model.joints[joint], start, name)
    leader = int(model.joints[followers[joint]].nq)
    turns, axis, scaling, offset = follower_of(model.joints[joint], leader, name)
    # Pinocchio lets a joint without end be followed by such a joint only
    kind = JointKind.SHIFT if not turns else (JointKind.TURN if leader == 1 else JointKind.FOLLOW)
    return [_step(kind, start, axis, scaling, offset)]


def turns_for_quaternions(steps: list[JointStep], orders: Mapping[int, tuple[int, int, int]]) -> list[JointStep]:
    """The same steps, with three turns of numbers a, b, c in place of a quaternion at q:

    R = exp(a [e_i]) exp(b [e_j]) exp(c [e_k]),   (i, j, k) = orders[q],   at q, q + 1 and q + 2
    """
    axes, out = np.eye(3), list[JointStep]()
    for step in steps:
        if step.kind == JointKind.QUATERNION and step.q in orders:
            out += [_step(JointKind.TURN, step.q + k, axes[axis]) for k, axis in enumerate(orders[step.q])]
        else:
            out.append(step)
    return out


def _step(kind: JointKind, q: int, axis: Vector, scale: float = 1.0, offset: float = 0.0) -> JointStep:
    return JointStep(kind, q, np.concatenate([axis, [scale, offset], np.zeros(7)]))


def _steps(joint: Any, q: int, name: str) -> list[JointStep]:
    kind = joint.shortname().removeprefix("JointModel")
    inner = joint.extract()
    if kind == "Composite":
        out, at = [], q
        for k, (part, fixed) in enumerate(zip(inner.joints, inner.jointPlacements, strict=True)):
            out += [JointStep(JointKind.PLACE, q, place(fixed)), *_steps(part, at, f"{name}[{k}]")]
            at += int(part.nq)
        return out
    if kind[-1:] in AXES and kind[:-1] in ("R", "RUB", "P", "H"):
        return _along(kind[:-1], AXES[kind[-1]], inner, q)
    if kind in _UNALIGNED:
        axis = motion_at(inner, np.array([1.0, 0.0]))[0][3:] if _UNALIGNED[kind] == "RUB" else np.array(inner.axis)
        return _along(_UNALIGNED[kind], axis, inner, q)
    x, y, z = AXES["X"], AXES["Y"], AXES["Z"]
    shifts = [_step(JointKind.SHIFT, q + k, axis) for k, axis in enumerate((x, y, z))]
    whole = JointStep(JointKind.QUATERNION, q, np.zeros(12))
    known = {
        "Translation": shifts,
        "Spherical": [whole],
        "FreeFlyer": [*shifts, JointStep(JointKind.QUATERNION, q + 3, np.zeros(12))],
        "Planar": [*shifts[:2], _step(JointKind.CIRCLE, q + 2, z)],
        "SphericalZYX": [_step(JointKind.TURN, q + k, axis) for k, axis in enumerate((z, y, x))],
    }
    if kind in known:
        return known[kind]
    if kind == "Universal":
        return [_step(JointKind.TURN, q, np.array(inner.axis1)), _step(JointKind.TURN, q + 1, np.array(inner.axis2))]
    raise UnsupportedJointError(f"joint {name!r}", kind, "this joint type has no symbolic model", SUPPORTED)


#: Joints about or along an axis of their own, and what they are
_UNALIGNED = {
    "RevoluteUnaligned": "R",
    "RevoluteUnboundedUnaligned": "RUB",
    "PrismaticUnaligned": "P",
    "HelicalUnaligned": "H",
}


def _along(kind: str, axis: Vector, joint: Any, q: int) -> list[JointStep]:
    if kind == "RUB":
        return [_step(JointKind.CIRCLE, q, axis)]
    if kind == "P":
        return [_step(JointKind.SHIFT, q, axis)]
    turn = _step(JointKind.TURN, q, axis)
    return [turn] if kind == "R" else [turn, _step(JointKind.SHIFT, q, axis, float(joint.pitch))]
