"""Carrying out a plan of the two-ended arm: the loop of every walk, with an arm that moves as one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import ShapeError
from wbc.multibody import pin
from wbc.robots import Walker
from wbc.rotations import quaternion
from wbc.simulation import Plant
from wbc.validation import Array
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.loop.foresight import Foresight
from wbc.walking.loop.machine import Machine
from wbc.walking.loop.progress import PlanProgress
from wbc.walking.loop.stack import AXIS, DT, FREE_AXIS, FREE_WRIST, WalkStack
from wbc.walking.loop.state import State, Swinging, Wrist
from wbc.walking.loop.stopping import Stops
from wbc.walking.loop.walk import Walk
from wbc.walking.planner.plan import NoPlanError
from wbc.walking.planner.replanning import PlanSlices
from wbc.walking.two_ended.planner import TwoEndedPlan, plan_from_air, plan_two_ended
from wbc.walking.two_ended.postures import Grip, from_hand_to_hand
from wbc.walking.two_ended.search import GAITS
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


class TurnLeader:
    """Leads the swinging hand of the two-ended arm: it is where the body's path has it, as both are one motion.

    Raises:
        ShapeError: another machine.
    """

    one_motion, late = True, 0.2

    def __init__(self, machine: Machine, progress: PlanProgress, stack: TwoEndedStack) -> None:
        data, margins = machine.walker.two_ended_data, machine.walker.margins
        self._machine, self._progress, self._stack = machine, progress, stack
        # Laws leave half the accelerations for a stop; the hand comes to rest with the body
        ramp = margins.swing_rate / (1.0 - margins.swing_acceleration) * data.acceleration_time
        self.stops = Stops(machine.dt, ramp, ramp)

    def first(self) -> Array:
        """The body where the path begins, the arm on its grips, and then where the held hands have it."""
        machine, progress = self._machine, self._progress
        q, begin = np.array(machine.walker.robot.neutral), pin.SE3(progress.plan.path.poses[0])
        q[:3], q[3:7] = begin.translation, quaternion(begin.rotation)
        for arm, grip in zip(machine.walker.arms, progress.grip, strict=True):
            q[arm.q] = progress.grips.posture_at(grip, 0)[: len(arm.joints)]
        return machine.chain.settle(q, machine.held)[0]

    def wrist(self, arm: int) -> Wrist:
        """Nothing: all joints of the arm follow the law."""
        return 0.0, 0.0, 0.0

    def lead(self, swinging: Swinging, early: float, pace: float, aborted: bool) -> None:
        """To the body's path time; near its hold the hand's frame counts."""
        machine, progress, arm, law = self._machine, self._progress, swinging.arm, swinging.law
        assert isinstance(law, TurnLaw)
        swinging.place, swinging.axis, swinging.x_axis = machine.hand(arm)
        if swinging.state == "opening":
            swinging.open_on(machine.dt)
        now, before = swinging.aim, law.posture(swinging.clock)
        lifted = progress.plan.regrasps[progress.next].lift
        dt, clock = machine.dt, min(progress.path_time - lifted, law.duration)
        swinging.clock, swinging.pace = clock, (clock - swinging.clock) / dt
        swinging.aim = law.at(clock)
        speed, rates = (swinging.aim.position - now.position) / dt, law.posture(swinging.clock) - before
        near = clock > law.duration - NEAR and not swinging.dropped
        at_hold = (machine.structure.axes[swinging.hold], swinging.x) if near and swinging.x is not None else None
        self._stack.turn(arm, (now.position, speed), (before, rates / dt), at_hold)


class TurnReplanner:
    """Plans from the stance that the arm comes to next, to a hold or a point.

    Args:
        to, gait: of :func:`wbc.walking.two_ended.planner.plan_two_ended`.
    """

    def __init__(self, machine: Machine, progress: PlanProgress, to: str | Sequence[float], gait: str) -> None:
        self._machine, self._progress, self._to, self.gait = machine, progress, to, gait
        self.sight: Foresight | None = None

    def go(self, goal: Any) -> None:
        """To a hold, so that the elbow is near a point [m], or near the end of a body's path."""
        structure = self._machine.structure
        if isinstance(goal, BodyPath):
            goal = goal.poses[-1][:3, 3]
        if isinstance(goal, str):
            structure.index(goal)
            self._to = goal
        else:
            self._to = validation.real_array("to", goal, (3,)).tolist()

    def stand(self) -> None:
        """The arm stands on both hands only: it goes on to its goal."""

    def from_stance(self, wanted: bool) -> None:
        """Every plan of this arm begins with a stance."""

    def rest(self) -> PlanSlices:
        """From the stance that the arm has now, or from where a hand is in the air."""
        machine, progress, to = self._machine, self._progress, self._to
        walker, structure, held = machine.walker, machine.structure, machine.held
        if isinstance(to, str) and to not in structure.ids:
            raise NoPlanError("to", to, "the hold that a hand was to come to is gone")
        grips = [Grip(held.get(k, -1), int(progress.grips.roll[grip])) for k, grip in enumerate(progress.grip)]
        if len(held) == len(walker.arms):
            start = {arm.name: structure.ids[grip.hold] for arm, grip in zip(walker.arms, grips, strict=True)}
            rolls = grips[0].roll, grips[1].roll
            return _at_once(plan_two_ended(walker, structure, start, to, gait=self.gait, rolls=rolls))
        ((arm, _),) = held.items()
        steps, name = progress.steps, walker.arms[1 - arm].name
        left = steps[-1].source if steps and steps[-1].arm == name else ""
        joints = from_hand_to_hand(*(machine.q[one.q] for one in walker.arms))
        return _at_once(plan_from_air(walker, structure, (arm, grips[arm]), joints, to, gait=self.gait, left=left))

    def without(self, kept: int) -> PlanSlices | None:
        """The arm stops at its next stance."""
        return None

    def taken(self) -> None:
        """The goal stays."""


class TwoEndedWalk(Walk):
    """A walk of the two-ended arm; one hand holds while the other one swings. Where a hand is in the air and its hold
    vanishes, the arm comes to rest on its way, and the hand goes to another one.

    Args:
        walker, structure, plan: the two-ended arm, the holds, and a plan of :func:`plan_two_ended`.
        dt, backend, stack, grasps, plant, state: as of :class:`wbc.walking.loop.walk.Walk`.

    Raises:
        ShapeError: another machine, or a plan without its grips; of a plant as ``Walk``.
    """

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
        plant: Plant | None = None,
        state: State | None = None,
    ) -> None:
        if not isinstance(plan, TwoEndedPlan):
            raise ShapeError("plan", plan, "expected a plan of plan_two_ended")
        stack = stack or TwoEndedStack(walker, structure, dt, collisions=False, backend=backend)

        def replanner(machine: Machine, progress: PlanProgress) -> TurnReplanner:
            self._turns = TurnReplanner(machine, progress, plan.to, plan.gait)
            return self._turns

        def leader(machine: Machine, progress: PlanProgress, _: WalkStack) -> TurnLeader:
            return TurnLeader(machine, progress, stack)

        if state is not None:
            # It goes on with its velocity, see go_on
            state = replace(state, v=None)
        more: dict[str, Any] = {"stack": stack, "grasps": grasps, "plant": plant, "state": state}
        super().__init__(walker, structure, plan, leader=leader, replanner=replanner, **more)

    def go_on(self, arm: int | None, state: State) -> None:
        """Go on from the middle of the plan's first swing, as fast as it was going.

        Args:
            arm: row of the arm that swings; None: both hands hold, and nothing moves. state: with its velocity.
        """
        if arm is None:
            return
        step, law, joints = self.plan.regrasps[0], self.plan.laws[0], self.walker.arms[arm]
        assert isinstance(law, TurnLaw)
        v = np.zeros(len(state.q) - 1) if state.v is None else state.v
        clock, pace = law.found(state.q[joints.q], v[joints.v])
        opens, progress = state.opening is not None, self.progress
        more: dict[str, Any] = {} if opens else {"clock": clock, "state": "open", "latch": 0.0}
        swinging = self._next_swing(step, **more)
        swinging.place, swinging.axis, swinging.x_axis = self.machine.hand(arm)
        progress.path_time = step.lift + swinging.clock
        progress.lift(arm)
        self.hands.swinging = swinging
        self.body.pace, self.machine.v = (0.0, self.machine.v) if opens else (pace, v.copy())

    def _bring(self, arm: int) -> None:
        """A hand in the air goes to its hold by the first swing of the plan."""
        step = self._may_lift()
        if step is None or self.path_time < step.lift - 1e-9:
            return
        swinging = self._next_swing(step, state="open", latch=0.0)
        self.progress.lift(arm)
        self.hands.swinging = swinging

    def go_to(self, to: str | Sequence[float], gait: str = "any") -> None:
        """Go somewhere else, from the stance that the arm comes to next: to a hold, or with the elbow to a point [m].

        :meth:`go` does so with the gait that there is, and takes a body's path, too, whose end is then the place.

        Raises:
            UnknownNameError: no such hold or gait. ShapeError, NotFiniteError: no place. Nothing is changed.
        """
        validation.one_of("gait", gait, tuple(GAITS))
        self.go(to)
        self._turns.gait = gait


def _at_once(plan: TwoEndedPlan) -> PlanSlices:
    """A plan as slices: none, and the plan."""
    yield None
    return plan
