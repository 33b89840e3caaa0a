"""Angle between an axis and a vector, and a margin of a cone that has a derivative on its axis."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from wbc import validation
from wbc.symbolic import rotations as rot
from wbc.tasks import _stereographic as stereo
from wbc.tasks._stereographic import Triple
from wbc.tasks.base import Input

#: Lengths below this [m], or parts of a length, have no usable direction.
COINCIDENT = 1e-10

#: Smallest half angle [rad]; an axis that may not leave a direction at all is a task for alignment.
LEAST_ANGLE = 1e-3


def reach(axis: Triple, vector: ca.SX) -> tuple[ca.SX, ca.SX]:
    """A vector and its length [m], neither of them 0: within COINCIDENT of 0 a little of the axis is added.

    The value is then off by at most 3 COINCIDENT, and the gradient leads along the axis.
    """
    near = stereo.square(vector) < COINCIDENT**2
    moved = vector + ca.if_else(near, 2 * COINCIDENT, 0.0) * rot.constant(axis)
    return moved, ca.sqrt(stereo.square(moved))


def angle_between(axis: Triple, vector: ca.SX, length: ca.SX | float = 1.0) -> ca.SX:
    """Angle theta in [0, pi] of a vector of a given length from a constant unit axis [rad].

        theta = 2 atan2(| vector - length axis |, | vector + length axis |)

    Exact at all angles, where the arc cosine loses half of its digits. Its gradient has unit length at unit distance
    everywhere: within COINCIDENT of 0 and pi, where it has none, one direction across the axis is taken.
    """
    along = length * rot.constant(axis)
    aside = rot.constant(_across(axis)) * length
    return 2 * ca.atan2(_guarded(vector - along, aside), _guarded(vector + along, aside))


def _guarded(chord: ca.SX, aside: ca.SX) -> ca.SX:
    """|chord|; the chord is moved aside where it is too short to have a direction."""
    near = stereo.square(chord) < COINCIDENT**2 * stereo.square(aside)
    return ca.sqrt(stereo.square(chord + ca.if_else(near, 2 * COINCIDENT, 0.0) * aside))


def _across(axis: Triple) -> Triple:
    """A unit vector across the axis: its cross product with the coordinate axis that is farthest from it."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    across = np.cross(axis, other)
    return stereo.triple(across / np.linalg.norm(across))


def cone_margin(angle: ca.SX, half_angle: ca.SX) -> ca.SX:
    """h = (alpha - theta) (1 + min(theta / alpha, 1)) / 2 for an angle theta from the axis of a cone [rad].

    Outside the cone that is alpha - theta, inside (alpha^2 - theta^2) / (2 alpha): zero on the cone with slope -1 on
    both sides, and without the tip that alpha - theta has on the axis.
    """
    return (half_angle - angle) * (1 + ca.fmin(angle / half_angle, 1.0)) / 2


def half_angle_inputs(half_angle: float) -> tuple[Input, Input]:
    """``half_angle`` and ``half_angle_rate``."""
    return (
        Input("half_angle", unit="rad", default=half_angle, rate="half_angle_rate", low=LEAST_ANGLE, high=math.pi),
        Input("half_angle_rate", unit="rad/s", default=0.0),
    )


def checked_half_angle(field: str, value: object) -> float:
    """A half angle within [LEAST, pi] rad.

    Raises:
        ShapeError, NotFiniteError, RangeError: it is none.
    """
    return validation.scalar(field, value, low=LEAST_ANGLE, high=math.pi, unit="rad")
