"""Carrying out a plan: the loop of controller, hands and simulated robot."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from math import dist, sqrt
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.errors import ShapeError
from wbc.robots import Walker, WalkerData
from wbc.validation import Array
from wbc.walking.body_path import BodyPath, straight_path
from wbc.walking.closed_chain import ClosedChain
from wbc.walking.plan import HoldLost, NoPlanError, Plan
from wbc.walking.replanning import plan_from_here, way_to
from wbc.walking.stance_search import Move
from wbc.walking.structure import Structure
from wbc.walking.swing_law import SwingLaw
from wbc.walking.swings import Swings
from wbc.walking.walk_hands import BEHIND, HAND_RAMP, LANDING, LIFTING, TURNED, at_rest, hand_pace
from wbc.walking.walk_stack import DT, WalkStack
from wbc.walking.walk_state import Event, Hand, Swinging, Tick, What

__all__ = ["Event", "Hand", "Tick", "Walk"]

#: From rest to the commanded speed [s]
RAMP = 0.5
#: The walk is over when the body is this near to the end of the path [m]
ARRIVED = 0.002
#: A walk that takes this many times its path's duration and SLACK seconds more is given up
PATIENCE, SLACK = 4.0, 20.0
#: A new plan begins with a body that stands for so many samples
STANDING = 10
#: Speed on the way to another path [m/s]
JOINING = 0.05
#: A hold that could not be grasped so many times is taken as vanished
TRIES = 3


class Walk:
    """A simulated walk. The simulator's only inputs are the joint rates that the controller returns; where the body is
    follows from the holds of its closed hands.

    Args:
        walker, structure, plan: what walks where.
        collisions, backend: see :class:`WalkStack`. stack: a compiled one, of the same walker.
        grasps: (arm, hold) -> whether the hand's latch closes; default: always.

    Attributes:
        plan: the one that is carried out now; path times count from its beginning.
        events: what happened so far.

    Raises:
        ShapeError: a plan that was read from a file, without its grips.
    """

    def __init__(
        self,
        walker: Walker,
        structure: Structure,
        plan: Plan,
        *,
        dt: float = DT,
        collisions: bool = False,
        backend: str = "auto",
        stack: WalkStack | None = None,
        grasps: Callable[[str, str], bool] | None = None,
    ) -> None:
        if plan.grips is None or not isinstance(walker.data, WalkerData):
            raise ShapeError("plan", plan, "expected a plan of the planner for a body with arms")
        self.walker, self.structure, self.dt, self.data = walker, structure, dt, walker.data
        self.stack = stack or WalkStack(walker, structure, dt, collisions=collisions, backend=backend)
        self.stack.structure = structure
        self.chain = ClosedChain(walker, structure)
        self.grasps = grasps or (lambda _arm, _hold: True)
        self.time, self.path_time, self.pace = 0.0, 0.0, 0.0
        self.events: list[Event] = []
        self.swinging: Swinging | None = None
        self.held: dict[int, int] = {}
        self.v = np.zeros(walker.robot.nv)
        self._follow(plan)
        self.held = {arm: int(self.grips.hold[grip]) for arm, grip in enumerate(self._grip)}
        self.q = self._start()
        self._wanted: BodyPath | None = None
        self._changing = False
        for arm, hold in self.held.items():
            self.stack.hold(arm, hold)

    @property
    def done(self) -> bool:
        """The body is at the end of the path, and no hand is on its way."""
        ended = self.path_time >= self.plan.path.duration - 1e-9 and self.swinging is None and not self._changing
        if not ended or self._next < len(self.plan.regrasps):
            return False
        return dist(self.q[:3], self.plan.path.poses[-1][:3, 3]) < ARRIVED

    def run(self, on_tick: Callable[[Tick], Any] | None = None) -> str:
        """Ticks until the walk is done or given up.

        Returns:
            "arrived", or "late" when it takes more than four times as long as the path.

        Raises:
            HoldLost, NoPlanError: as of :meth:`tick`.
        """
        longest = self.time + PATIENCE * self.plan.path.duration + SLACK
        while not self.done:
            if self.time > longest:
                return "late"
            tick = self.tick()
            if on_tick is not None:
                on_tick(tick)
        return "arrived"

    def vanish(self, ids: Iterable[str]) -> None:
        """Take holds away: free, targeted or held. A hand that held one is open at once; the walk is planned anew.

        Raises:
            UnknownNameError: no such hold; nothing is changed.
        """
        gone = {self.structure.index(hold) for hold in ids}
        names = [self.structure.ids[k] for k in sorted(gone)]
        rest = self.structure.without(names)
        for name in names:
            self._say("vanished", "", name)
        for arm in [arm for arm, hold in self.held.items() if hold in gone]:
            self._open(arm)
        if self.swinging is not None and self.swinging.hold in gone:
            self._stay(self.swinging.arm)
            self.swinging = None
        self._renumber(rest)
        self._changing = True

    def go(self, path: BodyPath) -> None:
        """Follow another path: the body stops, goes straight to where the path begins, and on."""
        self._wanted, self._changing = path, True

    def tick(self) -> Tick:
        """One control period: hands, body, controller, robot.

        Raises:
            HoldLost: fewer hands hold than the robot needs; the body's command is zero.
            NoPlanError: the walk has to be planned anew, and there is no plan.
        """
        if len(self.held) < self.walker.min_holds:
            raise HoldLost("hands", len(self.held), f"at least {self.walker.min_holds} must hold")
        if self._changing and self.pace == 0.0 and self.swinging is None:
            self._replan()
        self._lift()
        command, rate = self._advance()
        self.stack.body(command, rate)
        if self.swinging is not None:
            self._aim(self.swinging)
        begin = time.perf_counter()
        step = self.stack.controller.step(self.q, self.v)
        cost = time.perf_counter() - begin
        self.v = np.array(step.v)
        joints = self.q.copy()
        joints[7:] += self.v[6:] * self.dt
        self.q, slip = self.chain.settle(joints, self.held)
        self.time += self.dt
        if self.swinging is not None:
            self._land(self.swinging)
        error = dist(self.q[:3], command.translation)
        state = self._hands(), self._holds(), command, error, slip, step.status, cost
        return Tick(self.time, self.path_time, self.q, self.v, *state)

    def _follow(self, plan: Plan) -> None:
        """Take a plan from its beginning."""
        if plan.grips is None:
            raise ShapeError("plan", plan, "expected a plan of the planner")
        self.plan, self.grips = plan, plan.grips
        self.swings = Swings(self.walker, self.structure, plan.path, plan.grips)
        self._next, self._used = 0, [0] * len(self.walker.arms)
        self._grip = [chain[0] for chain in plan.chain]
        self.path_time = 0.0

    def _start(self) -> Array:
        """The first configuration: the body where the path begins, the arms on their grips."""
        q = np.array(self.walker.robot.neutral)
        first = pin.SE3(self.plan.path.poses[0])
        q[:3], q[3:7] = first.translation, pin.Quaternion(first.rotation).coeffs()
        for arm, grip in enumerate(self._grip):
            q[self.walker.arms[arm].q] = self.grips.posture(np.array(grip), np.array(0))
        return self.chain.settle(q, self.held)[0]

    def _replan(self) -> None:
        """Plan the rest of the way from where the body stands; a free hand goes to where the plan has it."""
        spacing = self.plan.path.spacing
        pose = self.plan.path.at(self.path_time)[0]
        here = np.repeat(pose.homogeneous[None], STANDING, axis=0)
        if self._wanted is None:
            rest = self.plan.path.poses[int(self.path_time / spacing) + 1 :]
        else:
            between = straight_path([pose, self._wanted.poses[0]], JOINING).poses
            rest = np.concatenate([between, self._wanted.poses])
        path = BodyPath(np.concatenate([here, rest]), spacing)
        try:
            plan = plan_from_here(self.walker, self.structure, path, self.held, self.q, self.chain)
        except NoPlanError:
            self._say("refused", "", "")
            raise
        self._follow(plan)
        self._wanted, self._changing = None, False
        self._say("replanned", "", "")

    def _lift(self) -> None:
        """Send a free hand to its hold, or open that of the next re-grasp when the body is where the plan lifts it."""
        if self.swinging is not None or self._changing:
            return
        free = [arm for arm in range(len(self.walker.arms)) if arm not in self.held]
        if free:
            self._bring(free[0])
            return
        if self._next >= len(self.plan.regrasps) or self.path_time < self.plan.regrasps[self._next].lift - 1e-9:
            return
        if len(self.held) <= self.walker.min_holds:
            raise HoldLost("hands", len(self.held), f"more than {self.walker.min_holds} must hold before one is lifted")
        step = self.plan.regrasps[self._next]
        arm = [a.name for a in self.walker.arms].index(step.arm)
        self._used[arm] += 1
        source, target = self.plan.chain[arm][self._used[arm] - 1 : self._used[arm] + 1]
        lift, land = (round(x / self.plan.path.spacing) for x in (step.lift, step.land))
        move = Move(arm, source, target, lift, land, step.duration, step.delay)
        self._open(arm)
        law = SwingLaw.of(self.swings, move, step.duration)
        self.swinging = Swinging(arm, int(self.grips.hold[target]), target, law, self.data.latch_time)
        self._say("lift", step.arm, step.source)

    def _bring(self, arm: int) -> None:
        """A hand that is in the air goes to where the plan begins, while the body stands still."""
        hold = int(self.grips.hold[self._grip[arm]])
        law = way_to(self.walker, self.structure, self.plan, arm, self.chain)
        self.swinging = Swinging(arm, hold, self._grip[arm], law, 0.0, counted=False, state="open")

    def _advance(self) -> tuple[pin.SE3, Array]:
        """Move the body's command on: as fast as asked, as slow as the grips of the holding hands need."""
        path, spacing = self.plan.path, self.plan.path.spacing
        ends = [float(self.grips.last[self._grip[arm]]) * spacing for arm in self.held]
        room = max(min([path.duration, *ends]) - self.path_time, 0.0)
        # The command stops within the room: braking from pace p takes p^2 RAMP / 2 of path time
        wanted = min(1.0, sqrt(2.0 * room / RAMP * 0.9))
        if self.swinging is not None:
            left = self.swinging.law.duration - self.swinging.clock + self.data.latch_time + 0.1
            if room < left:
                wanted = min(wanted, room / left)
        if self._changing or (self.swinging is not None and not self.swinging.counted):
            wanted = 0.0
        change = self.dt / RAMP
        self.pace = max(self.pace + min(max(wanted - self.pace, -change), change), 0.0)
        self.path_time = min(self.path_time + self.pace * self.dt, path.duration)
        pose, rate = path.at(self.path_time)
        return pose, rate * self.pace

    def _aim(self, swinging: Swinging) -> None:
        """Move the aim of the hand on, as fast as the hand follows, and tell the stack."""
        arm, pace = swinging.arm, 0.0
        place = self.chain.origins[arm]
        swinging.place, swinging.axis = place, self.chain.axes[arm]
        target = self.grips.posture_at(swinging.grip, round(self.path_time / self.plan.path.spacing))
        # On the wrong side of theta5 = 0 the wrist cannot align the hand: it turns to its branch before the hand lands
        (_, _, _, fourth, fifth, _), off = self.q[self.walker.arms[arm].q].tolist(), target.tolist()
        turned = abs(fourth - off[3]) < TURNED and abs(fifth - off[4]) < TURNED
        if swinging.state == "opening":
            swinging.latch -= self.dt
            if swinging.latch <= 1e-9:
                swinging.state = "open"
        elif swinging.state == "open":
            begins = float(self.grips.first[swinging.grip]) * self.plan.path.spacing
            wanted = hand_pace(swinging, place, turned, begins - self.path_time, self.pace)
            change = self.dt / HAND_RAMP
            pace = swinging.pace + min(max(wanted - swinging.pace, -change), change)
            swinging.clock = min(swinging.clock + pace * self.dt, swinging.law.duration)
        swinging.pace = pace
        aim = swinging.aim = swinging.law.at(swinging.clock)
        gap = aim.position - place
        far = sqrt(gap.dot(gap))
        if far > BEHIND:
            # A hand that cannot follow must not pull at the body: its aim waits within reach of it
            aim = replace(aim, position=place + gap * (BEHIND / far))
        near = (aim.part < LIFTING and swinging.counted) or (aim.part > LANDING and turned)
        self.stack.swing(arm, aim, pace, target, near)

    def _land(self, swinging: Swinging) -> None:
        """Close a hand that has come to rest on its hold; it holds when the latch is through."""
        arm, hold, data = swinging.arm, swinging.hold, self.data
        if swinging.state == "open" and swinging.clock >= swinging.law.duration - 1e-9:
            hand = self.chain.origins[arm], self.chain.axes[arm]
            if at_rest(swinging, hand, (self.structure.positions[hold], self.structure.axes[hold]), data, self.dt):
                swinging.state, swinging.latch = "closing", data.latch_time
        elif swinging.state == "closing":
            swinging.latch -= self.dt
            if swinging.latch <= 1e-9:
                self._grasp(swinging)

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
        self.stack.hold(arm, swinging.hold)
        self.swinging = None
        self._next += int(swinging.counted)
        self._say("land", *names)

    def _open(self, arm: int) -> None:
        del self.held[arm]
        self.stack.release(arm)
        self._stay(arm)

    def _stay(self, arm: int) -> None:
        """A hand in the air waits where it is."""
        self.stack.rest(arm, self.chain.origins[arm], self.chain.axes[arm])

    def _renumber(self, rest: Structure) -> None:
        """Go on with a structure that has lost holds: rows of holds change, hands stay where they are."""
        old, self.structure = self.structure, rest
        self.stack.structure = rest
        self.chain = self.chain.on(rest)
        self.held = {arm: rest.index(old.ids[hold]) for arm, hold in self.held.items()}
        if self.swinging is not None:
            self.swinging.hold = rest.index(old.ids[self.swinging.hold])

    def _say(self, what: What, arm: str, hold: str) -> None:
        self.events.append(Event(self.time, what, arm, hold, self.path_time))

    def _hands(self) -> tuple[Hand, ...]:
        out: list[Hand] = ["closed" if arm in self.held else "open" for arm in range(len(self.walker.arms))]
        if self.swinging is not None:
            out[self.swinging.arm] = self.swinging.state
        return tuple(out)

    def _holds(self) -> tuple[int, ...]:
        out = [self.held.get(arm, -1) for arm in range(len(self.walker.arms))]
        if self.swinging is not None:
            out[self.swinging.arm] = self.swinging.hold
        return tuple(out)
