"""The command of a swinging hand from tick to tick along its law."""

from __future__ import annotations

from wbc.stack.single import SingleState
from wbc.validation import Array
from wbc.walking.loop.aim_function import BEND, FOLLOWED, NOW, VELOCITY, aim_function
from wbc.walking.loop.state import Swinging
from wbc.walking.planner.grips.table import Grips
from wbc.walking.planner.swings.law import Aim


class HandCommand:
    """What the hand on its way follows in a tick.

    Args:
        dt: control period [s].
    """

    def __init__(self, dt: float) -> None:
        self._step = SingleState(aim_function())
        self._place, self._now, self._law, self._source, self._target, self._parts, rate = self._step.inputs
        rate[0] = 1.0 / dt
        # What the inputs are of, so that they are written when they change
        self._swinging: Swinging | None = None
        self._known: list[tuple[Grips | None, int, int]] = [(None, -1, -1)] * 2

    def go(self, swinging: Swinging, place: Array, grips: Grips, source: int, sample: float) -> Array:
        """Move the hand's aim and the bend of its wrist on to its clock.

        Args:
            place: of the hand [m]. source: the grip that it leaves. sample: of the body's path.

        Returns:
            Place [m], velocity [m/s], joints 4 to 6 [rad] and their rates [rad/s] to follow ``[12]``.
        """
        parts = self._parts
        if swinging is self._swinging:
            self._now[:] = self._step.output[NOW]
        else:
            self._now[:], self._swinging = (*swinging.aim.position, *swinging.bend), swinging
        self._place[:] = place
        self._law[:], parts[0], whole = swinging.law.rows_at(swinging.clock)
        if swinging.wrist is None:
            parts[1] = self._between(0, grips, source, sample)
        else:
            self._source[:3] = self._source[3:] = swinging.wrist
            self._known[0] = None, -1, -1
        parts[2] = self._between(1, grips, swinging.grip, sample)
        self._step.run()
        out = self._step.output.copy()
        a, b, c, blend = out[BEND].tolist()
        swinging.aim, swinging.bend = Aim(out[:3], out[VELOCITY], blend, whole), (a, b, c)
        return out[FOLLOWED]

    def _between(self, which: int, grips: Grips, grip: int, sample: float) -> float:
        """Write joints 4 to 6 of a grip at two samples; the part of the way between them."""
        first, last, rows = grips.wrists(grip)
        inside = min(max(sample, first), last) - first
        low = min(int(inside), last - first - 1)
        of, key, known = (self._source, self._target)[which], (grips, grip, low), self._known[which]
        if key != known:
            of[:] = rows[low : low + 2].reshape(6)
            self._known[which] = key
        return inside - low
