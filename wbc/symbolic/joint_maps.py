"""The maps of one joint family each: placement, motion subspace and manifold maps as CasADi expressions.

For a joint with coordinates ``q`` (nq numbers) and velocity ``v`` (nv numbers), as in Pinocchio:

    placement  M(q)    pose of the child side in the parent side, a rotation R and a position p
    subspace   S(q)    6 x nv, twist (linear; angular) of the child side in child axes = S v
    bias       c(q, v) dS/dt v, the part of the twist's rate (child axes) that is not S dv/dt
    tangent    T(q)    nq x nv, dq/dt = T(q) v
    integrate          q (+) v, the configuration after unit time at constant v
    difference         v with q0 (+) v = q1
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc.quick_dataclasses import dataclass
from wbc.symbolic import rotations as rot

Vector = NDArray[np.float64]

AXES: dict[str, Vector] = {
    "X": np.array([1.0, 0.0, 0.0]),
    "Y": np.array([0.0, 1.0, 0.0]),
    "Z": np.array([0.0, 0.0, 1.0]),
}


@dataclass(frozen=True)
class SymbolicJoint:
    """The maps of one joint; ``nq`` coordinates, ``nv`` velocities, which are ``added`` to these: T(q) = 1."""

    nq: int
    nv: int
    placement: Callable[[ca.SX], tuple[ca.SX, ca.SX]]
    subspace: Callable[[ca.SX], ca.SX]
    tangent: Callable[[ca.SX], ca.SX]
    integrate: Callable[[ca.SX, ca.SX], ca.SX]
    difference: Callable[[ca.SX, ca.SX], ca.SX]
    added: bool = False

    def bias(self, q: ca.SX, v: ca.SX) -> ca.SX:
        """dS/dt v = d(S(q) v)/dq T(q) v, 6 numbers; structurally zero where S is constant."""
        if self.subspace(q).is_constant():
            return ca.SX(6, 1)
        at = ca.SX.sym("q", self.nq)
        rate = ca.jtimes(self.subspace(at) @ v, at, self.tangent(at) @ v)
        return ca.sparsify(ca.substitute(rate, at, q))


def eye(n: int) -> ca.SX:
    """The sparse identity."""
    return ca.SX(ca.DM.eye(n))


def vector_joint(
    n: int, placement: Callable[[ca.SX], tuple[ca.SX, ca.SX]], subspace: Callable[[ca.SX], ca.SX]
) -> SymbolicJoint:
    """A joint whose configuration space is R^n."""
    return SymbolicJoint(n, n, placement, subspace, lambda q: eye(n), lambda q, v: q + v, lambda q0, q1: q1 - q0, True)


def _column(linear: Vector | None = None, angular: Vector | None = None) -> ca.SX:
    zero = np.zeros(3)
    return rot.constant(np.concatenate([zero if linear is None else linear, zero if angular is None else angular]))


def revolute(axis: Vector) -> SymbolicJoint:
    """A turn by q about a fixed unit axis."""
    column = _column(angular=axis)
    return vector_joint(1, lambda q: (rot.from_axis_angle(axis, ca.cos(q), ca.sin(q)), ca.SX(3, 1)), lambda q: column)


def prismatic(axis: Vector) -> SymbolicJoint:
    """A shift by q along a fixed unit axis."""
    column = _column(linear=axis)
    return vector_joint(1, lambda q: (eye(3), rot.constant(axis) * q), lambda q: column)


def helical(axis: Vector, pitch: float) -> SymbolicJoint:
    """A turn by q about a fixed unit axis with a shift of ``pitch`` q along it (pitch in m/rad)."""
    column = _column(linear=pitch * axis, angular=axis)
    return vector_joint(
        1,
        lambda q: (rot.from_axis_angle(axis, ca.cos(q), ca.sin(q)), rot.constant(pitch * axis) * q),
        lambda q: column,
    )


def universal(first: Vector, second: Vector) -> SymbolicJoint:
    """A turn by q[0] about the first axis, then by q[1] about the second, moved, axis."""

    def turn(axis: Vector, angle: ca.SX) -> ca.SX:
        return rot.from_axis_angle(axis, ca.cos(angle), ca.sin(angle))

    def subspace(q: ca.SX) -> ca.SX:
        angular = ca.horzcat(turn(second, q[1]).T @ rot.constant(first), rot.constant(second))
        return ca.vertcat(ca.SX(3, 2), angular)

    return vector_joint(2, lambda q: (turn(first, q[0]) @ turn(second, q[1]), ca.SX(3, 1)), subspace)


def translation() -> SymbolicJoint:
    """A shift by (x, y, z)."""
    subspace = ca.vertcat(eye(3), ca.SX(3, 3))
    return vector_joint(3, lambda q: (eye(3), q), lambda q: subspace)


def unbounded(axis: Vector) -> SymbolicJoint:
    """A turn about a fixed unit axis with coordinates (cos, sin)."""
    column = _column(angular=axis)
    return SymbolicJoint(
        2,
        1,
        lambda q: (rot.from_axis_angle(axis, q[0], q[1]), ca.SX(3, 1)),
        lambda q: column,
        lambda q: ca.vertcat(-q[1], q[0]),
        _turn,
        lambda q0, q1: ca.atan2(q0[0] * q1[1] - q0[1] * q1[0], q0[0] * q1[0] + q0[1] * q1[1]),
    )


def _turn(unit: ca.SX, angle: ca.SX) -> ca.SX:
    c, s = ca.cos(angle), ca.sin(angle)
    return ca.vertcat(unit[0] * c - unit[1] * s, unit[1] * c + unit[0] * s)


def _quaternion_tangent(quat: ca.SX) -> ca.SX:
    """4x3 map from body angular velocity to d(x, y, z, w)/dt: half the product q * (omega, 0)."""
    x, y, z, w = (quat[i] for i in range(4))
    return 0.5 * ca.vertcat(ca.horzcat(w, -z, y), ca.horzcat(z, w, -x), ca.horzcat(-y, x, w), ca.horzcat(-x, -y, -z))


def spherical() -> SymbolicJoint:
    """A free rotation, coordinates a unit quaternion (x, y, z, w), velocity in child axes."""
    subspace = ca.vertcat(ca.SX(3, 3), eye(3))
    return SymbolicJoint(
        4,
        3,
        lambda q: (rot.from_quaternion(q), ca.SX(3, 1)),
        lambda q: subspace,
        _quaternion_tangent,
        lambda q, v: rot.quaternion_product(q, rot.exp3(v)),
        _quaternion_difference,
    )


def _quaternion_difference(q0: ca.SX, q1: ca.SX) -> ca.SX:
    return rot.log_quaternion(rot.quaternion_product(rot.quaternion_conjugate(q0), q1))


def free_flyer() -> SymbolicJoint:
    """A free body: position and quaternion (x, y, z, w); velocity is its twist in its own axes."""

    def tangent(q: ca.SX) -> ca.SX:
        return ca.diagcat(rot.from_quaternion(q[3:]), _quaternion_tangent(q[3:]))

    def integrate(q: ca.SX, v: ca.SX) -> ca.SX:
        shift = rot.from_quaternion(q[3:]) @ (rot.left_jacobian(v[3:]) @ v[:3])
        return ca.vertcat(q[:3] + shift, rot.quaternion_product(q[3:], rot.exp3(v[3:])))

    def difference(q0: ca.SX, q1: ca.SX) -> ca.SX:
        turn = _quaternion_difference(q0[3:], q1[3:])
        local = rot.from_quaternion(q0[3:]).T @ (q1[:3] - q0[:3])
        return ca.vertcat(rot.left_jacobian_inverse(turn) @ local, turn)

    return SymbolicJoint(
        7, 6, lambda q: (rot.from_quaternion(q[3:]), q[:3]), lambda q: eye(6), tangent, integrate, difference
    )


def planar() -> SymbolicJoint:
    """q = (x, y, cos, sin), v = (vx, vy, w) in child axes."""
    subspace = ca.SX(6, 3)
    subspace[0, 0] = subspace[1, 1] = subspace[5, 2] = 1

    def placement(q: ca.SX) -> tuple[ca.SX, ca.SX]:
        position = ca.SX(3, 1)
        position[:2] = q[:2]
        return rot.from_axis_angle(AXES["Z"], q[2], q[3]), position

    def tangent(q: ca.SX) -> ca.SX:
        out = ca.SX(4, 3)
        out[0, 0], out[0, 1], out[1, 0], out[1, 1] = q[2], -q[3], q[3], q[2]
        out[2, 2], out[3, 2] = -q[3], q[2]
        return out

    def integrate(q: ca.SX, v: ca.SX) -> ca.SX:
        shift = rot.left_jacobian(ca.vertcat(0, 0, v[2])) @ ca.vertcat(v[0], v[1], 0)
        world = placement(q)[0] @ shift
        return ca.vertcat(q[:2] + world[:2], _turn(q[2:], v[2]))

    def difference(q0: ca.SX, q1: ca.SX) -> ca.SX:
        angle = ca.atan2(q0[2] * q1[3] - q0[3] * q1[2], q0[2] * q1[2] + q0[3] * q1[3])
        local = placement(q0)[0].T @ ca.vertcat(q1[0] - q0[0], q1[1] - q0[1], 0)
        flat = rot.left_jacobian_inverse(ca.vertcat(0, 0, angle)) @ local
        return ca.vertcat(flat[0], flat[1], angle)

    return SymbolicJoint(4, 3, placement, lambda q: subspace, tangent, integrate, difference)


def spherical_zyx() -> SymbolicJoint:
    """Turns by q[0] about z, q[1] about y, q[2] about x, each axis moved by the ones before."""

    def placement(q: ca.SX) -> tuple[ca.SX, ca.SX]:
        turns = [rot.from_axis_angle(AXES[a], ca.cos(q[i]), ca.sin(q[i])) for i, a in enumerate("ZYX")]
        return turns[0] @ turns[1] @ turns[2], ca.SX(3, 1)

    def subspace(q: ca.SX) -> ca.SX:
        c1, s1, c2, s2 = ca.cos(q[1]), ca.sin(q[1]), ca.cos(q[2]), ca.sin(q[2])
        angular = ca.vertcat(ca.horzcat(-s1, 0, 1), ca.horzcat(c1 * s2, c2, 0), ca.horzcat(c1 * c2, -s2, 0))
        return ca.vertcat(ca.SX(3, 3), angular)

    return vector_joint(3, placement, subspace)


def composite(parts: Sequence[SymbolicJoint], fixed: Sequence[tuple[ca.SX, ca.SX]]) -> SymbolicJoint:
    """Joints in series; ``fixed[i]`` is the constant placement (R, p) in front of joint i."""
    iq = [int(i) for i in np.cumsum([0] + [p.nq for p in parts])]
    iv = [int(i) for i in np.cumsum([0] + [p.nv for p in parts])]

    def qs(q: ca.SX) -> list[ca.SX]:
        return [q[iq[i] : iq[i + 1]] for i in range(len(parts))]

    def vs(v: ca.SX) -> list[ca.SX]:
        return [v[iv[i] : iv[i + 1]] for i in range(len(parts))]

    def chain(q: ca.SX) -> list[tuple[ca.SX, ca.SX]]:
        out = []
        rotation, position = eye(3), ca.SX(3, 1)
        for part, (r0, p0), qi in zip(parts, fixed, qs(q), strict=True):
            ri, pi = part.placement(qi)
            position = position + rotation @ (p0 + r0 @ pi)
            rotation = rotation @ r0 @ ri
            out.append((rotation, position))
        return out

    def subspace(q: ca.SX) -> ca.SX:
        poses = chain(q)
        end_r, end_p = poses[-1]
        columns = []
        for part, (r, p), qi in zip(parts, poses, qs(q), strict=True):
            local = part.subspace(qi)
            linear, angular = r @ local[:3, :], r @ local[3:, :]
            linear = linear - rot.skew(end_p - p) @ angular
            columns.append(ca.vertcat(end_r.T @ linear, end_r.T @ angular))
        return ca.horzcat(*columns)

    return SymbolicJoint(
        iq[-1],
        iv[-1],
        lambda q: chain(q)[-1],
        subspace,
        lambda q: ca.diagcat(*[part.tangent(qi) for part, qi in zip(parts, qs(q), strict=True)]),
        lambda q, v: ca.vertcat(*[p.integrate(a, b) for p, a, b in zip(parts, qs(q), vs(v), strict=True)]),
        lambda a, b: ca.vertcat(*[p.difference(x, y) for p, x, y in zip(parts, qs(a), qs(b), strict=True)]),
    )
