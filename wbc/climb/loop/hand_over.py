"""How fast a plan goes on so that limbs have the time to hand over their loads."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

import numpy as np

from wbc.climb.loop.pace import STOPPING
from wbc.climb.loop.reference import PlanReference
from wbc.climb.plan import ContactMove

#: Time in which one limb takes its load and another one gives up its own, of ``UNLOAD``, with the ticks between [1]
HANDED = 2.2
#: Least rate at which a plan goes on meanwhile [1]
SLOWEST_HANDED = 0.1
#: Rates below which a plan is at rest [m/s, rad/s]
RESTS = 1e-3


class HandOvers:
    """Where a lift comes within less than a time after a landing, and the robot moves meanwhile, a plan takes that time
    between them; its rate falls and rises by 1 within ``STOPPING``.

    Args:
        moves: of the plan. reference: its motion. unload: time in which a limb hands over its load [s].

    Attributes:
        moving: lifts at which the plan is not at rest [s]. resting: landings at which it is [s].
    """

    def __init__(self, moves: Sequence[ContactMove], reference: PlanReference, unload: float) -> None:
        time, lands = HANDED * unload, sorted(move.land for move in moves)
        lifts = sorted({move.lift for move in moves})
        moves_at = {t: np.abs(reference.derivatives(t)[0]).max() > RESTS for t in {*lifts, *lands}}
        self.moving = {lift for lift in lifts if moves_at[lift]}
        self.resting = {land for land in lands if not moves_at[land]}
        #: (landing, lift, rate between) [s, s, 1]
        self._slow = list[tuple[float, float, float]]()
        for lift in lifts:
            if lift not in self.moving:
                continue
            before = [land for land in lands if lift - time < land <= lift]
            if before:
                self._slow.append((before[-1], lift, max((lift - before[-1]) / time, SLOWEST_HANDED)))

    def rate(self, at: float) -> float:
        """Largest rate at a time of the plan [s], which does not go back [1]."""
        while self._slow and self._slow[0][1] < at - STOPPING:
            self._slow.pop(0)
        most = 1.0
        for land, lift, rate in self._slow:
            away = land - at if at < land else at - lift
            if away > STOPPING:
                break
            most = min(most, rate if away <= 0.0 else sqrt(rate * rate + 2.0 * away / STOPPING))
        return most
