"""What the hands of a walk do: lift, swing, close, hold, or wait in the air."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from dataclasses import replace
from math import dist
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin

from wbc.errors import ShapeError
from wbc.robots import Walker, WalkerData
from wbc.validation import Array
from wbc.walking.holds.structure import Structure
from wbc.walking.loop.body_command import BodyCommand
from wbc.walking.loop.closed_chain import ClosedChain
from wbc.walking.loop.hand_command import HandCommand
from wbc.walking.loop.hand_landing import UPRIGHT, HandLanding
from wbc.walking.loop.hand_pace import HAND_RAMP, HAND_STOP, LANDING, at_rest, hand_pace, turned
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.state import Event, Hand, State, Swinging, What, Wrist
from wbc.walking.planner.grips.rolls import ANY, frame_on
from wbc.walking.planner.plan import HoldLost, Plan, Regrasp
from wbc.walking.planner.replanning import way_to
from wbc.walking.planner.swings.law import SwingLaw
from wbc.walking.planner.swings.swings import SETTLE

#: A hold that could not be grasped so many times is taken as vanished
TRIES = 3


class Hands(ABC):
    """The hands of a walking body: which hold, which one is on its way, and their part of the stack.

    Attributes:
        plan: the one that is carried out now; path times count from its beginning.
        held: row of the arm -> row of the hold. swinging: the hand on its way.
        told: arm, state and hold of a hand that does what it is told, see :mod:`wbc.walking.modes.arm_mode`.
        halted: the body stands, and no hand is lifted. aborted: no hand moves either.
        fixed: fewer hands hold than the body needs, and have since the beginning: it is declared fixed.
        opens: row of an arm that was opening at the beginning, and of its hold; None: none was.
        approve: asked before every lift; the body waits at the lift until it says yes. None: nobody is asked.
        leash: path time that the body does not pass, and how many re-grasps of the plan may be lifted; None: all of it.
        steps: re-grasps that were begun, over the path time of the whole walk.
        past: poses behind the beginning of the plan's path ``[n, 4, 4]``, at its spacing.
        events: what happened so far.
    """

    #: Data of the machines that it is for
    machine: ClassVar[type] = WalkerData

    def __init__(
        self,
        walker: Walker,
        structure: Structure,
        plan: Plan,
        stack: WalkStack,
        grasps: Callable[[str, str], bool] | None,
        state: State | None = None,
    ) -> None:
        if plan.grips is None or not isinstance(walker.data, self.machine):
            raise ShapeError("plan", plan, f"expected a plan of the planner, of a machine with {self.machine.__name__}")
        self.walker, self.structure, self.stack, self.dt = walker, structure, stack, stack.dt
        self.data = walker.tolerances
        self.stack.structure = structure
        self.chain, self.command = ClosedChain(walker, structure), BodyCommand(self.dt)
        self._hand, self._landing, self._arms = HandCommand(self.dt), HandLanding(self.dt), range(len(walker.arms))
        self.grasps = grasps or (lambda _arm, _hold: True)
        self.time, self.path_time, self.pace, self.wanted = 0.0 if state is None else state.time, 0.0, 0.0, 1.0
        self.events: list[Event] = []
        self.swinging: Swinging | None = None
        self.told: tuple[int, Hand, int] | None = None
        self.v = np.zeros(walker.robot.nv)
        self._changing = False
        self.halted = self.aborted = False
        self.approve: Callable[[Regrasp], bool] | None = None
        self.leash: tuple[float, int] | None = None
        self.steps: list[Regrasp] = []
        self.past = np.zeros((0, 4, 4))
        self._landed = (-1, 0.0)
        self._begin(plan)
        if state is None:
            self.held = {arm: int(self.grips.hold[grip]) for arm, grip in enumerate(self._grip)}
            self.q = self._start()
        else:
            self.held, self.q = dict(state.held), state.q.copy()
        self.opens = None if state is None else state.opening
        self.fixed = len(self.held) < walker.min_holds
        if self.fixed:
            self.chain.place(self.q)
        else:
            self.q = self.chain.settle(self.q, self.held)[0]
        for arm in range(len(walker.arms)):
            if arm in self.held:
                self.stack.hold(arm, self.held[arm], int(self.grips.roll[self._grip[arm]]))
            else:
                self.stack.release(arm)
                self._stay(arm)

    @abstractmethod
    def vanish(self, ids: Iterable[str]) -> None:
        """Holds are gone."""

    def _follow(self, plan: Plan) -> None:
        """Take a plan from its beginning."""
        path = self.plan.path
        self.past = np.concatenate([self.past, path.poses[: round(self.path_time / path.spacing)]])
        self._begin(plan)

    def _begin(self, plan: Plan) -> None:
        """From the beginning of a plan."""
        self.next, self._used, self.path_time = 0, [0] * len(self.walker.arms), 0.0
        self._grip = [chain[0] for chain in plan.chain]
        self._go_on(plan)

    def _go_on(self, plan: Plan) -> None:
        """Take a plan that is what was done so far, and more; its grips may be numbered anew."""
        if plan.grips is None:
            raise ShapeError("plan", plan, "expected a plan of the planner")
        self.plan, self.grips = plan, plan.grips
        for arm, chain in enumerate(plan.chain):
            if self.swinging is None or self.swinging.arm != arm:
                self._grip[arm] = chain[self._used[arm]]
            else:
                self.swinging.grip = chain[self._used[arm]]
                self._grip[arm] = chain[self._used[arm] - int(self.swinging.counted)]

    def _start(self) -> Array:
        """The first configuration: the body where the path begins, the arms on their grips."""
        q = np.array(self.walker.robot.neutral)
        first = pin.SE3(self.plan.path.poses[0])
        q[:3], q[3:7] = first.translation, pin.Quaternion(first.rotation).coeffs()
        for arm, grip in enumerate(self._grip):
            q[self.walker.arms[arm].q] = self.grips.posture(np.array(grip), np.array(0))
        return q

    def _lift(self) -> None:
        """Send a free hand to its hold, or open that of the next re-grasp when the body is where the plan lifts it."""
        if self.swinging is not None or self._changing:
            return
        free = [arm for arm in range(len(self.walker.arms)) if arm not in self.held]
        if free:
            self._bring(free[0])
            return
        last = len(self.plan.regrasps) if self.leash is None else min(self.leash[1], len(self.plan.regrasps))
        if self.halted or self.next >= last:
            return
        if self.path_time < self.plan.regrasps[self.next].lift - 1e-9:
            return
        if len(self.held) <= self.walker.min_holds:
            raise HoldLost("hands", len(self.held), f"more than {self.walker.min_holds} must hold before one is lifted")
        step = self.plan.regrasps[self.next]
        if self.approve is not None and not self.approve(step):
            return
        arm = [a.name for a in self.walker.arms].index(step.arm)
        if self._landed == (arm, self.time):
            return  # A hand that goes on at once is closed for a tick
        self._used[arm] += 1
        self._open(arm)
        law, target = self.plan.laws[self.next], self.plan.chain[arm][self._used[arm]]
        self.swinging = self._swing(arm, target, law, latch=self.data.latch_time)
        self.swinging.bend = self._bend(arm)
        self._say("lift", step.arm, step.source)
        before = len(self.past) * self.plan.path.spacing
        self.steps.append(replace(step, lift=step.lift + before, land=step.land + before, until=step.until + before))

    def _bring(self, arm: int) -> None:
        """A hand that is in the air goes to where the plan begins, while the body stands still."""
        _, _, _, a, b, c = self.q[self.walker.arms[arm].q].tolist()
        law = way_to(self.walker, self.structure, self.plan, arm, self.chain, self.q)
        self.swinging = self._swing(
            arm, self._grip[arm], law, latch=0.0, counted=False, waits=True, state="open", wrist=(a, b, c)
        )
        self.swinging.bend = a, b, c

    def _swing(self, arm: int, grip: int, law: SwingLaw, **more: Any) -> Swinging:
        """A hand that begins to go to a grip."""
        hold, roll = int(self.grips.hold[grip]), int(self.grips.roll[grip])
        x = None if roll == ANY else frame_on(self.structure, hold, roll)[:3, 0]
        return Swinging(arm, hold, grip, law, x=x, **more)

    def _aim(self, swinging: Swinging) -> None:
        """Move the aim of the hand on, as fast as the hand follows, and tell the stack."""
        arm = swinging.arm
        place = self.chain.origins[arm]
        swinging.place, swinging.axis, swinging.side = place, self.chain.axes[arm], self.chain.sides[arm]
        # On the wrong side of theta5 = 0 the wrist cannot align the hand: it turns to its branch before the hand lands
        at_branch = turned(swinging, self.q[self.walker.arms[arm].q].tolist()[3:])
        if swinging.state == "opening":
            swinging.latch -= self.dt
            if swinging.latch <= 1e-9:
                swinging.state = "open"
        elif swinging.state == "open":
            wanted = hand_pace(swinging, place, at_branch, self._due(swinging) - self.path_time, self.wanted)
            wanted, change = (0.0, self.dt / HAND_STOP) if self.aborted else (wanted, self.dt / HAND_RAMP)
            swinging.pace += min(max(wanted - swinging.pace, -change), change)
            swinging.clock = min(swinging.clock + swinging.pace * self.dt, swinging.law.duration)
        sample = self.path_time / self.plan.path.spacing
        followed = self._hand.go(swinging, place, self.grips, self._grip[arm], sample)
        hold = self.structure.positions[swinging.hold], self.structure.axes[swinging.hold]
        near = swinging.aim.blend > LANDING and at_branch and dist(swinging.aim.position, hold[0]) < UPRIGHT
        self.stack.swing(arm, followed, self._landing.go(swinging, hold, near))

    def _give_up(self) -> None:
        """A hand whose hold is out of reach from where the body stopped stays in the air, until there is a plan."""
        swinging = self.swinging
        if swinging is None or not swinging.counted or swinging.state != "open":
            return
        if self.path_time < float(self.grips.first[swinging.grip]) * self.plan.path.spacing:
            self._stay(swinging.arm)
            self.swinging = None

    def _due(self, swinging: Swinging) -> float:
        """Path time at which a hand is to be on its hold [s]: the plan's; as soon as possible where the body stops."""
        soonest = float(self.grips.first[swinging.grip]) * self.plan.path.spacing
        if self._changing or self.halted or not swinging.counted:
            return soonest
        due = self.plan.regrasps[self.next].land - self.data.latch_time - SETTLE
        return due if self.leash is None else max(min(due, self.leash[0]), soonest)

    def _bend(self, arm: int) -> Wrist:
        """Joints 4 to 6 of an arm as its grip has them where the body is now."""
        return self.grips.wrist_at(self._grip[arm], self.path_time / self.plan.path.spacing)

    def _leaving(self) -> int:
        """The arm that is lifted next, if it can be: its grip is no end for the body. -1 for none."""
        last = len(self.plan.regrasps) if self.leash is None else min(self.leash[1], len(self.plan.regrasps))
        if self._changing or self.halted or self.swinging is not None or self.next >= last:
            return -1
        return [arm.name for arm in self.walker.arms].index(self.plan.regrasps[self.next].arm)

    def _land(self, swinging: Swinging) -> None:
        """Close a hand that has come to rest on its hold; it holds when the latch is through."""
        arm, hold = swinging.arm, swinging.hold
        if swinging.state == "open" and swinging.clock >= swinging.law.duration - 1e-9:
            if self.rests(arm, hold, (swinging.place, swinging.axis, swinging.side), swinging.x):
                swinging.state, swinging.latch = "closing", self.data.latch_time
        elif swinging.state == "closing":
            swinging.latch -= self.dt
            if swinging.latch <= 1e-9:
                self._grasp(swinging)

    def rests(self, arm: int, hold: int, before: tuple[Array, Array, Array], x: Array | None) -> bool:
        """Whether a hand is on a hold and still; ``before`` as of :func:`at_rest`."""
        hand = self.chain.origins[arm], self.chain.axes[arm], self.chain.sides[arm]
        there = self.structure.positions[hold], self.structure.axes[hold]
        return at_rest(before, hand, there, x, self.structure.tilts[hold], self.data, self.dt)

    def _grasp(self, swinging: Swinging) -> None:
        """The latch is through: the hand holds, or it has missed and tries again."""
        arm, names = swinging.arm, (self.walker.arms[swinging.arm].name, self.structure.ids[swinging.hold])
        if not self.grasps(*names):
            swinging.tries += 1
            swinging.state = "open"
            self._say("failed", *names)
            if swinging.tries >= TRIES:
                self.vanish([names[1]])
            return
        self.held[arm], self._grip[arm] = swinging.hold, swinging.grip
        self.fixed = self.fixed and len(self.held) < self.walker.min_holds
        self._landed = arm, self.time
        self.stack.hold(arm, swinging.hold, int(self.grips.roll[swinging.grip]))
        self.swinging = None
        self.next += int(swinging.counted)
        self._say("land", *names)

    def _open(self, arm: int) -> None:
        del self.held[arm]
        self.stack.release(arm)
        self._stay(arm)

    def _stay(self, arm: int) -> None:
        """A hand in the air waits where it is."""
        self.stack.rest(arm, self.chain.origins[arm], self.chain.axes[arm])

    def _say(self, what: What, arm: str, hold: str) -> None:
        self.events.append(Event(self.time, what, arm, hold, self.path_time))

    def _hands(self) -> tuple[Hand, ...]:
        held = self.held
        out: list[Hand] = ["closed" if arm in held else "open" for arm in self._arms]
        if self.swinging is not None:
            out[self.swinging.arm] = self.swinging.state
        if self.told is not None:
            out[self.told[0]] = self.told[1]
        return tuple(out)

    def _holds(self) -> tuple[int, ...]:
        held = self.held
        out = [held.get(arm, -1) for arm in self._arms]
        if self.swinging is not None:
            out[self.swinging.arm] = self.swinging.hold
        if self.told is not None:
            out[self.told[0]] = self.told[2]
        return tuple(out)
