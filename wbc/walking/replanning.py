"""A new plan on the way: from the hands that hold, and with free hands where they can be brought to."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.body_path import BodyPath
from wbc.walking.closed_chain import ClosedChain
from wbc.walking.plan import Plan
from wbc.walking.planner import plan_walk
from wbc.walking.structure import Structure
from wbc.walking.swing_curve import between
from wbc.walking.swing_law import SwingLaw
from wbc.walking.swings import FINE


def plan_from_here(
    walker: Walker, structure: Structure, path: BodyPath, held: Mapping[int, int], q: Array, chain: ClosedChain
) -> Plan:
    """A plan along a path that begins where the body stands.

    Args:
        held: row of the arm -> row of the hold, of hands that hold. q: configuration. chain: where the hands are.

    Raises:
        NoPlanError: there is none.
    """
    arms, avoid = walker.arms, dict[str, set[str]]()
    start = {arms[arm].name: structure.ids[hold] for arm, hold in held.items()}
    postures = {arms[arm].name: q[arms[arm].q] for arm in held}
    while True:
        asked = {"start": start, "postures": postures, "avoid": avoid}
        plan = plan_walk(walker, structure, path, objective="destination", **asked)  # type: ignore[arg-type]
        free = [arm for arm in range(len(arms)) if arm not in held]
        far = [arm for arm in free if not way_to(walker, structure, plan, arm, chain).possible]
        if not far:
            return plan
        for arm in far:
            avoid.setdefault(arms[arm].name, set()).add(plan.start[arm])


def way_to(walker: Walker, structure: Structure, plan: Plan, arm: int, chain: ClosedChain) -> SwingLaw:
    """From where a free hand is to where the plan has it at the beginning; the body stands there."""
    height = walker.data.lift_height  # type: ignore[union-attr]
    way = between(chain.origins[arm], chain.axes[arm], structure, structure.index(plan.start[arm]), height)
    return SwingLaw(walker, arm, plan.path, way, np.zeros(FINE), 1.0)
