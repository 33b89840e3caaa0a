"""What limits a plan and a walk: the grips that end, and the joints that are as fast as they may be."""

from __future__ import annotations

import numpy as np

from wbc.robots import Walker
from wbc.walking.log.log import OPEN, WalkLog
from wbc.walking.planner.plan import Plan

#: A joint is at its limit from this part of it on
AT = 0.85
#: Ends of grips count as the reason where the hand lands so shortly before [s]
CLOSE = 0.25


def plan_limit(walker: Walker, plan: Plan) -> str:
    """Why the body has to wait where it waits longest; "" where it never does."""
    if not plan.delay or plan.grips is None:
        return ""
    k = max(range(len(plan.regrasps)), key=lambda i: plan.regrasps[i].delay)
    step, grips = plan.regrasps[k], plan.grips
    ends = []
    for arm, chain in zip(walker.arms, plan.chain, strict=True):
        if arm.name != step.arm:
            grip = chain[sum(other.arm == arm.name for other in plan.regrasps[:k])]
            ends.append((float(grips.last[grip]) * plan.path.spacing, arm.name, grips.reasons[grips.ends[grip]]))
    until, name, reason = min(ends)
    why = f"{name}: {reason}" if until - step.land <= CLOSE else "arms in each other's way"
    return f"{step.arm} {step.source} to {step.target} waits {step.delay:.2f} s ({why})"


class Pressed:
    """Which limits the joints of swinging arms are at, and for what part of their time."""

    def __init__(self, walker: Walker, dt: float) -> None:
        self._arms, self._dt = walker.arms, dt
        limits = walker.robot.limits
        self._limits = limits.velocity[6:], limits.acceleration[6:]

    def of(self, log: WalkLog) -> str:
        """The limit that joints of hands in the air are at most often; "" where no hand swings."""
        rates, accelerations = self._limits
        changes = np.abs(np.diff(log.v, axis=0)) / self._dt
        shares: dict[str, float] = {}
        ticks = 0
        for k, arm in enumerate(self._arms):
            open_ = log.hand_state[:-1, k] == OPEN
            ticks += int(open_.sum())
            mine = slice(arm.v.start - 6, arm.v.stop - 6)
            for kind, values, most in (
                ("rate", np.abs(log.v[:-1, mine]), rates[mine]),
                ("acceleration", changes[:, mine], accelerations[mine]),
            ):
                for joint, count in enumerate((values[open_] >= AT * most).sum(axis=0).tolist(), 1):
                    name = f"joint {joint} {kind}"
                    shares[name] = shares.get(name, 0.0) + count
        if not ticks:
            return ""
        name = max(shares, key=lambda key: shares[key])
        return f"{name}, {100.0 * shares[name] / ticks:.0f} % of swings"
