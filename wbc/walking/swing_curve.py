"""The way of a swinging hand: off its hold along the normal, across, and onto the next hold along its normal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.validation import Array
from wbc.walking.grips import Ints
from wbc.walking.structure import Structure

#: Between these parts of the curve the hand turns from one normal to the other
TURN_FROM, TURN_TO = 0.2, 0.8


@dataclass(frozen=True, eq=False)
class Curves:
    """m cubic Bezier curves in the structure's frame, over x in [0, 1]:

        p(x) = (1-x)^3 a + 3 (1-x)^2 x (a - c z_a) + 3 (1-x) x^2 (b - c z_b) + x^3 b

    from hold a to hold b with approach directions z_a and z_b: it leaves and arrives along them. Its middle is 3 c / 4
    above the chord.

    Attributes:
        begin, end: ``[m, 3]`` [m]. leave, arrive: approach directions there ``[m, 3]``. rise: c ``[m]`` [m].
    """

    begin: Array
    end: Array
    leave: Array
    arrive: Array
    rise: Array

    def at(self, x: Array) -> tuple[Array, Array]:
        """Positions and dp/dx at ``x`` ``[n]``: ``[m, n, 3]`` each."""
        s = x[None, :, None]
        a, d = self.begin[:, None], self.end[:, None]
        b, c = a - (self.rise[:, None] * self.leave)[:, None], d - (self.rise[:, None] * self.arrive)[:, None]
        r = 1.0 - s
        place = r**3 * a + 3 * r * r * s * b + 3 * r * s * s * c + s**3 * d
        return place, 3 * (r * r * (b - a) + 2 * r * s * (c - b) + s * s * (d - c))

    def axes(self, x: Array) -> tuple[Array, Array]:
        """Wanted z axes of the hand, and their derivatives along x, ``[m, n, 3]`` each.

        They keep to the normals at both ends and turn between them, with a smooth fifth-degree step.
        """
        part = np.clip((x - TURN_FROM) / (TURN_TO - TURN_FROM), 0.0, 1.0)
        step = (part**3 * (10 - 15 * part + 6 * part**2))[None, :, None]
        rate = (30 * part**2 * (1 - part) ** 2 / (TURN_TO - TURN_FROM))[None, :, None]
        change = (self.arrive - self.leave)[:, None]
        line = self.leave[:, None] + step * change
        length = np.linalg.norm(line, axis=2, keepdims=True)
        # Opposite normals meet at 0 in the middle: any axis will do there
        axis = np.where(length > 1e-9, line / np.maximum(length, 1e-9), self.leave[:, None])
        across = rate * change
        along = (axis * across).sum(axis=2, keepdims=True)
        return axis, (across - along * axis) / np.maximum(length, 1e-9)


def curves(structure: Structure, begin: Ints, end: Ints, height: float, free: float) -> Curves:
    """Curves between holds, given by rows of the structure.

    They are ``height`` [m] above what lies between where the hand is farther than ``free`` [m] from both holds.
    """
    a, b = structure.positions[begin], structure.positions[end]
    za, zb = structure.axes[begin], structure.axes[end]
    middle, up = 0.5 * (a + b), -(za + zb)
    up /= np.maximum(np.linalg.norm(up, axis=1), 1e-9)[:, None]
    # What the middle of the chord lacks, clearance of obstacles included, is added where it helps: straight up
    lack = np.maximum(height - structure.clearance(middle + height * up), 0.0)
    # Across, the curve has come 3 x^2 - 2 x^3 of the span; there its height is 3 c x (1 - x)
    part = np.clip(free / np.maximum(np.linalg.norm(b - a, axis=1), 1e-9), 0.0, 0.5)
    grid = np.linspace(0.0, 0.5, 65)
    x = np.interp(part, grid**2 * (3 - 2 * grid), grid)
    return Curves(a, b, za, zb, (height + lack) / (3.0 * x * (1.0 - x)))


def between(place: Array, axis: Array, structure: Structure, hold: int, height: float) -> Curves:
    """The way of a hand that is in the air, at ``place`` with its z axis along ``axis``, to a hold."""
    end, arrive = structure.positions[[hold]], structure.axes[[hold]]
    # It need not rise more than it lacks, but must come down along the hold's normal
    above = float(structure.clearance(place))
    rise = max(height - above, 0.5 * height) * 4.0 / 3.0
    return Curves(place[None], end, axis[None], arrive, np.array([rise]))
