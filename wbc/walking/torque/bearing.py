"""Whether holds and motors bear the robot at rest: over a plan, and before a hand lets go."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from wbc.multibody import pin
from wbc.robots import Walker
from wbc.simulation import GripKind
from wbc.support import Lacking, lacking
from wbc.validation import Array
from wbc.walking.holds.structure import Structure
from wbc.walking.loop.stack import hold_kind
from wbc.walking.planner.plan import Plan
from wbc.walking.planner.plan_time import planned_joints, swing_times
from wbc.walking.torque.stack import TorqueStack

#: Part of the torques and of what holds bear that standing still may take; the rest is for motion
SHARE = 0.9
#: A plan is looked at so often [s], and where hands open and close
EVERY = 0.2
#: Times that are no farther apart are the same [s]: one hand lands as another one lifts
SAME = 1e-9
#: So many things that are lacking are named
NAMED = 3


class Bearing:
    """Static equilibrium of the walker on some of its hands, by :func:`wbc.support.lacking`: wrenches w of the closed
    hands within their rating, and torques within their limits, with

        g(q) = tau + J'w,     |tau| <= SHARE T,     |w| <= SHARE times the rating.

    Args:
        stack: of torques, with its gravity; its values are left alone.
    """

    def __init__(self, stack: TorqueStack) -> None:
        robot = stack.walker.robot
        self.falls = bool(np.abs(robot.model.gravity.vector).max() > 0.0)
        self._walker, self._robot = stack.walker, robot
        self._names = {arm.hand: arm.name for arm in stack.walker.arms}
        self._controller = stack.controller.clone()
        items: Any = self._controller
        items.reset(robot.neutral)
        items["torques"].torque = SHARE * robot.limits.effort[robot.base_nv :]
        self._items = {(hand, kind): items[f"{hand} {kind}"] for hand in self._names for kind in stack.kinds}
        for item in self._items.values():
            item.force, item.torque = (np.full(3, SHARE * most) for most in (stack.rating.force, stack.rating.torque))

    def lacking(self, q: Array, held: Mapping[str, GripKind]) -> tuple[Lacking, ...]:
        """What is lacking where these frames are held, the worst first; empty where nothing is, or without gravity."""
        if not self.falls:
            return ()
        for (hand, kind), item in self._items.items():
            item.enabled = held.get(hand) is kind
        return lacking(self._controller, q)

    def words(self, short: tuple[Lacking, ...], held: Iterable[str]) -> str:
        """What is lacking to stand on these frames."""
        parts = [f"{one.amount:.3g} {one.unit} of {self._whose(one)}" for one in short[:NAMED]]
        size = float(np.linalg.norm(self._robot.model.gravity.linear))
        hands = " and ".join(self._names[hand] for hand in held) or "no hand"
        return f"under {size:.3g} m/s^2 it cannot stand on {hands}: {', '.join(parts)} are lacking"

    def of_plan(self, plan: Plan, structure: Structure) -> str:
        """Where a plan first has the robot stand where holds and motors do not bear it, in words; "": nowhere.

        It is looked at where :func:`stances` says.
        """
        if not self.falls:
            return ""
        for time, q, held in stances(self._walker, plan, structure):
            short = self.lacking(q, held)
            if short:
                return f"{self.words(short, held)}, at {time:.2f} s of the plan"
        return ""

    def _whose(self, one: Lacking) -> str:
        """A motor by its joint; a hold by the hand on it, and along or about which of the hand's axes."""
        if one.item == "torques":
            return f"the motor of {one.row.rpartition('/')[2]}"
        hand, axis = one.item.partition(" ")[0], one.row.rpartition("/")[2]
        name = self._names.get(hand)
        return one.item if name is None else f"the hold of {name} ({axis})"


def stances(
    walker: Walker, plan: Plan, structure: Structure, every: float = EVERY
) -> Iterator[tuple[float, Array, dict[str, GripKind]]]:
    """Time of a plan [s], configuration, and how frames are held, wherever that changes and every so often between.

    A hand is open from the lift to the landing. Of a plan without grips and laws of its own there are none.
    """
    if plan.grips is None or not plan.complete or len(plan.laws) != len(plan.regrasps):
        return
    table, swings = planned_joints(walker, plan), swing_times(plan)
    names = [arm.name for arm in walker.arms]
    looked, before = -np.inf, dict[str, GripKind]()
    for time, at, joints in zip(table.time, table.path_time, table.joints, strict=True):
        on: dict[str, str | None] = dict(zip(names, plan.start, strict=True))
        for step, (lift, land) in zip(plan.regrasps, swings, strict=True):
            if time >= lift - SAME:
                on[step.arm] = step.target if time >= land - SAME else None
        held = {
            arm.hand: GripKind(hold_kind(structure, structure.index(hold)))
            for arm in walker.arms
            if (hold := on[arm.name]) is not None
        }
        if held.keys() != before.keys() or time >= looked + every - SAME:
            looked, before = float(time), held
            yield looked, np.concatenate([pin.SE3ToXYZQUAT(plan.path.at(float(at))[0]), joints]), held
