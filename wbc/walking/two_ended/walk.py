"""Carrying out a plan of the two-ended arm: the loop of every walk, with an arm that moves as one."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cached_property
from typing import ClassVar

import numpy as np
import pinocchio as pin

from wbc.errors import ShapeError
from wbc.robots import TwoEndedData, Walker
from wbc.validation import Array
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.loop.stack import AXIS, DT, FREE_AXIS, FREE_WRIST, WalkStack
from wbc.walking.loop.state import Swinging, Wrist
from wbc.walking.loop.stopping import Stops
from wbc.walking.loop.walk import Walk
from wbc.walking.planner.plan import NoPlanError
from wbc.walking.planner.replanning import PlanSlices
from wbc.walking.two_ended.planner import TwoEndedPlan, plan_two_ended
from wbc.walking.two_ended.swing_path import TurnLaw

#: The last part of a swing, in which the hand comes straight down and its frame counts [s]
NEAR = 2.0


class TwoEndedStack(WalkStack):
    """The stack of every walk; a swinging hand is led by all joints of its half of the arm."""

    def turn(
        self, arm: int, hand: tuple[Array, Array], joints: tuple[Array, Array], at_hold: tuple[Array, Array] | None
    ) -> None:
        """What a free hand follows: its position [m] and velocity [m/s], joints [rad] and rates [rad/s].

        Args:
            at_hold: z and x axis of the hand near its hold; None before.
        """
        swing, aligned, resting, mine = self._swings[arm], self._axes[arm], self._rest, self._joints(arm)
        near = at_hold is not None
        swing.target, swing.feedforward = hand
        if at_hold is not None:
            aligned.target, aligned.feedforward = at_hold[0], np.zeros(3)
        if self._near != (arm, near):
            aligned.weight = AXIS if near else FREE_AXIS
            self._holds.turn(arm, None if at_hold is None else at_hold[1])
            self._mask[mine] = FREE_WRIST
            resting.mask = self._mask
            self._near = arm, near
        self._posture[7:][mine], self._turning[6:][mine] = joints
        resting.target, resting.feedforward = self._posture, self._turning


class TwoEndedWalk(Walk):
    """A simulated walk of the two-ended arm; one hand holds while the other one swings.

    Args:
        walker, structure, plan: the two-ended arm, the holds, and a plan of :func:`plan_two_ended`.
        dt, backend, stack, grasps: as of :class:`wbc.walking.loop.walk.Walk`.

    Raises:
        ShapeError: another machine, or a plan without its grips.
    """

    machine: ClassVar[type] = TwoEndedData

    def __init__(
        self,
        walker: Walker,
        structure: Structure,
        plan: TwoEndedPlan,
        *,
        dt: float = DT,
        backend: str = "auto",
        stack: TwoEndedStack | None = None,
        grasps: Callable[[str, str], bool] | None = None,
    ) -> None:
        if not isinstance(plan, TwoEndedPlan):
            raise ShapeError("plan", plan, "expected a plan of plan_two_ended")
        self._to, self._gait = plan.to, plan.gait
        self._turns = stack or TwoEndedStack(walker, structure, dt, collisions=False, backend=backend)
        super().__init__(walker, structure, plan, stack=self._turns, grasps=grasps)

    def go(self, path: BodyPath) -> None:
        """Bodies follow paths; this arm goes to a hold or a place.

        Raises:
            ShapeError: always; see :meth:`go_to`.
        """
        raise ShapeError("path", path, "the two-ended arm goes to a hold or a place: go_to")

    def go_to(self, to: str | list[float], gait: str = "any") -> None:
        """Go somewhere else, from the stance that the arm comes to next."""
        self._to, self._gait = to, gait
        self._stop()

    def vanish(self, ids: Iterable[str]) -> None:
        """Take holds away; the rest is planned anew from the next stance, if the plan needs one of them.

        A hand that held one is open at once. Where a hand is in the air and its hold is gone, there is no plan.

        Raises:
            UnknownNameError: no such hold; nothing is changed.
        """
        names = list(ids)
        later = [step.target for step in self.plan.regrasps[self.next :]]
        super().vanish(names)
        if any(name in later for name in names):
            self._stop()

    def _start(self) -> Array:
        """The first configuration: the body where the path begins, the arm on its grips."""
        q = np.array(self.walker.robot.neutral)
        first = pin.SE3(self.plan.path.poses[0])
        q[:3], q[3:7] = first.translation, pin.Quaternion(first.rotation).coeffs()
        for arm, grip in zip(self.walker.arms, self._grip, strict=True):
            q[arm.q] = self.grips.posture_at(grip, 0)[: len(arm.joints)]
        return self.chain.settle(q, self.held)[0]

    def _aim(self, swinging: Swinging) -> None:
        """The hand is where the body's path has it: both are one motion of the arm."""
        arm, law = swinging.arm, swinging.law
        assert isinstance(law, TurnLaw)
        swinging.place, swinging.axis, swinging.side = (
            rows[arm] for rows in (self.chain.origins, self.chain.axes, self.chain.sides)
        )
        if swinging.state == "opening":
            swinging.latch -= self.dt
            if swinging.latch <= 1e-9:
                swinging.state = "open"
        now, before = swinging.aim, law.posture(swinging.clock)
        lifted = self.plan.regrasps[self.next].lift
        swinging.clock = min(self.path_time - lifted, law.duration)
        swinging.aim = law.at(swinging.clock)
        speed, rates = (swinging.aim.position - now.position) / self.dt, law.posture(swinging.clock) - before
        near = swinging.clock > law.duration - NEAR
        at_hold = (self.structure.axes[swinging.hold], swinging.x) if near and swinging.x is not None else None
        self._turns.turn(arm, (now.position, speed), (before, rates / self.dt), at_hold)

    def _stands(self) -> bool:
        """A hand that swings goes on to its hold, as the arm moves as one; after an abort all of it stops."""
        return self.halted or self.aborted or (self._changing and self.swinging is None)

    @property
    def still(self) -> bool:
        """The arm does not move."""
        return self.pace == 0.0

    @cached_property
    def stops(self) -> Stops:
        """Laws leave half the accelerations for a stop; the hand comes to rest with the body."""
        data, margins = self.walker.two_ended_data, self.walker.margins
        ramp = margins.swing_rate / (1.0 - margins.swing_acceleration) * data.acceleration_time
        return Stops(self.dt, ramp, ramp)

    def stopping(self) -> tuple[float, float]:
        """As of ``MovingBody.stopping``; the hand's time is the path's."""
        if self.swinging is not None:
            self.swinging.pace = self.pace
        return super().stopping()

    def _bend(self, arm: int) -> Wrist:
        """Nothing: all joints of the arm follow the law."""
        return 0.0, 0.0, 0.0

    def _replan(self) -> PlanSlices:
        """From the stance that the arm has now."""
        if len(self.held) < len(self.walker.arms):
            raise NoPlanError("hands", len(self.held), "one hand is in the air, and its hold is gone")
        start = {self.walker.arms[arm].name: self.structure.ids[hold] for arm, hold in self.held.items()}
        return _at_once(plan_two_ended(self.walker, self.structure, start, self._to, gait=self._gait))


def _at_once(plan: TwoEndedPlan) -> PlanSlices:
    """A plan as slices: none, and the plan."""
    yield None
    return plan
