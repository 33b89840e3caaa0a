"""Carrying out a plan: the loop of controller, hands and simulated robot."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
import pinocchio as pin

from wbc.errors import ShapeError
from wbc.robots import Walker, WalkerData
from wbc.validation import Array
from wbc.walking.closed_chain import ClosedChain
from wbc.walking.plan import HoldLost, Plan, Regrasp
from wbc.walking.stance_search import Move
from wbc.walking.structure import Structure
from wbc.walking.swing_law import SwingLaw
from wbc.walking.swings import Swings
from wbc.walking.walk_stack import DT, WalkStack

Hand = Literal["closed", "opening", "open", "closing"]

#: From rest to the commanded speed [s]
RAMP = 0.5
#: A swing waits for a hand that is this far behind its aim [m]: full pace below half of it, least pace beyond
BEHIND, LEAST_PACE = 0.02, 0.05
#: Parts of the way before and after which a hand is near a hold; joints 4 and 5 this near to their posture [rad] there
LIFTING, LANDING, TURNED = 0.2, 0.8, 0.5
#: The walk is over when the body is this near to the end of the path [m]
ARRIVED = 0.002
#: A walk that takes this many times its path's duration and SLACK seconds more is given up
PATIENCE, SLACK = 4.0, 20.0


@dataclass(eq=False)
class Swinging:
    """A hand on its way.

    Attributes:
        move: in rows and samples. law: the aims. clock: time on the law [s]. latch: time until it is through [s].
        place: of the hand one tick before, and its axis, for speeds.
    """

    move: Move
    law: SwingLaw
    latch: float
    clock: float = 0.0
    state: Hand = "opening"
    place: Array = field(default_factory=lambda: np.zeros(3))
    axis: Array = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True, eq=False)
class Tick:
    """What happened in one tick; arrays are the tick's own.

    Attributes:
        time: [s]. path_time: u [s]. q, v: configuration after it, and what the controller returned.
        hands: state of each hand. holds: row of the hold that each hand is at or goes to, -1 for none.
        body_error: distance of the body from its command [m]. slip: of the worst held hand [m].
        status: of the controller. cost: of the controller's tick [s].
    """

    time: float
    path_time: float
    q: Array
    v: Array
    hands: tuple[Hand, ...]
    holds: tuple[int, ...]
    command: pin.SE3
    body_error: float
    slip: float
    status: str
    cost: float


@dataclass(frozen=True)
class Event:
    """A hand that was lifted or has landed.

    Attributes:
        time: [s]. what: ``lift`` or ``land``. arm, hold: names. path_time: u [s].
    """

    time: float
    what: Literal["lift", "land"]
    arm: str
    hold: str
    path_time: float


class Walk:
    """A simulated walk. The simulator's only inputs are the joint rates that the controller returns; where the body is
    follows from the holds of its closed hands.

    Args:
        walker, structure, plan: what walks where.
        collisions, backend: see :class:`WalkStack`.

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
    ) -> None:
        if plan.grips is None or not isinstance(walker.data, WalkerData):
            raise ShapeError("plan", plan, "expected a plan of the planner for a body with arms")
        self.walker, self.structure, self.plan, self.dt = walker, structure, plan, dt
        self.data, self.grips = walker.data, plan.grips
        self.stack = stack or WalkStack(walker, structure, dt, collisions=collisions, backend=backend)
        self.chain = ClosedChain(walker, structure)
        self.swings = Swings(walker, structure, plan.path, plan.grips)
        self.time, self.path_time, self.pace = 0.0, 0.0, 0.0
        self.events: list[Event] = []
        self.swinging: Swinging | None = None
        self._next = 0
        self._grip = [chain[0] for chain in plan.chain]
        self._used = [0] * len(walker.arms)
        self.held = {arm: int(self.grips.hold[grip]) for arm, grip in enumerate(self._grip)}
        self.v = np.zeros(walker.robot.nv)
        self.q = self._start()
        for arm, hold in self.held.items():
            self.stack.hold(arm, hold)

    @property
    def done(self) -> bool:
        """The body is at the end of the path, and no hand is on its way."""
        ended = self.path_time >= self.plan.path.duration - 1e-9 and self.swinging is None
        end = self.plan.path.poses[-1][:3, 3]
        return ended and self._next == len(self.plan.regrasps) and float(np.linalg.norm(self.q[:3] - end)) < ARRIVED

    def run(self, on_tick: Callable[[Tick], Any] | None = None) -> str:
        """Ticks until the walk is done or given up.

        Returns:
            "arrived", or "late" when it takes more than four times as long as the path.

        Raises:
            HoldLost: too few hands hold.
        """
        longest = PATIENCE * self.plan.path.duration + SLACK
        while not self.done:
            if self.time > longest:
                return "late"
            tick = self.tick()
            if on_tick is not None:
                on_tick(tick)
        return "arrived"

    def tick(self) -> Tick:
        """One control period: hands, body, controller, robot.

        Raises:
            HoldLost: fewer hands hold than the robot needs.
        """
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
        error = float(np.linalg.norm(self.q[:3] - command.translation))
        return Tick(
            self.time,
            self.path_time,
            self.q,
            self.v,
            self._hands(),
            self._holds(),
            command,
            error,
            slip,
            step.status,
            cost,
        )

    def _start(self) -> Array:
        """The first configuration: the body where the path begins, the arms on their grips."""
        q = np.array(self.walker.robot.neutral)
        first = pin.SE3(self.plan.path.poses[0])
        q[:3], q[3:7] = first.translation, pin.Quaternion(first.rotation).coeffs()
        for arm, grip in enumerate(self._grip):
            q[self.walker.arms[arm].q] = self.grips.posture(np.array(grip), np.array(0))
        return self.chain.settle(q, self.held)[0]

    def _lift(self) -> None:
        """Open the hand of the next re-grasp when the body is where the plan lifts it."""
        if self.swinging is not None or self._next >= len(self.plan.regrasps):
            return
        step = self.plan.regrasps[self._next]
        if self.path_time < step.lift - 1e-9:
            return
        if len(self.held) <= self.walker.min_holds:
            raise HoldLost(
                "hands", len(self.held), f"one more than {self.walker.min_holds} must hold before one is lifted"
            )
        move = self._move(step)
        del self.held[move.arm]
        self.stack.release(move.arm)
        self.swinging = Swinging(move, SwingLaw(self.swings, move), self.data.latch_time)
        self.events.append(Event(self.time, "lift", step.arm, step.source, self.path_time))

    def _move(self, step: Regrasp) -> Move:
        arm = [a.name for a in self.walker.arms].index(step.arm)
        self._used[arm] += 1
        source, target = self.plan.chain[arm][self._used[arm] - 1 : self._used[arm] + 1]
        spacing = self.plan.path.spacing
        lift, land = (round(x / spacing) for x in (step.lift, step.land))
        return Move(arm, source, target, lift, land, step.duration, step.delay)

    def _advance(self) -> tuple[pin.SE3, Array]:
        """Move the body's command on: as fast as asked, as slow as the grips of the holding hands need."""
        path, spacing = self.plan.path, self.plan.path.spacing
        ends = [float(self.grips.last[self._grip[arm]]) * spacing for arm in self.held]
        room = max(min([path.duration, *ends]) - self.path_time, 0.0)
        # The command stops within the room: braking from pace p takes p^2 RAMP / 2 of path time
        wanted = min(1.0, float(np.sqrt(2.0 * room / RAMP * 0.9)))
        if self.swinging is not None:
            left = self.swinging.law.duration - self.swinging.clock + self.data.latch_time + 0.1
            if room < left:
                wanted = min(wanted, room / left)
        change = self.dt / RAMP
        self.pace = max(self.pace + min(max(wanted - self.pace, -change), change), 0.0)
        self.path_time = min(self.path_time + self.pace * self.dt, path.duration)
        pose, rate = path.at(self.path_time)
        return pose, rate * self.pace

    def _aim(self, swinging: Swinging) -> None:
        """Move the aim of the hand on, as fast as the hand follows, and tell the stack."""
        move, pace = swinging.move, 0.0
        place = self.chain.origins[move.arm]
        swinging.place, swinging.axis = place, self.chain.rotations[move.arm][:, 2]
        target = self.grips.posture(np.array(move.target), np.array(round(self.path_time / self.plan.path.spacing)))
        # On the wrong side of theta5 = 0 the wrist cannot align the hand: it turns to its branch before the hand lands
        wrist = self.q[self.walker.arms[move.arm].q][3:5]
        turned = bool(np.abs(wrist - target[3:5]).max() < TURNED)
        if swinging.state == "opening":
            swinging.latch -= self.dt
            if swinging.latch <= 1e-9:
                swinging.state = "open"
        elif swinging.state == "open":
            behind = float(np.linalg.norm(place - swinging.law.at(swinging.clock).position))
            pace = min(max(1.5 - behind / BEHIND, LEAST_PACE), 1.0)
            begins = float(self.grips.first[move.target]) * self.plan.path.spacing
            part = swinging.law.at(swinging.clock).part
            if part > 0.6 and self.path_time < begins:
                pace *= min(max(1.0 - 2.0 * (begins - self.path_time), 0.0), 1.0)
            if part > LANDING and not turned:
                pace = 0.0
            swinging.clock = min(swinging.clock + pace * self.dt, swinging.law.duration)
        aim = swinging.law.at(swinging.clock)
        gap = aim.position - place
        far = float(np.linalg.norm(gap))
        if far > BEHIND:
            # A hand that cannot follow must not pull at the body: its aim waits within reach of it
            aim = replace(aim, position=place + gap * (BEHIND / far))
        near = aim.part < LIFTING or (aim.part > LANDING and turned)
        self.stack.swing(move.arm, aim, pace, target, near)

    def _land(self, swinging: Swinging) -> None:
        """Close a hand that has come to rest on its hold; it holds when the latch is through."""
        move, data = swinging.move, self.data
        hold = int(self.grips.hold[move.target])
        if swinging.state == "open" and swinging.clock >= swinging.law.duration - 1e-9:
            place, axis = self.chain.origins[move.arm], self.chain.rotations[move.arm][:, 2]
            off = float(np.linalg.norm(place - self.structure.positions[hold]))
            tilt = _angle(axis, self.structure.axes[hold])
            speed = float(np.linalg.norm(place - swinging.place)) / self.dt
            rate = _angle(axis, swinging.axis) / self.dt
            if (
                off < data.close_distance
                and tilt < data.close_angle
                and speed < data.close_speed
                and rate < data.close_rate
            ):
                swinging.state, swinging.latch = "closing", data.latch_time
        elif swinging.state == "closing":
            swinging.latch -= self.dt
            if swinging.latch <= 1e-9:
                self.held[move.arm] = hold
                self._grip[move.arm] = move.target
                self.stack.hold(move.arm, hold)
                self.swinging = None
                self._next += 1
                names = self.walker.arms[move.arm].name, self.structure.ids[hold]
                self.events.append(Event(self.time, "land", *names, self.path_time))

    def _hands(self) -> tuple[Hand, ...]:
        out: list[Hand] = ["closed"] * len(self.walker.arms)
        if self.swinging is not None:
            out[self.swinging.move.arm] = self.swinging.state
        return tuple(out)

    def _holds(self) -> tuple[int, ...]:
        out = [self.held.get(arm, -1) for arm in range(len(self.walker.arms))]
        if self.swinging is not None:
            out[self.swinging.move.arm] = int(self.grips.hold[self.swinging.move.target])
        return tuple(out)


def _angle(one: Array, other: Array) -> float:
    """Between two unit vectors [rad]; exact for small angles."""
    return float(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other))
