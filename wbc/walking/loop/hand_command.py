"""The command of a swinging hand from tick to tick along its law."""

from __future__ import annotations

import functools

import casadi as ca

from wbc.native.compiled_function import compiled
from wbc.stack.evaluation import SingleState
from wbc.validation import Array
from wbc.walking.loop.hand_pace import BEHIND
from wbc.walking.loop.state import Swinging
from wbc.walking.planner.grips.table import Grips
from wbc.walking.planner.swings.law import Aim

#: Where things are in the output: what is `now` in the next tick, joints 4 to 6 with the part of the wrist's way, the
#: velocity, and what the stack follows
NOW, BEND, VELOCITY, FOLLOWED = slice(0, 6), slice(3, 7), slice(7, 10), slice(10, 22)


@functools.cache
def aim_function() -> ca.Function:
    """f(place, now, law, source, target, parts, rate) of a hand at ``place`` ``[3]``.

    Args:
        now: its aim and joints 4 to 6 as the tick begins ``[6]``. law: two rows of its law ``[14]``.
        source, target: joints 4 to 6 of the grips that it leaves and comes to, at two samples of the body's path
            ``[6]``. parts: of the ways between those rows and samples ``[3]``. rate: 1 / dt [1/s].

    Returns:
        The position of the law, joints 4 to 6 as the tick ends, the part of the wrist's way, the velocity; and place,
        velocity, joints and their rates to follow, from where things are to be as the tick begins to where they are to
        be as it ends. A hand that cannot follow must not pull at the body: its place waits within :data:`BEHIND` of it.
    """
    sizes = {"place": 3, "now": 6, "law": 14, "source": 6, "target": 6, "parts": 3, "rate": 1}
    place, now, law, source, target, parts, rate = (ca.SX.sym(name, size) for name, size in sizes.items())
    row, first, last = (
        rows[: rows.numel() // 2] + parts[k] * (rows[rows.numel() // 2 :] - rows[: rows.numel() // 2])
        for k, rows in enumerate((law, source, target))
    )
    bend = first + row[6] * (last - first)
    gap = now[:3] - place
    far = ca.norm_2(gap)
    waits = place + gap * (BEHIND / ca.fmax(far, BEHIND))
    followed = ca.vertcat(ca.if_else(far <= BEHIND, now[:3], waits), (row[:3] - now[:3]) * rate)
    out = ca.vertcat(row[:3], bend, row[6], row[3:6], followed, now[3:], (bend - now[3:]) * rate)
    return compiled(ca.Function("aim", [place, now, law, source, target, parts, rate], [out]))


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
