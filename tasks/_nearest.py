"""Distance and direction between two points, and from a point to the surface of a box or a cylinder.

Gradients are unit vectors everywhere. Where a distance has no direction one is declared.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

if TYPE_CHECKING:
    from wbc.shapes import Box, Cylinder

#: Points closer than this [m] have no usable direction between them.
COINCIDENT = 1e-10

#: How far a point is moved in the direction that is to be out where two points coincide, over the size of the shapes:
#: it costs an addition, where a case of its own would cost every row a branch.
SHIFT = 1e-11

#: Added to squared lengths [m^2]: keeps a length of exactly zero from being divided by.
NOTHING = 1e-40


def distance(offset: ca.SX) -> ca.SX:
    """|offset| of a 3-vector [m] with a unit gradient everywhere.

    Within :data:`COINCIDENT` of zero, where the norm has no derivative, 2 COINCIDENT is added to z: the value is then
    off by at most 3 COINCIDENT, and the direction is about z instead of NaN or zero.
    """
    near = ca.dot(offset, offset) < COINCIDENT**2
    x, y, z = offset[0], offset[1], offset[2] + ca.if_else(near, 2 * COINCIDENT, 0)
    return ca.sqrt(x * x + y * y + z * z)


def between(start: ca.SX, end: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Length and direction of end - start. Where both are one point the direction is 0 and not NaN; :data:`SHIFT` one
    of them so that only points that are never met exactly are one.
    """
    offset = end - start
    length = ca.sqrt(ca.dot(offset, offset) + NOTHING)
    return length, offset * (1 / length)


def clamp(x: ca.SX, half: float) -> ca.SX:
    """x cut to [-half, half]. In compiled code four additions are faster than the calls that fmin and fmax are."""
    return (ca.fabs(x + half) - ca.fabs(x - half)) / 2


def out_of_box(point: ca.SX, box: Box) -> tuple[ca.SX, ca.SX]:
    """Signed distance of a point to the surface of a box and the direction away from it, in the box's axes."""
    half = [side / 2 for side in box.size]
    nearest = ca.vertcat(*[clamp(point[k], half[k]) for k in range(3)])
    beyond = point - nearest
    square = ca.dot(beyond, beyond)
    outside = square > COINCIDENT**2
    length = ca.sqrt(ca.if_else(outside, square, 1))
    dx, dy, dz = (half[k] - ca.fabs(point[k]) for k in range(3))
    x_first = ca.logic_and(dx <= dy, dx <= dz)
    y_first = ca.logic_and(ca.logic_not(x_first), dy <= dz)
    z_first = ca.logic_not(ca.logic_or(x_first, y_first))
    depth = ca.fmin(ca.fmin(dx, dy), dz)
    face = ca.vertcat(
        *[
            ca.if_else(ca.logic_and(chosen, ca.logic_not(outside)), side_of(point[k]), 0)
            for k, chosen in enumerate((x_first, y_first, z_first))
        ]
    )
    return ca.if_else(outside, length, -depth), beyond / length + face


def out_of_cylinder(point: ca.SX, cylinder: Cylinder) -> tuple[ca.SX, ca.SX]:
    """Signed distance of a point to the surface of a cylinder and the direction away from it, in its axes."""
    x, y, z = point[0], point[1], point[2]
    square = x * x + y * y
    off_axis = square > COINCIDENT**2
    radius = ca.sqrt(ca.if_else(off_axis, square, 1))
    radial = ca.if_else(off_axis, ca.vertcat(x, y) / radius, ca.SX(ca.DM([1.0, 0.0])))
    around = ca.if_else(off_axis, radius, 0) - cylinder.radius
    over = ca.fabs(z) - cylinder.length / 2
    wide, high = ca.fmax(around, 0), ca.fmax(over, 0)
    square = wide * wide + high * high
    outside = square > COINCIDENT**2
    length = ca.sqrt(ca.if_else(outside, square, 1))
    by_end = over >= around
    along = ca.if_else(outside, high / length, by_end)
    across = ca.if_else(outside, wide / length, ca.logic_not(by_end))
    depth = ca.fmax(around, over)
    return ca.if_else(outside, length, depth), ca.vertcat(across * radial, along * side_of(z))


def side_of(x: ca.SX) -> ca.SX:
    """Sign of x, 1 for 0."""
    return ca.if_else(x < 0, -1, 1)
