"""One function per joint family: placement, motion subspace and manifold maps as CasADi expressions.

For a joint with coordinates ``q`` (nq numbers) and velocity ``v`` (nv numbers), as in Pinocchio:

    placement  M(q)  pose of the child side in the parent side, a rotation R and a position p
    subspace   S(q)  6 x nv, twist (linear; angular) of the child side in child axes = S v
    tangent    T(q)  nq x nv, dq/dt = T(q) v
    integrate        q (+) v, the configuration after unit time at constant v
    difference       v with q0 (+) v = q1
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from wbc.errors import UnsupportedJointError
from wbc.symbolic import rotations as rot

_AXES = {"X": np.array([1.0, 0.0, 0.0]), "Y": np.array([0.0, 1.0, 0.0]), "Z": np.array([0.0, 0.0, 1.0])}


@dataclass(frozen=True)
class SymbolicJoint:
    """The five maps of one joint; ``nq`` coordinates, ``nv`` velocities."""

    nq: int
    nv: int
    placement: Callable[[ca.SX], tuple[ca.SX, ca.SX]]
    subspace: Callable[[ca.SX], ca.SX]
    tangent: Callable[[ca.SX], ca.SX]
    integrate: Callable[[ca.SX, ca.SX], ca.SX]
    difference: Callable[[ca.SX, ca.SX], ca.SX]


def symbolic_joint(joint: Any, name: str = "joint") -> SymbolicJoint:
    """The maps of a ``pin.JointModel``.

    Raises:
        UnsupportedJointError: a joint type that is not covered here.
    """
    kind = joint.shortname().removeprefix("JointModel")
    if kind in {"RX", "RY", "RZ"}:
        return _revolute(_AXES[kind[-1]])
    if kind in {"RUBX", "RUBY", "RUBZ"}:
        return _unbounded(_AXES[kind[-1]])
    if kind == "RevoluteUnaligned":
        return _revolute(np.array(joint.extract().axis))
    if kind == "RevoluteUnboundedUnaligned":
        return _unbounded(np.array(joint.extract().axis))
    if kind in {"PX", "PY", "PZ"}:
        return _prismatic(_AXES[kind[-1]])
    if kind == "PrismaticUnaligned":
        return _prismatic(np.array(joint.extract().axis))
    maker = {
        "FreeFlyer": _free_flyer,
        "Planar": _planar,
        "Spherical": _spherical,
        "SphericalZYX": _spherical_zyx,
        "Translation": _translation,
    }.get(kind)
    if maker is not None:
        return maker()
    if kind == "Composite":
        return _composite(joint.extract(), name)
    covered = "RX RY RZ RUBX RUBY RUBZ RevoluteUnaligned RevoluteUnboundedUnaligned PX PY PZ PrismaticUnaligned"
    raise UnsupportedJointError(
        f"joint {name!r}", kind, "this joint type has no symbolic model", [*covered.split(), "FreeFlyer", "Planar",
        "Spherical", "SphericalZYX", "Translation", "Composite"])


def _eye(n: int) -> ca.SX:
    return ca.SX(ca.DM.eye(n))


def _column(linear: Any = None, angular: Any = None) -> ca.SX:
    zero = np.zeros(3)
    return rot.constant(np.concatenate([zero if linear is None else linear, zero if angular is None else angular]))


def _vector_joint(
    n: int, placement: Callable[[ca.SX], tuple[ca.SX, ca.SX]], subspace: Callable[[ca.SX], ca.SX]
) -> SymbolicJoint:
    """A joint whose configuration space is R^n."""
    return SymbolicJoint(
        n, n, placement, subspace, lambda q: _eye(n), lambda q, v: q + v, lambda q0, q1: q1 - q0)


def _revolute(axis: np.ndarray) -> SymbolicJoint:
    column = _column(angular=axis)
    return _vector_joint(
        1, lambda q: (rot.from_axis_angle(axis, ca.cos(q), ca.sin(q)), ca.SX(3, 1)), lambda q: column)


def _prismatic(axis: np.ndarray) -> SymbolicJoint:
    column = _column(linear=axis)
    return _vector_joint(1, lambda q: (_eye(3), rot.constant(axis) * q), lambda q: column)


def _translation() -> SymbolicJoint:
    subspace = ca.vertcat(_eye(3), ca.SX(3, 3))
    return _vector_joint(3, lambda q: (_eye(3), q), lambda q: subspace)


def _unbounded(axis: np.ndarray) -> SymbolicJoint:
    column = _column(angular=axis)
    return SymbolicJoint(
        2, 1,
        lambda q: (rot.from_axis_angle(axis, q[0], q[1]), ca.SX(3, 1)),
        lambda q: column,
        lambda q: ca.vertcat(-q[1], q[0]),
        lambda q, v: _turn(q, v),
        lambda q0, q1: ca.atan2(q0[0] * q1[1] - q0[1] * q1[0], q0[0] * q1[0] + q0[1] * q1[1]),
    )


def _turn(unit: ca.SX, angle: ca.SX) -> ca.SX:
    c, s = ca.cos(angle), ca.sin(angle)
    return ca.vertcat(unit[0] * c - unit[1] * s, unit[1] * c + unit[0] * s)


def _quaternion_tangent(quat: ca.SX) -> ca.SX:
    """4x3 map from body angular velocity to d(x, y, z, w)/dt: half the product q * (omega, 0)."""
    x, y, z, w = (quat[i] for i in range(4))
    return 0.5 * ca.vertcat(
        ca.horzcat(w, -z, y), ca.horzcat(z, w, -x), ca.horzcat(-y, x, w), ca.horzcat(-x, -y, -z))


def _spherical() -> SymbolicJoint:
    subspace = ca.vertcat(ca.SX(3, 3), _eye(3))
    return SymbolicJoint(
        4, 3,
        lambda q: (rot.from_quaternion(q), ca.SX(3, 1)),
        lambda q: subspace,
        _quaternion_tangent,
        lambda q, v: rot.quaternion_product(q, rot.exp3(v)),
        lambda q0, q1: rot.log3(rot.from_quaternion(q0).T @ rot.from_quaternion(q1)),
    )


def _free_flyer() -> SymbolicJoint:
    def tangent(q: ca.SX) -> ca.SX:
        return ca.diagcat(rot.from_quaternion(q[3:]), _quaternion_tangent(q[3:]))

    def integrate(q: ca.SX, v: ca.SX) -> ca.SX:
        shift = rot.from_quaternion(q[3:]) @ (_left_jacobian(v[3:]) @ v[:3])
        return ca.vertcat(q[:3] + shift, rot.quaternion_product(q[3:], rot.exp3(v[3:])))

    def difference(q0: ca.SX, q1: ca.SX) -> ca.SX:
        r0 = rot.from_quaternion(q0[3:])
        turn = rot.log3(r0.T @ rot.from_quaternion(q1[3:]))
        return ca.vertcat(_left_jacobian_inverse(turn) @ (r0.T @ (q1[:3] - q0[:3])), turn)

    return SymbolicJoint(
        7, 6, lambda q: (rot.from_quaternion(q[3:]), q[:3]), lambda q: _eye(6), tangent, integrate, difference)


def _planar() -> SymbolicJoint:
    """q = (x, y, cos, sin), v = (vx, vy, w) in child axes."""
    subspace = ca.SX(6, 3)
    subspace[0, 0] = subspace[1, 1] = subspace[5, 2] = 1

    def placement(q: ca.SX) -> tuple[ca.SX, ca.SX]:
        return rot.from_axis_angle(_AXES["Z"], q[2], q[3]), ca.vertcat(q[0], q[1], 0)

    def tangent(q: ca.SX) -> ca.SX:
        out = ca.SX(4, 3)
        out[0, 0], out[0, 1], out[1, 0], out[1, 1] = q[2], -q[3], q[3], q[2]
        out[2, 2], out[3, 2] = -q[3], q[2]
        return out

    def integrate(q: ca.SX, v: ca.SX) -> ca.SX:
        shift = _left_jacobian(ca.vertcat(0, 0, v[2])) @ ca.vertcat(v[0], v[1], 0)
        world = placement(q)[0] @ shift
        return ca.vertcat(q[:2] + world[:2], _turn(q[2:], v[2]))

    def difference(q0: ca.SX, q1: ca.SX) -> ca.SX:
        angle = ca.atan2(q0[2] * q1[3] - q0[3] * q1[2], q0[2] * q1[2] + q0[3] * q1[3])
        local = placement(q0)[0].T @ ca.vertcat(q1[0] - q0[0], q1[1] - q0[1], 0)
        flat = _left_jacobian_inverse(ca.vertcat(0, 0, angle)) @ local
        return ca.vertcat(flat[0], flat[1], angle)

    return SymbolicJoint(4, 3, placement, lambda q: subspace, tangent, integrate, difference)


def _spherical_zyx() -> SymbolicJoint:
    def placement(q: ca.SX) -> tuple[ca.SX, ca.SX]:
        turns = [rot.from_axis_angle(_AXES[a], ca.cos(q[i]), ca.sin(q[i])) for i, a in enumerate("ZYX")]
        return turns[0] @ turns[1] @ turns[2], ca.SX(3, 1)

    def subspace(q: ca.SX) -> ca.SX:
        c1, s1, c2, s2 = ca.cos(q[1]), ca.sin(q[1]), ca.cos(q[2]), ca.sin(q[2])
        angular = ca.vertcat(ca.horzcat(-s1, 0, 1), ca.horzcat(c1 * s2, c2, 0), ca.horzcat(c1 * c2, -s2, 0))
        return ca.vertcat(ca.SX(3, 3), angular)

    return _vector_joint(3, placement, subspace)


def _composite(joint: Any, name: str) -> SymbolicJoint:
    """Joints in series with fixed placements between them."""
    parts = [symbolic_joint(part, f"{name}[{i}]") for i, part in enumerate(joint.joints)]
    fixed = [(rot.constant(m.rotation), rot.constant(m.translation)) for m in joint.jointPlacements]
    iq = np.cumsum([0] + [p.nq for p in parts])
    iv = np.cumsum([0] + [p.nv for p in parts])

    def qs(q: ca.SX) -> list[ca.SX]:
        return [q[int(iq[i]) : int(iq[i + 1])] for i in range(len(parts))]

    def vs(v: ca.SX) -> list[ca.SX]:
        return [v[int(iv[i]) : int(iv[i + 1])] for i in range(len(parts))]

    def chain(q: ca.SX) -> list[tuple[ca.SX, ca.SX]]:
        out = []
        rotation, position = _eye(3), ca.SX(3, 1)
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
        int(iq[-1]), int(iv[-1]),
        lambda q: chain(q)[-1],
        subspace,
        lambda q: ca.diagcat(*[part.tangent(qi) for part, qi in zip(parts, qs(q), strict=True)]),
        lambda q, v: ca.vertcat(*[p.integrate(a, b) for p, a, b in zip(parts, qs(q), vs(v), strict=True)]),
        lambda a, b: ca.vertcat(*[p.difference(x, y) for p, x, y in zip(parts, qs(a), qs(b), strict=True)]),
    )


def _left_jacobian(w: ca.SX) -> ca.SX:
    """V(w) of the SE(3) exponential: 1 + (1 - cos t)/t^2 [w]x + (t - sin t)/t^3 [w]x^2, series below t^2 = 1e-4."""
    square = ca.dot(w, w)
    small = square < 1e-4
    t = ca.sqrt(ca.if_else(small, 1.0, square))
    a = ca.if_else(small, 0.5 - square / 24 + square**2 / 720, (1 - ca.cos(t)) / t**2)
    b = ca.if_else(small, 1 / 6 - square / 120 + square**2 / 5040, (t - ca.sin(t)) / t**3)
    hat = rot.skew(w)
    return _eye(3) + a * hat + b * (hat @ hat)


def _left_jacobian_inverse(w: ca.SX) -> ca.SX:
    """Inverse of :func:`_left_jacobian`, finite up to |w| = pi."""
    square = ca.dot(w, w)
    small = square < 1e-4
    t = ca.sqrt(ca.if_else(small, 1.0, square))
    half = t / 2
    exact = (1 - half * ca.cos(half) / ca.sin(half)) / t**2
    c = ca.if_else(small, 1 / 12 + square / 720 + square**2 / 30240, exact)
    hat = rot.skew(w)
    return _eye(3) - 0.5 * hat + c * (hat @ hat)
