"""What a swing leads from posture to posture: the guided joints of a limb, between two grips."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wbc.robots import BodyLimb
from wbc.validation import Array
from wbc.walking.planner.grips.rolls import ANY
from wbc.walking.planner.grips.table import Grips, Ints

#: Angles of the guided joints, without the last where the roll is free, ``[m, n, g]`` at fractional samples ``[m, n]``
Guide = Callable[[Array], Array]


def blend(x: Array) -> Array:
    """Part of the guided joints' change at ``x`` in [0, 1] of the hand's path: x^2 (3 - 2x)."""
    out: Array = x * x * (3.0 - 2.0 * x)
    return out


def guide_between(
    limb: BodyLimb, grips: Grips, source: Ints, target: Ints, points: int, parts: tuple[float, float] = (0.0, 1.0)
) -> Guide:
    """Guided joints that leave grips and come to others, from part to part; both change as the body moves on."""
    part = (parts[0] + (parts[1] - parts[0]) * blend(np.linspace(0.0, 1.0, points)))[None, :, None]
    begin, end = limb.guided, guided_end(limb, grips, source, target)

    def guide(samples: Array) -> Array:
        first, last = (grips.between(g[:, None], samples)[..., begin:end] for g in (source, target))
        out: Array = first + part * (last - first)
        return out

    return guide


def guided_end(limb: BodyLimb, grips: Grips, source: Ints, target: Ints) -> int:
    """Joints before this one count: all, but the last only where some hold fixes the roll."""
    free = (grips.roll[source] == ANY).all() and (grips.roll[target] == ANY).all()
    return len(limb.position_limits) - int(free)
