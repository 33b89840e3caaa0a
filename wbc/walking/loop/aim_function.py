"""A tick's step of a swinging hand along its way, as one expression: what hand and wrist are to follow."""

from __future__ import annotations

import functools

import casadi as ca

from wbc.native.compiled_function import compiled
from wbc.walking.loop.hand_pace import BEHIND

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
