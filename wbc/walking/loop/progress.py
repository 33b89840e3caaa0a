"""How far a plan has been carried out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wbc.errors import ShapeError
from wbc.multibody import pin
from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.loop.state import Swinging
from wbc.walking.planner.grips.table import Grips
from wbc.walking.planner.plan import Plan, Regrasp

#: Poses behind the body that are remembered, for going back
TRAIL = 400


class PlanProgress:
    """The place of a walk in its plan, also where one plan takes the place of another.

    Attributes:
        plan, grips: what is carried out now; path times count from its beginning.
        path_time: of the body [s]. next: number of the re-grasp that is lifted or landed next.
        grip: the one that each arm has, or has left.
        steps: re-grasps that were begun, over the path time of the whole walk.
        past: poses behind the beginning of the plan's path ``[n, 4, 4]``, at its spacing.

    Raises:
        ShapeError: a plan that was read from a file, without its grips.
    """

    def __init__(self, walker: Walker, plan: Plan) -> None:
        self.walker = walker
        self.names = [arm.name for arm in walker.arms]
        self.plan, self.past = plan, np.zeros((0, 4, 4))
        self.grips: Grips
        self.grip: list[int] = []
        self.steps: list[Regrasp] = []
        self.path_time, self.next = 0.0, 0
        self._begin(plan, None)

    @property
    def travelled(self) -> float:
        """Path time since the beginning of the walk, over all its plans [s]."""
        return len(self.past) * self.plan.path.spacing + self.path_time

    @property
    def sample(self) -> float:
        """Of the plan's path, where the body is."""
        return self.path_time / self.plan.path.spacing

    @property
    def pose(self) -> pin.SE3:
        """That the path has now."""
        return self.plan.path.at(self.path_time)[0]

    @property
    def step(self) -> Regrasp | None:
        """The re-grasp that is lifted or landed next; None: there is none left."""
        steps = self.plan.regrasps
        return steps[self.next] if self.next < len(steps) else None

    def arm_of(self, step: Regrasp) -> int:
        """The row of the arm that a re-grasp moves."""
        return self.names.index(step.arm)

    def behind(self) -> Array:
        """Poses that the body had, the last one first ``[n, 4, 4]``."""
        path, here = self.plan.path, self.pose.homogeneous[None]
        done = path.poses[: int(self.path_time / path.spacing) + 1]
        return np.concatenate([here, done[::-1], self.past[::-1][:TRAIL]])[:TRAIL]

    def next_grip(self, arm: int) -> int:
        """The grip that the hand of the next re-grasp goes to."""
        return self.plan.chain[arm][self._used[arm] + 1]

    def lift(self, arm: int) -> None:
        """The next re-grasp begins."""
        step, before = self.plan.regrasps[self.next], len(self.past) * self.plan.path.spacing
        self._used[arm] += 1
        self.steps.append(replace(step, lift=step.lift + before, land=step.land + before, until=step.until + before))

    def land(self, swinging: Swinging) -> None:
        """A hand holds what it went to."""
        self.grip[swinging.arm] = swinging.grip
        self.next += int(swinging.counted)

    def take(self, plan: Plan, swinging: Swinging | None) -> None:
        """Go on with a plan that is what was done so far, and more, or begin one of another path.

        Args:
            swinging: the swinging hand.
        """
        path = self.plan.path
        if plan.path is path:
            self.go_on(plan, swinging)
            return
        self.past = np.concatenate([self.past, path.poses[: round(self.path_time / path.spacing)]])
        self._begin(plan, swinging)

    def go_over(self, plan: Plan, begins: float, since: int, swinging: Swinging | None) -> None:
        """Take a plan over another path, which agrees with the present one about where the body is.

        Args:
            plan: begins with re-grasps of the present plan from number ``since`` on; a hand that was swinging then
                is where it goes to. begins: path time at which the new path begins, a sample of it [s].
        """
        path, moving = self.plan.path, swinging is not None and swinging.counted
        started = self.next + int(moving) - since
        if swinging is not None and swinging.first_wrist is None:
            swinging.first_wrist = self.grips.wrist_at(self.grip[swinging.arm], self.sample)
        if swinging is not None and not started:
            swinging.counted = moving = False
        self._used = [sum(step.arm == name for step in plan.regrasps[:started]) for name in self.names]
        self.next = started - int(moving)
        self.past = np.concatenate([self.past, path.poses[: round(begins / path.spacing)]])
        self.path_time -= begins
        self.go_on(plan, swinging)

    def go_on(self, plan: Plan, swinging: Swinging | None) -> None:
        """Take a plan that is what was done so far, and more; its grips may be numbered anew."""
        if plan.grips is None:
            raise ShapeError("plan", plan, "expected a plan of the planner")
        self.plan, self.grips = plan, plan.grips
        for arm, chain in enumerate(plan.chain):
            if swinging is None or swinging.arm != arm:
                self.grip[arm] = chain[self._used[arm]]
            else:
                swinging.grip = chain[self._used[arm]]
                self.grip[arm] = chain[self._used[arm] - int(swinging.counted)]

    def renumber(self, rows: NDArray[np.int64], swinging: Swinging | None) -> None:
        """Rows of holds change; those that are gone are -1 in ``rows``."""
        self.go_on(replace(self.plan, grips=self.grips.renumbered(rows)), swinging)

    def _begin(self, plan: Plan, swinging: Swinging | None) -> None:
        self.next, self._used, self.path_time = 0, [0] * len(self.names), 0.0
        self.grip = [chain[0] for chain in plan.chain]
        self.go_on(plan, swinging)
