"""Whether contacts and motors bear a robot at rest wherever a plan has it."""

from __future__ import annotations

import numpy as np

from wbc.climb.balance import Equilibrium
from wbc.climb.plan import ContactPlan
from wbc.errors import RangeError

#: Share of the efforts that standing still may take; the rest is for motion
EFFORT_SHARE = 0.9
#: Time between knots that are looked at, beside those where limbs lift and land [s]
EVERY = 0.2


def check_borne(plan: ContactPlan, effort: float = EFFORT_SHARE) -> None:
    """Refuses a plan on which the contacts of its limbs and their motors do not bear the robot at rest.

    Args:
        plan: is looked at where limbs lift and land, and between. effort: share of the joints' efforts that counts [1].

    Raises:
        RangeError: the first time at which they do not [s], and what is lacking [N m; N].
    """
    if not np.any(plan.scene.gravity) or not len(plan.times):
        return
    balance, times = Equilibrium(plan.climber, plan.scene), np.asarray(plan.times)
    events = {0.0, float(times[-1]), *(time for move in plan.moves for time in (move.lift, move.land))}
    rows = np.searchsorted(times, sorted({*events, *np.arange(0.0, times[-1], EVERY).tolist()}), side="left")
    for k in np.unique(np.minimum(rows, len(times) - 1)):
        time = float(times[k])
        held = plan.contacts_at(time)
        if lacks := balance.lacking(held, plan.q[k], effort):
            raise RangeError("plan", time, f"{balance.told(held, lacks)}, at {time:.2f} s of the plan")
