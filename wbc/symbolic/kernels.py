"""One joint's step of each recursion, as a small CasADi function.

Called with expressions, such a function is inlined: the caller gets plain SX, and products with the zeros and ones
of a joint axis or a quarter turn disappear. It is used because a CasADi operator called from Python costs tens of
microseconds in overload resolution, whatever its size, and one call here replaces ten to thirty of them.

Vectors are in the axes of the body that they belong to. R (3x3) and p (3) are the pose of a body in its parent.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import casadi as ca

#: A CasADi function: expressions in, one expression or a tuple of them out.
Step = Callable[..., Any]


def _inputs(*shapes: tuple[str, int, int]) -> list[ca.SX]:
    return [ca.SX.sym(name, rows, cols) for name, rows, cols in shapes]


def _vectors(names: str) -> list[ca.SX]:
    return [ca.SX.sym(name, 3) for name in names.split()]


def _mirrored(matrix: ca.SX) -> ca.SX:
    """The matrix with its upper triangle repeated below, so that the lower half is never computed."""
    return ca.triu2symm(ca.triu(matrix))


@cache
def compose() -> Step:
    """(R0, p0, R1, p1) -> R0 R1, p0 + R0 p1."""
    (r0, r1), (p0, p1) = _inputs(("R0", 3, 3), ("R1", 3, 3)), _vectors("p0 p1")
    return ca.Function("compose", [r0, p0, r1, p1], [r0 @ r1, p0 + r0 @ p1])


@cache
def velocity_step() -> Step:
    """(R, p, w, v, s, u) -> w' = R'w + s, v' = R'(v + w x p) + u.

    w, v: parent's angular and linear velocity; s, u: the joint's own, in child axes.
    """
    (r,), (p, w, v, s, u) = _inputs(("R", 3, 3)), _vectors("p w v s u")
    return ca.Function("velocity_step", [r, p, w, v, s, u], [r.T @ w + s, r.T @ (v + ca.cross(w, p)) + u])


@cache
def spin_step() -> Step:
    """(R, alpha, w', s, sd) -> alpha' = R'alpha + sd + w' x s, Omega' = [alpha']x + [w']x [w']x.

    alpha: parent's angular acceleration; w': the child's angular velocity; s, sd: the joint's own angular
    velocity and the rate of its components. Omega r is the acceleration of a point r of a body relative to its origin.
    """
    (r,), (alpha, w, s, sd) = _inputs(("R", 3, 3)), _vectors("alpha w s sd")
    new = r.T @ alpha + sd + ca.cross(w, s)
    omega = ca.skew(new) + _mirrored(w @ w.T - ca.sumsqr(w) * ca.DM.eye(3))
    return ca.Function("spin_step", [r, alpha, w, s, sd], [new, omega])


@cache
def acceleration_step() -> Step:
    """(R, p, Omega, a, w', s, u, ud) -> a' = R'(a + Omega p) + ud + 2 w' x u - s x u.

    a, Omega: the parent's. Accelerations are those of the body's origin (classical, not spatial).
    """
    (r, omega), (p, a, w, s, u, ud) = _inputs(("R", 3, 3), ("Omega", 3, 3)), _vectors("p a w s u ud")
    new = r.T @ (a + omega @ p) + ud + 2 * ca.cross(w, u) - ca.cross(s, u)
    return ca.Function("acceleration_step", [r, p, omega, a, w, s, u, ud], [new])


@cache
def body_wrench() -> Step:
    """(m, h, Sigma, Omega, a) -> force m a + Omega h, moment h x a + [int r x (Omega r) dm] about the origin.

    h: first moment of mass; Sigma = int r r' dm. The moment's second part is the axial vector of Omega Sigma.
    """
    (m, sigma, omega), (h, a) = _inputs(("m", 1, 1), ("Sigma", 3, 3), ("Omega", 3, 3)), _vectors("h a")
    b = omega @ sigma
    axial = ca.vertcat(b[2, 1] - b[1, 2], b[0, 2] - b[2, 0], b[1, 0] - b[0, 1])
    return ca.Function("body_wrench", [m, h, sigma, omega, a], [m * a + omega @ h, ca.cross(h, a) + axial])


@cache
def body_momentum() -> Step:
    """(m, h, Sigma, w, v) -> m v + w x h, I w + h x v about the origin, with I = tr(Sigma) 1 - Sigma."""
    (m, sigma), (h, w, v) = _inputs(("m", 1, 1), ("Sigma", 3, 3)), _vectors("h w v")
    inertia = ca.trace(sigma) * ca.DM.eye(3) - sigma
    linear, angular = m * v + ca.cross(w, h), inertia @ w + ca.cross(h, v)
    return ca.Function("body_momentum", [m, h, sigma, w, v], [linear, angular])


@cache
def wrench_to_parent() -> Step:
    """(R, p, f, n, F, N) -> F + R f, N + R n + p x (R f): a child's wrench added to its parent's."""
    (r,), (p, f, n, total_f, total_n) = _inputs(("R", 3, 3)), _vectors("p f n F N")
    force = r @ f
    outputs = [total_f + force, total_n + r @ n + ca.cross(p, force)]
    return ca.Function("wrench_to_parent", [r, p, f, n, total_f, total_n], outputs)


@cache
def inertia_to_parent() -> Step:
    """(R, p, m, h, Sigma, H, SIGMA) -> first and second moments of a parent with a child's added.

    H + R h + m p,  SIGMA + R Sigma R' + g p' + p g' with g = R h + m p / 2.
    """
    (r, m, sigma, total), (p, h, total_h) = (
        _inputs(("R", 3, 3), ("m", 1, 1), ("Sigma", 3, 3), ("SIGMA", 3, 3)),
        _vectors("p h H"),
    )
    turned = r @ h
    g = turned + 0.5 * m * p
    second = _mirrored(total + r @ sigma @ r.T + g @ p.T + p @ g.T)
    return ca.Function("inertia_to_parent", [r, p, m, h, sigma, total_h, total], [total_h + turned + m * p, second])


@cache
def joint_velocity(columns: int) -> Step:
    """(V, W, v) -> W v, V v: angular and linear velocity of a joint with motion columns V (linear) and W (angular)."""
    (linear, angular), v = _inputs(("V", 3, columns), ("W", 3, columns)), ca.SX.sym("v", columns)
    return ca.Function("joint_velocity", [linear, angular, v], [angular @ v, linear @ v])


@cache
def joint_effort(columns: int, wrenches: int) -> Step:
    """(V, W, F, N) -> V'F + W'N, columns x wrenches: what wrenches (force, moment) ask of a joint."""
    linear, angular = _inputs(("V", 3, columns), ("W", 3, columns))
    force, moment = _inputs(("F", 3, wrenches), ("N", 3, wrenches))
    return ca.Function("joint_effort", [linear, angular, force, moment], [linear.T @ force + angular.T @ moment])


@cache
def column_momentum(columns: int) -> Step:
    """(m, h, Sigma, V, W) -> m V - [h]x W, I W + [h]x V with I = tr(Sigma) 1 - Sigma: momentum per joint velocity."""
    m, h, sigma, linear, angular = _inputs(
        ("m", 1, 1), ("h", 3, 1), ("Sigma", 3, 3), ("V", 3, columns), ("W", 3, columns)
    )
    inertia, hat = ca.trace(sigma) * ca.DM.eye(3) - sigma, ca.skew(h)
    outputs = [m * linear - hat @ angular, inertia @ angular + hat @ linear]
    return ca.Function("column_momentum", [m, h, sigma, linear, angular], outputs)


@cache
def columns_to_parent(columns: int) -> Step:
    """(R, p, F, N) -> R F, R N + [p]x R F for 3 x columns matrices of forces and moments."""
    (r, f, n), (p,) = _inputs(("R", 3, 3), ("F", 3, columns), ("N", 3, columns)), _vectors("p")
    force = r @ f
    return ca.Function("columns_to_parent", [r, p, f, n], [force, r @ n + ca.skew(p) @ force])


@cache
def point_columns(columns: int) -> Step:
    """(x, P, V, W) -> V - [x - p_k]x W column by column: linear velocity at x of twists given at the points P."""
    point, (origins, linear, angular) = ca.SX.sym("x", 3), _inputs(*[(n, 3, columns) for n in "PVW"])
    arms = ca.repmat(point, 1, columns) - origins
    i, j = [1, 2, 0], [2, 0, 1]
    moved = linear - arms[i, :] * angular[j, :] + arms[j, :] * angular[i, :]
    return ca.Function("point_columns", [point, origins, linear, angular], [moved])


def _motion_cross(u: tuple[ca.SX, ca.SX], m: tuple[ca.SX, ca.SX]) -> tuple[ca.SX, ca.SX]:
    """u x m of twists (angular, linear)."""
    return ca.cross(u[0], m[0]), ca.cross(u[0], m[1]) + ca.cross(u[1], m[0])


@cache
def reference_step() -> Step:
    """(R, p, alpha, a, wc, vc, s, u, sd, ud) -> rates of the components of a twist that moves with the bodies.

    d/dt of w' = R'w + .., v' = R'(v + w x p) + ..: alpha, a: the parent's rates; wc, vc: the parent's twist in child
    axes; s, u: the joint's true twist, which turns them; sd, ud: rates of the joint's own part.
    """
    (r,), (p, alpha, a, wc, vc, s, u, sd, ud) = _inputs(("R", 3, 3)), _vectors("p alpha a wc vc s u sd ud")
    turned, shifted = _motion_cross((wc, vc), (s, u))
    outputs = [r.T @ alpha + turned + sd, r.T @ (a + ca.cross(alpha, p)) + shifted + ud]
    return ca.Function("reference_step", [r, p, alpha, a, wc, vc, s, u, sd, ud], outputs)


@cache
def two_velocity_wrench() -> Step:
    """(phi, alpha, a, w, v, wr, vr) -> force, moment: I A + (V x* I Vr + Vr x* I V + I (V x Vr)) / 2.

    A = (alpha, a): rates of the components of Vr = (wr, vr); V = (w, v): the true twist; phi: mass, first moment and
    inertia about the origin (xx, xy, yy, xz, yz, zz). The second part is skew in Vr, whatever V and phi.
    """
    phi, (alpha, a, w, v, wr, vr) = ca.SX.sym("phi", 10), _vectors("alpha a w v wr vr")
    m, h = phi[0], phi[1:4]
    xx, xy, yy, xz, yz, zz = (phi[k] for k in range(4, 10))
    inertia = ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))

    def momentum(twist: tuple[ca.SX, ca.SX]) -> tuple[ca.SX, ca.SX]:
        return m * twist[1] + ca.cross(twist[0], h), inertia @ twist[0] + ca.cross(h, twist[1])

    def turned(twist: tuple[ca.SX, ca.SX], carried: tuple[ca.SX, ca.SX]) -> tuple[ca.SX, ca.SX]:
        force, moment = momentum(carried)
        return ca.cross(twist[0], force), ca.cross(twist[1], force) + ca.cross(twist[0], moment)

    true, reference = (w, v), (wr, vr)
    pairs = zip(turned(true, reference), turned(reference, true), momentum(_motion_cross(true, reference)), strict=True)
    outputs = [own + 0.5 * sum(some) for own, some in zip(momentum((alpha, a)), pairs, strict=True)]
    return ca.Function("two_velocity_wrench", [phi, alpha, a, w, v, wr, vr], outputs)
