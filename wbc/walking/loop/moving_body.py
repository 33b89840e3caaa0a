"""Where the body of a walk is to be from tick to tick, and its way from plan to plan."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from math import sqrt

import numpy as np

from wbc.validation import Array
from wbc.walking.holds.structure import Structure
from wbc.walking.loop.hands import Hands
from wbc.walking.loop.stopping import Stops
from wbc.walking.planner.plan import Plan
from wbc.walking.planner.replanning import PlanSlices
from wbc.walking.planner.swings.swings import SETTLE

#: From rest to the commanded speed [s]; back, where hands would lose their holds, as of :class:`Stops`
RAMP = 0.5
#: A hand may land so much path time later than planned [s]
LATE = 0.2
#: Poses behind the body that are kept, for going back
TRAIL = 400


class MovingBody(Hands):
    """The body's command goes on along the path, as fast as asked and as slow as the hands need."""

    _planning: PlanSlices | None = None

    @cached_property
    def stops(self) -> Stops:
        """How fast body and hand come to rest."""
        return Stops(self.dt)

    @property
    def travelled(self) -> float:
        """Path time since the beginning of the walk, over all its plans [s]."""
        return len(self.past) * self.plan.path.spacing + self.path_time

    @property
    def still(self) -> bool:
        """Neither the body nor a hand moves as it is told."""
        swinging = self.swinging
        return self.pace == 0.0 and (swinging is None or (swinging.state == "open" and swinging.pace == 0.0))

    def abort(self) -> None:
        """Stop: the body and the hand in the air slow down along their ways; nothing is lifted, nothing planned."""
        self.aborted = True
        if self.swinging is not None and self.swinging.state == "opening":
            self.swinging.pace = 0.0

    def carry_on(self) -> None:
        """Go on after an abort."""
        self.aborted = False

    def stopping(self) -> tuple[float, float]:
        """How far the body's origin and the hand in the air can travel after an abort now [m].

        What :mod:`wbc.walking.loop.stopping` says of the places and paces that they have now.
        """
        path, u = self.plan.path, self.path_time
        off = float(np.linalg.norm(self.q[:3] - path.at(u)[0].translation))
        body = float(self.stops.of_body(path.poses[:, :3, 3], path.spacing, np.array(u), self.pace, off))
        swinging = self.swinging
        if swinging is None:
            return body, 0.0
        law, pace = swinging.law, swinging.pace if swinging.state == "open" else 0.0
        gap = float(np.linalg.norm(swinging.aim.position - self.chain.origins[swinging.arm]))
        return body, float(self.stops.of_hand(law.places, law.spacing, np.array(swinging.clock), pace, gap))

    def _move(self) -> float:
        """The robot moves by its joint rates for a tick, and by nothing else; the worst slip of a held hand [m]."""
        if not self.fixed:
            self.q, slip = self.chain.move(self.q, self.v, self.dt, self.held)
            return slip
        joints = self.q.copy()
        joints[7:] += self.v[6:] * self.dt
        self.v[:6] = 0.0
        self.q = joints
        self.chain.place(joints)
        return self.chain.slip(self.held)

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

    def _advance(self) -> Array:
        """Move the body's command on: as fast as asked, as slow as the grips of the holding hands need.

        Returns:
            Where the body is to be as the tick ends: position [m] and quaternion x, y, z, w.
        """
        plan, path, grips, brake = self.plan, self.plan.path, self._grip, self.stops.brake
        leaving, lasts = self._leaving(), self.grips.ends_at(path.spacing)
        end = path.duration if plan.complete else plan.reached
        end = end if self.leash is None else min(end, self.leash[0])
        if self.approve is not None and self.swinging is None and self.next < len(plan.regrasps):
            end = min(end, plan.regrasps[self.next].lift)
        soonest = min([end, *[lasts[grips[arm]] for arm in self.held if arm != leaving]])
        room, left = max(soonest - self.path_time, 0.0), max(end - self.path_time, 0.0)
        # The command stops within the room: braking from pace p in a time T takes p^2 T / 2 of path time
        wanted = min(1.0, sqrt(2.0 * room / brake * 0.9), sqrt(2.0 * left / RAMP * 0.9))
        if self.swinging is not None:
            needed = self.swinging.law.duration - self.swinging.clock + self.data.latch_time + SETTLE
            if self.swinging.counted and not self._changing:
                # A hand that is late makes the body late too: the next ones then swing where they were planned to
                room = min(room, max(plan.regrasps[self.next].land + LATE - self.path_time, 0.0))
            if room < needed:
                wanted = min(wanted, room / needed)
        if self._stands():
            wanted = 0.0
        self.wanted = wanted
        self.pace = max(self.pace + min(max(wanted - self.pace, -self.dt / brake), self.dt / RAMP), 0.0)
        begin = self.path_time
        self.path_time = min(begin + self.pace * self.dt, path.duration)
        self.stack.body(self.command.go(path, begin, self.path_time))
        return self.command.pose

    def _stands(self) -> bool:
        """The body is to stop, or not to move on."""
        return self._changing or self.halted or self.aborted or (self.swinging is not None and self.swinging.waits)

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
