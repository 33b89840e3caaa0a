"""Velocity of the body: three components from the operator, three that keep its height and lay it flat. Inch, rad, s.

With r and th the radius and angle of the body's origin, and t, a, n the unit vectors round, along and off the cylinder,

    v = rate_T 5deg r t + 9.25 rate_A a + (100 + H - r) / dt n
    w = spin z + (z x -n) / dt - rate_T 5deg e_z

Source: M. R. Patterson's thesis, 5.2; RVEL is not listed, this is a reconstruction. Height and tangency errors are
taken back within one cycle.
"""

from __future__ import annotations

import numpy as np

from wbc.multibody import pin
from wbc.published.three_arm_walker.machine.grid import PITCH, RADIUS, STEP, coordinates, euler_angles
from wbc.published.three_arm_walker.machine.motion import CYCLE
from wbc.published.three_arm_walker.machine.rigid import cross
from wbc.validation import Array


def body_twist(body: Array, rates: Array, height: float) -> Array:
    """Linear velocity of the body's origin and angular velocity, fixed axes [in/s, rad/s].

    Args:
        body: 4 x 4. rates: of T and A [grid units/s], spin about the body's z axis [rad/s]. height: to be kept [in].
    """
    x, y, _ = body[:3, 3]
    radius = float(np.hypot(x, y))
    normal = np.array([x / radius, y / radius, 0.0])
    round_it = np.array([normal[1], -normal[0], 0.0])
    turn = float(rates[0]) * STEP
    linear = turn * radius * round_it + (RADIUS + height - radius) / CYCLE * normal
    linear[2] -= PITCH * rates[1]
    z = body[:3, 2]
    angular = rates[2] * z - cross(z, normal) / CYCLE
    angular[2] -= turn
    return np.concatenate([linear, angular])


def moved(pose: Array, twist: Array) -> Array:
    """A pose after one cycle of a twist in fixed axes."""
    out = pose.copy()
    out[:3, 3] += twist[:3] * CYCLE
    out[:3, :3] = np.asarray(pin.exp3(twist[3:] * CYCLE)) @ pose[:3, :3]
    return out


def body_place(body: Array) -> tuple[float, float, float]:
    """(T, A, heading [rad]) of the body."""
    column, row = coordinates(body[:3, 3])
    return float(column), float(row), euler_angles(body[:3, :3])[2]
