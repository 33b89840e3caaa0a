"""What does not depend on speed: whether a body can stand at a pose; and paths on which only joints are too slow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.grips.table import SHORTEST, grip_slices
from wbc.walking.planner.plan import NoPlanError, Plan
from wbc.walking.planner.slices import drained
from wbc.walking.planner.stances.body import BodySearch
from wbc.walking.planner.starts import ALL_STARTS, NOTHING, STARTS, Beginning, holding_of, stance_slices

#: How many times slower a path is tried that is too fast for the joints
SLOWER = (2, 4, 8)
#: A path whose origin goes slower only turns, and its rate is told [m/s]
TURNS = 1e-4


def check_stance(walker: Walker, structure: Structure, pose: Array, where: str, beginning: Beginning = NOTHING) -> None:
    """Whether the body can stand at a pose ``[4, 4]``, all of its hands on holds.

    Args:
        where: of the path the pose is, for the message.

    Raises:
        NoPlanError: it cannot, at whatever speed it comes there. UnknownNameError: another arm or hold.
    """
    path = BodyPath(np.repeat(pose[None], SHORTEST, axis=0))
    grips = drained(grip_slices(walker, structure, path, holding=holding_of(walker, structure, beginning)))
    search = BodySearch(walker, structure, path, grips)
    every = (STARTS, ALL_STARTS, (len(grips), 1))
    for most in every:
        try:
            drained(stance_slices(walker, structure, search, beginning, 0, most, where))
        except NoPlanError:
            if most is every[-1]:
                raise
        else:
            return


def plan_slower(path: BodyPath, joint: str, along: Callable[[BodyPath], Plan]) -> Plan | None:
    """A plan that leads to the end of the same path at the highest of some lower speeds, with a note of it; else None.

    Args:
        joint: that is too slow, for the note. along: the plan along a path; raises :class:`NoPlanError`.
    """
    for times in SLOWER:
        slower = path.slower(times)
        try:
            plan = along(slower)
        except NoPlanError:
            continue
        if plan.complete:
            note = f"at {_rate(path)} {joint} would turn too fast; at {_rate(slower)} it goes"
            return replace(plan, note=note)
    return None


def _rate(path: BodyPath) -> str:
    ahead, turned = path.largest_rates()
    return f"{ahead:.2g} m/s" if ahead > TURNS else f"{turned:.2g} rad/s"
