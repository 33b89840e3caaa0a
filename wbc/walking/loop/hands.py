"""The hands of a walk: which one is on its way, how it is led, and when it opens, closes or waits in the air."""

from __future__ import annotations

from collections.abc import Callable
from math import dist
from typing import Any

import numpy as np

from wbc.multibody import pin
from wbc.rotations import quaternion
from wbc.validation import Array
from wbc.walking.arms.puma import limb_of
from wbc.walking.loop.hand_command import UPRIGHT, HandCommand, HandLanding, axis_part, braking
from wbc.walking.loop.hand_pace import LANDING, at_rest, hand_pace, ramp_of, turned
from wbc.walking.loop.machine import Machine
from wbc.walking.loop.progress import PlanProgress
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.state import Hand, Manual, Swinging, Wrist
from wbc.walking.loop.stopping import Stops
from wbc.walking.planner.grips.rolls import ANY, frame_on
from wbc.walking.planner.swings.law import SwingLaw

#: Rate at which a hand that has arrived takes back what it is off its hold [1/s],
SETTLING = 8.0
#: and at most this part of the gain with which it follows
PART = 0.33
#: A hand whose wrist hardly turns its axis swings about a little as it comes to rest: it closes after so many ticks
STEADY = 3
#: Time on its hold after which a hand may close that is slow on the whole, and not in each tick [s]
LINGERING = 0.2
#: A hold that could not be grasped so many times is taken as vanished
TRIES = 3
#: Path time by which a hand that does not delay the body may land later than planned [s]
LATE = 0.15


class ArmLeader:
    """Leads swinging hands of arms with three joints and a wrist, each by a clock of its own that waits for the hand.

    Attributes:
        stops: how fast body and hand come to rest.

    Raises:
        ShapeError: another machine.
    """

    def __init__(self, machine: Machine, progress: PlanProgress, stack: WalkStack) -> None:
        self._machine, self._progress, self._stack, self._dt = machine, progress, stack, machine.dt
        self._hand, self._landing = HandCommand(machine.dt), HandLanding(machine.dt)
        self._limb = limb_of(machine.walker)
        self.stops = Stops.of(machine.walker, machine.dt)

    def first(self) -> Array:
        """The configuration with which a plan begins: the body where the path begins, the arms on their grips."""
        walker, progress = self._machine.walker, self._progress
        q, begin = np.array(walker.robot.neutral), pin.SE3(progress.plan.path.poses[0])
        q[:3], q[3:7] = begin.translation, quaternion(begin.rotation)
        for arm, grip in zip(walker.arms, progress.grip, strict=True):
            q[arm.q] = progress.grips.posture(np.array(grip), np.array(0))
        return q

    def wrist(self, arm: int) -> Wrist:
        """Joints 4 to 6 of an arm as its grip has them where the body is now [rad]."""
        return self._progress.grips.wrist_at(self._progress.grip[arm], self._progress.sample)

    def lead(self, swinging: Swinging, early: float, pace: float, aborted: bool) -> None:
        """Move the hand's aim on by a tick along its law, as fast as the hand follows, and give it to the stack; near
        its hold the hand turns upright.

        Args:
            early: path time until the hold can be held [s]. pace: that the body wants to have.
        """
        machine, progress, arm = self._machine, self._progress, swinging.arm
        swinging.earlier = swinging.axis
        swinging.place, swinging.axis, swinging.x_axis = machine.hand(arm)
        # Beyond theta5 = 0 the wrist cannot align the hand: it turns to its branch before the hand lands
        at_branch = turned(swinging, machine.q[machine.walker.arms[arm].q].tolist()[3:])
        if swinging.state == "opening":
            swinging.open_on(self._dt)
        elif swinging.state == "open":
            ends = swinging.law.places[0], machine.structure.positions[swinging.hold]
            far = dist(swinging.place, ends[0]), dist(swinging.place, ends[1])
            wanted = min(hand_pace(swinging, swinging.place, at_branch, early, pace, far), swinging.most)
            stops = aborted or swinging.dropped or swinging.pauses
            wanted, change = (0.0, self._dt / self.stops.hand) if stops else (wanted, self._dt / ramp_of(swinging))
            swinging.pace += min(max(wanted - swinging.pace, -change), change)
            swinging.clock = min(swinging.clock + swinging.pace * self._dt, swinging.law.duration)
        grip = progress.grip[arm]
        elbow = machine.q.item(machine.walker.arms[arm].q.start + 2)
        brakes = braking(machine.walker.arm_data, elbow, self._stack.swing_gain)
        followed = self._hand.go(swinging, swinging.place, progress.grips, grip, progress.sample, brakes)
        if swinging.state == "open" and swinging.clock >= swinging.law.duration - 1e-9 and not swinging.dropped:
            # What postures pull at a hand that has arrived is taken back, else it stays beside its hold
            # Where it brakes it follows less than it is told, and what is summed up then would make it swing about
            off = swinging.aim.position - swinging.place
            settling = min(SETTLING, PART * self._stack.swing_gain)
            settling *= min(1.0, brakes / max(dist(swinging.aim.position, swinging.place), 1e-9)) ** 2
            swinging.shift += settling * self._dt * off
        followed[:3] += swinging.shift
        if machine.lag > 0.0 and swinging.state == "open":
            # Joints that lag are told now how fast the hand is to be when they follow
            soon = swinging.law.at(swinging.clock + machine.lag * swinging.pace).velocity
            followed[3:6] += swinging.pace * (soon - swinging.aim.velocity)
        hold = machine.structure.positions[swinging.hold], machine.structure.axes[swinging.hold]
        near = swinging.aim.blend > LANDING and at_branch and dist(swinging.aim.position, hold[0]) < UPRIGHT
        near = near and not swinging.dropped
        axes = self._landing.go(swinging, hold, near, machine.lag)
        # Of the joints as they are: only near its hold the axis counts
        part = 1.0 if axes is None else axis_part(float(self._limb.wrist_bend(machine.q[machine.walker.arms[arm].q])))
        swinging.steady = 1 if part == 1.0 else STEADY
        self._stack.swing(arm, followed, axes, part)


class Hands:
    """The hands of a machine: those that hold, the one on its way, and their items of the stack.

    Args:
        grasps: (arm, hold) -> whether the hand's latch closes.

    Attributes:
        swinging: the swinging hand. manual: a hand that is moved by itself, see :mod:`wbc.walking.modes.arm_mode`.
        over: row of a hand that comes to rest over a hold, and of that, see :mod:`wbc.walking.loop.coasting`.
    """

    def __init__(self, machine: Machine, stack: WalkStack, grasps: Callable[[str, str], bool]) -> None:
        self.machine, self.stack, self.grasps = machine, stack, grasps
        self.data = machine.walker.arm_data
        self.swinging: Swinging | None = None
        self.manual: Manual | None = None
        self.over: dict[int, int] = {}
        self._arms = range(len(machine.walker.arms))
        self._landed = (-1, 0.0)

    def begin(self, rolls: list[int]) -> None:
        """Every hand as the machine has it.

        Args:
            rolls: the number of the roll at which each one holds.
        """
        for arm in self._arms:
            if arm in self.machine.held:
                self.stack.hold(arm, self.machine.held[arm], rolls[arm])
            else:
                self.stack.release(arm)
                self.stay(arm)

    def open(self, arm: int) -> None:
        """A hand lets go, and waits where it is."""
        self.machine.open(arm)
        self.stack.release(arm)
        self.stay(arm)

    def close(self, arm: int, hold: int, roll: int) -> bool:
        """A hand holds a hold (its row) at one of its rolls; whether its latch closes."""
        if not self.grasps(self.machine.walker.arms[arm].name, self.machine.structure.ids[hold]):
            return False
        self.machine.close(arm, hold)
        self._landed = arm, self.machine.time
        self.stack.hold(arm, hold, roll)
        return True

    def settle_in_air(self, arm: int) -> None:
        """A hand in the air that followed joints waits where it is."""
        origin, axis, _ = self.machine.hand(arm)
        self.stack.settle(arm, origin, axis, None)

    def stay(self, arm: int) -> None:
        """A hand in the air waits where it is."""
        origin, axis, _ = self.machine.hand(arm)
        self.stack.rest(arm, origin, axis)

    def drop(self) -> None:
        """The swinging hand does not go to its hold any more: it slows down along its law, and stays in the air."""
        if self.swinging is None:
            return
        if not self.swinging.dropped:
            self._leave(self.swinging)
        if self.swinging.state == "opening":
            self.swinging.dropped, self.swinging.pace = True, 0.0
            return
        if self.swinging.state == "open" and self.swinging.pace > 0.0:
            self.swinging.dropped = True
            return
        self.stay(self.swinging.arm)
        self.swinging = None

    def _leave(self, swinging: Swinging) -> None:
        """The hand may still be near to what its hold is mounted on."""
        places = self.machine.left.setdefault(swinging.arm, [])
        places.append(self.machine.structure.positions[swinging.hold])

    def just_landed(self, arm: int) -> bool:
        """It has landed in this tick: a hand that goes on at once is closed for a tick."""
        return self._landed == (arm, self.machine.time)

    def going(self, arm: int, grip: tuple[int, int, int], law: SwingLaw, **more: Any) -> Swinging:
        """A hand that is to go along a law.

        Args:
            grip: its number, the row of its hold, and the number of its roll. more: of :class:`Swinging`.
        """
        number, hold, roll = grip
        x = None if roll == ANY else frame_on(self.machine.structure, hold, roll)[:3, 0]
        return Swinging(arm, hold, number, law, x=x, **more)

    def settle(self, swinging: Swinging) -> bool:
        """Close a hand that has come to rest on its hold; whether the latch is through with this tick."""
        if swinging.dropped:
            if swinging.pace == 0.0 and swinging.state == "open":
                self.drop()
            return False
        if swinging.state == "open" and swinging.clock >= swinging.law.duration - 1e-9:
            before = swinging.place, swinging.axis, swinging.x_axis
            rests = self.rests(swinging.arm, swinging.hold, before, swinging.x, swinging.earlier)
            swinging.rests = swinging.rests + 1 if rests else 0
            if swinging.rests >= swinging.steady or self._lingers(swinging):
                swinging.state, swinging.latch = "closing", self.data.latch_time
        elif swinging.state == "closing":
            swinging.latch -= self.machine.dt
            return swinging.latch <= 1e-9
        return False

    def rests(
        self,
        arm: int,
        hold: int,
        before: tuple[Array, Array, Array],
        x: Array | None,
        earlier: Array | None,
        seconds: float | None = None,
    ) -> bool:
        """Whether a hand is on a hold and still; ``before``, some seconds ago (default: a tick), and ``earlier`` as of
        :func:`at_rest`.
        """
        structure, machine = self.machine.structure, self.machine
        there, dt = (structure.positions[hold], structure.axes[hold]), machine.dt if seconds is None else seconds
        earlier = earlier if machine.lag == 0.0 else None
        return at_rest(before, machine.hand(arm), there, x, structure.tilts[hold], self.data, dt, earlier)

    def _lingers(self, swinging: Swinging) -> bool:
        """Whether a hand has been on its hold for :data:`LINGERING`, and slow on the whole: noise of encoders moves it
        from tick to tick faster than a hand may close.
        """
        arm, hold, x = swinging.arm, swinging.hold, swinging.x
        here, time = self.machine.hand(arm), self.machine.time
        if not self.rests(arm, hold, here, x, None):
            swinging.came = None
            return False
        if swinging.came is None:
            swinging.came = time, here
        since, place = swinging.came
        return time - since >= LINGERING and self.rests(arm, hold, place, x, None, time - since)

    def missed(self, swinging: Swinging) -> bool:
        """The latch did not close: the hand tries again; whether it has tried often enough."""
        swinging.tries += 1
        swinging.state = "open"
        return swinging.tries >= TRIES

    def states(self) -> tuple[Hand, ...]:
        """What each hand does."""
        held = self.machine.held
        out: list[Hand] = ["closed" if arm in held else "open" for arm in self._arms]
        if self.swinging is not None:
            out[self.swinging.arm] = self.swinging.state
        if self.manual is not None:
            out[self.manual.arm] = self.manual.state
        return tuple(out)

    def holds(self) -> tuple[int, ...]:
        """Row of the hold that each hand is at or goes to, -1 for none."""
        held = self.machine.held | self.over
        out = [held.get(arm, -1) for arm in self._arms]
        if self.swinging is not None:
            out[self.swinging.arm] = -1 if self.swinging.dropped else self.swinging.hold
        if self.manual is not None:
            out[self.manual.arm] = self.manual.hold
        return tuple(out)
