"""Where the body of a walk is to be from tick to tick, and its way from plan to plan."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt

import numpy as np
import pinocchio as pin

from wbc.validation import Array
from wbc.walking.hands import Hands
from wbc.walking.plan import Plan
from wbc.walking.replanning import PlanSlices
from wbc.walking.structure import Structure
from wbc.walking.swings import SETTLE

#: From rest to the commanded speed [s]
RAMP = 0.25
#: Poses behind the body that are kept, for going back
TRAIL = 400


class MovingBody(Hands):
    """The body's command goes on along the path, as fast as asked and as slow as the hands need."""

    _planning: PlanSlices | None = None

    @property
    def travelled(self) -> float:
        """Path time since the beginning of the walk, over all its plans [s]."""
        return len(self.past) * self.plan.path.spacing + self.path_time

    def go_over(self, plan: Plan, begins: float, since: int) -> None:
        """Take a plan over another path, which agrees with the present one about where the body is.

        Args:
            plan: begins with re-grasps of the present plan from number ``since`` on; a hand that was on its way then
                is where it goes to. begins: path time at which the new path begins, a sample of it [s].
        """
        swinging, path = self.swinging, self.plan.path
        moving = swinging is not None and swinging.counted
        started = self.next + int(moving) - since
        if swinging is not None and swinging.wrist is None:
            swinging.wrist = self.grips.wrist_at(self._grip[swinging.arm], self.path_time / path.spacing)
        if swinging is not None and not started:
            swinging.counted = moving = False
        names = [arm.name for arm in self.walker.arms]
        self._used = [sum(step.arm == name for step in plan.regrasps[:started]) for name in names]
        self.next = started - int(moving)
        self.past = np.concatenate([self.past, path.poses[: round(begins / path.spacing)]])
        self.path_time -= begins
        self._go_on(plan)

    def _advance(self) -> pin.SE3:
        """Move the body's command on: as fast as asked, as slow as the grips of the holding hands need.

        Returns:
            Where the body is to be as the tick ends.
        """
        path, spacing = self.plan.path, self.plan.path.spacing
        leaving = self._leaving()
        ends = [float(self.grips.last[self._grip[arm]]) * spacing for arm in self.held if arm != leaving]
        end = path.duration if self.plan.complete else self.plan.reached
        end = end if self.leash is None else min(end, self.leash[0])
        room = max(min([end, *ends]) - self.path_time, 0.0)
        # The command stops within the room: braking from pace p takes p^2 RAMP / 2 of path time
        wanted = min(1.0, sqrt(2.0 * room / RAMP * 0.9))
        if self.swinging is not None:
            left = self.swinging.law.duration - self.swinging.clock + self.data.latch_time + SETTLE
            if room < left:
                wanted = min(wanted, room / left)
        if self._stands():
            wanted = 0.0
        change = self.dt / RAMP
        self.pace = max(self.pace + min(max(wanted - self.pace, -change), change), 0.0)
        pose = path.at(self.path_time)[0]
        self.path_time = min(self.path_time + self.pace * self.dt, path.duration)
        command = path.at(self.path_time)[0]
        turn = pose.rotation @ pin.log3(pose.rotation.T @ command.rotation)
        self.stack.body(pose, np.concatenate([command.translation - pose.translation, turn]) / self.dt)
        return command

    def _stands(self) -> bool:
        """The body is to stop, or not to move on."""
        return self._changing or self.halted or (self.swinging is not None and self.swinging.waits)

    def _stop(self) -> None:
        """The body stops, and the rest of the way is planned from there."""
        self._planning, self._changing = None, True

    def _behind(self) -> Array:
        """Poses that the body had, the last one first ``[n, 4, 4]``."""
        path, u = self.plan.path, self.path_time
        here = path.at(u)[0].homogeneous[None]
        return np.concatenate([here, path.poses[: int(u / path.spacing) + 1][::-1], self.past[::-1][:TRAIL]])[:TRAIL]

    def _renumber(self, rest: Structure) -> None:
        """Go on with a structure that has lost holds: rows of holds change, hands stay where they are."""
        old, self.structure = self.structure, rest
        self.stack.structure = rest
        self.chain = self.chain.on(rest)
        there = set(rest.ids)
        rows = np.array([rest.index(name) if name in there else -1 for name in old.ids], dtype=np.int64)
        self.held = {arm: int(rows[hold]) for arm, hold in self.held.items()}
        if self.swinging is not None:
            self.swinging.hold = int(rows[self.swinging.hold])
        self._go_on(replace(self.plan, grips=self.grips.renumbered(rows)))
