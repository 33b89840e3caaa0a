"""The way out of a singular configuration, for the escape of a controller's policy."""

from __future__ import annotations

import numpy as np

from wbc.explain.alone import MET, SINGULAR, Alone
from wbc.explain.past import PastTick
from wbc.validation import Array

#: Share of a task's error that lies where no joint serves it, from which on the task is lost
LOST = 0.3
#: Curvature of |e|^2 / 2 that is none
FLAT = 1e-6
#: A direction is served again from this singular value on [rows and joints in radians or characteristic lengths]
SERVED = 0.05


def way_out(past: PastTick, way: Array | None) -> Array | None:
    """The step of unit length [nv] along which the first lost task's |e|^2 / 2 has its most negative curvature,

        J'J + d(e'J)/dq,      e the error where it is lost

    or ``way`` again, as long as the task is lost; None where no task is, or none has such a step.
    """
    for block in past.layout.of_form("task"):
        if not past.is_on(block) or block.share >= 0 or "gain" not in block.slots:
            continue
        if float(past.tick.p[block.slots["gain"].span][0]) == 0.0:
            continue
        alone = Alone(past, block)
        q = past.tick.q.copy()
        here = alone.at(q)
        size = float(np.linalg.norm(here.e))
        lost = here.lost(alone.free(q, here), SINGULAR if way is None else SERVED)[0]
        if size < MET or np.linalg.norm(lost) < LOST * size:
            continue
        if way is not None:
            return way
        curvature, step = alone.escape(q)
        if curvature < -FLAT:
            return step
    return None
