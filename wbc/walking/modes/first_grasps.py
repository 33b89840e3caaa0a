"""The first grasps: nothing is held, and the body is declared fixed until enough hands hold."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians
from typing import Any

import numpy as np

from wbc import validation
from wbc.robots import Walker
from wbc.rotations import quaternion
from wbc.validation import Array
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.loop.closed_chain import ClosedChain
from wbc.walking.loop.foresight import Foresight
from wbc.walking.loop.state import State
from wbc.walking.planner.plan import Plan
from wbc.walking.planner.replanning import plan_from_here
from wbc.walking.planner.slices import drained

#: Joints of every arm before it has held anything [rad]: hands down, well above their holds
FOLDED = tuple(radians(angle) for angle in (0.0, 105.0, -125.0, 0.0, 20.0, 0.0))


def free_state(walker: Walker, pose: Any, posture: Sequence[float] = FOLDED) -> State:
    """A body at a pose of the structure, all arms in one posture, nothing held.

    Raises:
        ShapeError, NotFiniteError, RotationError: a bad pose, or not six angles.
    """
    where = validation.pose("pose", pose)
    angles = validation.real_array("posture", posture, (6,))
    q = np.array(walker.robot.neutral)
    q[:3], q[3:7] = where.translation, quaternion(where.rotation)
    for arm in walker.arms:
        q[arm.q] = angles
    return State(q, {})


def plan_from_state(
    walker: Walker, structure: Structure, path: BodyPath, state: State, behind: Array | None = None
) -> Plan:
    """A plan for a body that stands at the beginning of a path with some hands on holds, or none.

    Args:
        behind: poses ``[n, 4, 4]`` that the body had, the last ones first: it may go back there; None: it may not.

    Raises:
        NoPlanError: there is none, or a free hand cannot be brought to where it begins.
    """
    chain = ClosedChain(walker, structure)
    chain.place(state.q)
    behind = path.poses[:1] if behind is None else behind
    may = Foresight(walker, structure).may_bring
    return drained(plan_from_here(walker, structure, path, state.held, state.q, chain, behind, may))
