"""How a hand that comes down on its hold turns upright, so that nothing jumps when its wrist is let go."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.validation import Array
from wbc.walking.loop.hand_pace import angle
from wbc.walking.loop.state import Axes, Swinging

#: A hand turns upright when its aim is within this of its hold [m]; until then its wrist follows its law
UPRIGHT = 0.05
#: A hand whose law ends within this of its hold turns at once [m]
THERE = 0.001


class HandLanding:
    """The axes of a hand that comes down, in the structure's frame:

        z(s) = exp(s phi) z_hold,     x(s) = exp(s phi) x_hold,     s = |p - p_hold| / |p_0 - p_hold|

    p is its aim, p_0 that at which its wrist was let go, phi the turn that takes the axes of the hold to those which
    the hand had there; the shortest one where only z counts. As the arm brings a hand down along the normal its lean
    goes with its height. To want the hold's own axis at once turns the hand by that lean in a tenth of a second, and
    with theta5 near 0, where joint 4 hardly turns it, off its path by centimetres.

    Args:
        dt: control period [s].
    """

    def __init__(self, dt: float) -> None:
        self._dt = dt
        self._swinging: Swinging | None = None
        self._turn, self._far, self._part = np.zeros(3), 0.0, 0.0

    def go(self, swinging: Swinging, hold: tuple[Array, Array], near: bool) -> Axes | None:
        """The axes as a tick begins and their rates in it, once the aim of the hand has been moved on; None until then.

        Args:
            swinging: ``axis`` and ``x_axis`` are those of the hand now. hold: its place [m] and z axis.
            near: it comes down on it.
        """
        if not near:
            self._swinging = None
            return None
        place, z = hold
        far, x = float(np.linalg.norm(swinging.aim.position - place)), swinging.x
        if swinging is not self._swinging:
            self._swinging, self._turn, self._far = swinging, _turn(swinging, z), far
            self._part = 1.0 if far > THERE else 0.0
        before, self._part = self._part, min(self._part, far / self._far if self._far > THERE else 0.0)
        now, later = (pin.exp3(part * self._turn) for part in (before, self._part))
        rate = (later - now) / self._dt
        return Axes(now @ z, rate @ z, None if x is None else now @ x, None if x is None else rate @ x)


def _turn(swinging: Swinging, z: Array) -> Array:
    """Rotation vector that takes the axes of the hold to those of the hand [rad]."""
    axis, x_axis, x = swinging.axis, swinging.x_axis, swinging.x
    if x is not None:
        hand, hold = (np.column_stack([a, np.cross(b, a), b]) for a, b in ((x_axis, axis), (x, z)))
        return np.asarray(pin.log3(hand @ hold.T))
    across = np.cross(z, axis)
    return np.asarray(across * (angle(z, axis) / max(float(np.linalg.norm(across)), 1e-12)))
