"""Existence segments: how far an arm base may go on before its arm reaches a limit. Units: inch, radian; grid units.

As the base moves, the hold moves back along a line of the (T, A) plane. With y along the motion and x across it,
measured from the base, the hold at (x_h, y_h) meets

    the outer circle            y = -sqrt(radius^2 - x_h^2)
    the inner circle            y = sqrt(r^2 - x_h^2), r = (SN + 2) / 9.25, if it lies ahead and |x_h| <= r
    another base's direction    y = x_h / x_o y_o, the line from this base through base o, if ahead and on o's side

and the margin is y_h less the largest of these: grid units of travel, negative where one is passed already. Joint
limits do not enter. Source: M. R. Patterson's thesis, 5.3.1, and the listing EXIST. The text has the outer circle only.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc.published.three_arm_walker.machine.calibration import Variant
from wbc.published.three_arm_walker.machine.grid import PITCH, cross
from wbc.published.three_arm_walker.machine.reach import ARMS, INNER, View
from wbc.validation import Array

#: What a limit that is not met counts as
NONE = -99.0

#: Below it a base stands: what rounding leaves of a command to stand has no direction [in/s]
LEAST_SPEED = 1e-9

#: Of another base, where it lies on the line of travel [grid units]
LEAST_ACROSS = 1e-8


def travel(view: View, twist: Array) -> Array:
    """Directions in the (T, A) plane in which the three arm bases move [rad]; 0, which is +T, where they stand.

    As listed, the speed round the cylinder is divided by 9.25 in although a base moves further per unit.

    Args:
        twist: of the body's origin, fixed axes: linear, angular [in/s, rad/s].
    """
    velocity = np.array([twist[:3] + cross(twist[3:], offset) for offset in view.offsets])
    radii = np.hypot(view.points[:, 0], view.points[:, 1])
    along = (view.points[:, 1] * velocity[:, 0] - view.points[:, 0] * velocity[:, 1]) / radii
    moving = np.hypot(velocity[:, 2], along) > LEAST_SPEED
    return np.where(moving, np.arctan2(-velocity[:, 2] / PITCH, along / PITCH), 0.0)


def margins(view: View, arms: Any, twist: Array, places: NDArray[Any], variant: Variant = "listing") -> Array:
    """Margins of arms, 0 to 2, at places m x 2: of one arm at each, or of the arm named for each [grid units].

    Args:
        arms: a number, or m numbers. twist: of the body's origin, fixed axes: linear, angular [in/s, rad/s].
    """
    direction = travel(view, twist)[arms]
    s, c = np.sin(direction), np.cos(direction)
    x, y = _turned(places - view.bases[arms], s, c)
    # A hold that has drifted out of the circle sideways would be the root of a negative number
    limit = -np.sqrt(np.maximum(view.shoulders.reach**2 - x**2, 0.0))
    if variant == "text":
        return np.asarray(y - limit)
    inside = (np.abs(x) <= INNER) & (y >= 0.0)
    limit = np.maximum(limit, np.where(inside, np.sqrt(np.maximum(INNER**2 - x**2, 0.0)), NONE))
    for step in range(1, ARMS):
        xo, yo = _turned(view.bases[(arms + step) % ARMS] - view.bases[arms], s, c)
        # Listed for 0 alone; rounding would take the side
        xo = np.where(np.abs(xo) > LEAST_ACROSS, xo, LEAST_ACROSS)
        line = x / xo * yo
        limit = np.maximum(limit, np.where((x * xo < 0.0) | (y < line), NONE, line))
    return np.asarray(y - limit)


def _turned(step: Array, s: Array, c: Array) -> tuple[Array, Array]:
    """(across, along) the motion of steps in the (T, A) plane."""
    t, a = step[..., 0], step[..., 1]
    return s * t - c * a, c * t + s * a
