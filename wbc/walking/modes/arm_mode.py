"""Arm mode: one hand moves as commanded while the others hold and the body stands still."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import WbcError
from wbc.multibody import pin
from wbc.validation import Array
from wbc.walking.loop.foresight import Foresight
from wbc.walking.loop.state import Hand, Manual, Tick
from wbc.walking.loop.stopping import OFF
from wbc.walking.loop.walk import Walk
from wbc.walking.modes.hand_motion import ArmRefused, Standing
from wbc.walking.planner.grips.conflicts import LimbShapes
from wbc.walking.planner.grips.rolls import ANY, frame_on

#: Speeds of a hand unless others are asked for [m/s, rad/s]
SPEED, TURN_RATE = 0.1, 0.5
#: A hand is this far above a hold before it goes on to it [m]
ABOVE = 4.5 * 0.0254
#: Ticks that a hand has to come to rest on a hold, and those that are made after a stop
REST, STILL = 200, 10


class ArmStopped(WbcError):
    """A motion that was ended by whoever may stop it; the hand is in the air and stands."""


class ArmMode:
    """One arm of a walk that stands.

    Args:
        walk: between its ticks; its body stands and no hand is swinging. arm: name. on_tick: what happens every tick.
        stop: asked every tick of a motion: true ends it, within ``walk.leader.stops.hand`` seconds,
            and raises :class:`ArmStopped`.

    Attributes:
        farthest: how far body and hand can travel after a stop at any instant of the motions so far [m].
        stopped: how far they travelled in a motion that was stopped, and what had been said before [m]; None: none was.

    Raises:
        UnknownNameError: no such arm. ArmRefused: the body moves, or the other hands do not hold.
    """

    def __init__(
        self,
        walk: Walk,
        arm: str,
        on_tick: Callable[[Tick], Any] | None = None,
        stop: Callable[[], bool] | None = None,
    ) -> None:
        names = [a.name for a in walk.walker.arms]
        validation.one_of("arm", arm, names)
        self.walk, self.arm, self._on_tick = walk, names.index(arm), on_tick or (lambda tick: None)
        self._stop = stop or (lambda: False)
        self.farthest: tuple[float, float] = (0.0, 0.0)
        self.stopped: tuple[tuple[float, float], tuple[float, float]] | None = None
        manual = walk.hands.manual
        if walk.pace > 0.0 or walk.swinging is not None or (manual is not None and manual.arm != self.arm):
            raise ArmRefused("walk", walk.path_time, "the body moves, or a hand is swinging")
        others = [k for k in walk.held if k != self.arm]
        if len(others) < walk.walker.min_holds:
            raise ArmRefused("arm", arm, f"{walk.walker.min_holds} other hands must hold, {len(others)} do")

    def through(self, poses: Sequence[pin.SE3], speed: float = SPEED, turn_rate: float = TURN_RATE) -> None:
        """The hand goes through poses in the structure, straight from one to the next, and stops at each.

        A hand that holds opens first. Speeds [m/s, rad/s] are the largest; joints may need slower ones.

        Raises:
            ShapeError, RotationError, RangeError: bad poses or speeds. ArmRefused: not possible; nothing has moved.
        """
        asked = [validation.pose(f"poses[{k}]", pose) for k, pose in enumerate(poses)]
        speed = validation.scalar("speed", speed, low=0.0, open_low=True, unit="m/s")
        turn_rate = validation.scalar("turn_rate", turn_rate, low=0.0, open_low=True, unit="rad/s")
        rows = self._standing().along(asked, speed, turn_rate)
        self._release()
        self._follow(rows)

    def by_rate(self, twist: Any, seconds: float) -> None:
        """The hand moves with a twist (linear; angular) in the structure's axes [m/s, rad/s] for a time [s].

        It speeds up and slows down: what is covered is twist x seconds.

        Raises:
            ShapeError, RangeError: bad numbers. ArmRefused: not possible; nothing has moved.
        """
        rate = validation.real_array("twist", twist, (6,))
        seconds = validation.scalar("seconds", seconds, low=0.0, open_low=True, unit="s")
        here = self.pose
        there = pin.SE3(pin.exp3(rate[3:] * seconds) @ here.rotation, here.translation + rate[:3] * seconds)
        linear, angular = (max(float(np.linalg.norm(part)), 1e-9) for part in (rate[:3], rate[3:]))
        self.through([there], 15 / 8 * linear, 15 / 8 * angular)

    def to_hold(self, hold: str, speed: float = SPEED, turn_rate: float = TURN_RATE) -> None:
        """The hand goes to a hold and closes: straight off, across by joints, straight on from 4.5 in above.

        Raises:
            UnknownNameError: no such hold. ArmRefused: another hand is there, or not possible; nothing has moved. Or
                the latch does not close; the hand is then open at the hold.
        """
        walk, structure = self.walk, self.walk.structure
        row = structure.index(hold)
        if row in [held for arm, held in walk.held.items() if arm != self.arm]:
            raise ArmRefused("hold", hold, "another hand holds it")
        here, axis = self.pose, structure.axes[row]
        rolls = structure.holds[row].rolls
        frames = {roll: pin.SE3(frame_on(structure, row, roll)) for roll in range(len(rolls))}
        if not frames:
            # The roll is free: the hand turns as little as it can
            turn = pin.Quaternion.FromTwoVectors(here.rotation[:, 2], axis).toRotationMatrix()
            frames = {ANY: pin.SE3(turn @ here.rotation, structure.positions[row])}
        number = min(frames, key=lambda k: float(np.linalg.norm(pin.log3(here.rotation.T @ frames[k].rotation))))
        on = frames[number]
        above = pin.SE3(on.rotation, on.translation - ABOVE * axis)
        leaving = []
        if self.arm in walk.held:
            # Along the normal of the hold, as a hand that leans would come out beside it
            normal = structure.axes[walk.held[self.arm]]
            leaving = [pin.SE3(here.rotation, here.translation - ABOVE * normal)]
        rows = self._standing().onto(leaving, [above, on], row, speed, turn_rate)
        self._release()
        self._follow(rows)
        self._close(row, number, on)

    @property
    def pose(self) -> pin.SE3:
        """Of the hand in the structure."""
        x, z = self.walk.machine.chain.x_axes[self.arm], self.walk.machine.chain.axes[self.arm]
        return pin.SE3(np.column_stack([x, np.cross(z, x), z]), self.walk.machine.chain.origins[self.arm].copy())

    def _standing(self) -> Standing:
        walk = self.walk
        sight = Foresight(walk.walker, walk.structure)
        sight.left = walk.machine.left
        body = pin.SE3(pin.Quaternion(walk.q[3:7]).matrix(), walk.q[:3].copy())
        return Standing(walk.walker, sight, dict(walk.held), self.arm, body, walk.q.copy(), walk.dt)

    def leave(self) -> None:
        """A hand in the air goes back to what the walk plans for it, with the next ticks of the walk."""
        if self.walk.hands.manual is not None:
            pose = self.pose
            self.walk.stack.settle(self.arm, pose.translation, pose.rotation[:, 2], None)
            self.walk.hands.manual = None

    def _tick(self, state: Hand, hold: int = -1) -> None:
        self.walk.hands.manual = Manual(self.arm, state, hold)
        self._on_tick(self.walk.tick())

    def _release(self) -> None:
        """Open the hand, if it holds."""
        if self.arm not in self.walk.held:
            return
        hold = self.walk.held[self.arm]
        if not self.walk.machine.may_open(self.arm):
            raise ArmRefused("arm", self.walk.walker.arms[self.arm].name, self.walk.machine.failing())
        if self.walk.hands.just_landed(self.arm):
            # A row of the log has what hands did in the tick before: one is to say that it was closed
            for _ in range(2):
                self._tick("closed", hold)
        self.walk.open_hand(self.arm)
        for _ in range(round(self.walk.hands.data.latch_time / self.walk.dt)):
            self._tick("opening", hold)

    def _follow(self, rows: Array) -> None:
        """Joints tick by tick; slower and slower from where a stop is asked for."""
        walk, place = self.walk, 0.0
        places = self._places(rows)
        body, hand = self.farthest
        self.farthest = max(body, OFF), max(hand, walk.leader.stops.longest_of_hand(places, walk.dt))
        while place < len(rows) - 1:
            if self._stop():
                self._come_to_rest(rows, places, place)
                raise ArmStopped("stop", walk.time, "the motion was stopped")
            place = self._go(rows, place, 1.0)
        walk.stack.joints(self.arm, _between(rows, place), np.zeros(6))

    def _go(self, rows: Array, place: float, pace: float) -> float:
        """A tick along rows; the place where it ends."""
        walk, then = self.walk, min(place + pace, len(rows) - 1.0)
        now, after = _between(rows, place), _between(rows, then)
        walk.stack.joints(self.arm, now, (after - now) / walk.dt)
        self._tick("open")
        return then

    def _come_to_rest(self, rows: Array, places: Array, place: float) -> None:
        """The pace falls to nothing; how far body and hand go is stored beside what is said before."""
        walk = self.walk
        begin, hand = walk.q[:3].copy(), walk.machine.chain.origins[self.arm].copy()
        gap = float(np.linalg.norm(_between(places, place) - hand))
        said = OFF, float(walk.leader.stops.of_hand(places, walk.dt, np.array(place * walk.dt), 1.0, gap))
        far = np.zeros(2)
        part = walk.dt / walk.leader.stops.hand
        for pace in (*np.arange(1.0 - part, 0.0, -part).tolist(), *[0.0] * STILL):
            place = self._go(rows, place, pace)
            moved = walk.q[:3] - begin, walk.machine.chain.origins[self.arm] - hand
            far = np.maximum(far, [float(np.linalg.norm(path)) for path in moved])
        self.stopped = (float(far[0]), float(far[1])), said

    def _places(self, rows: Array) -> Array:
        """Of the hand at rows of joints ``[n, 3]`` [m], on the body that stands."""
        walk = self.walk
        hands = LimbShapes(walk.walker).points(self.arm, rows)[:, 5]
        out: Array = hands @ pin.Quaternion(walk.q[3:7]).matrix().T + walk.q[:3]
        return out

    def _close(self, row: int, number: int, frame: pin.SE3) -> None:
        """Come to rest on a hold at one of its rolls, and close."""
        walk, name = self.walk, self.walk.structure.ids[row]
        x = None if number == ANY else frame.rotation[:, 0]
        walk.stack.settle(self.arm, walk.structure.positions[row], walk.structure.axes[row], x)
        earlier: Array | None = None
        for _ in range(REST):
            place, z, x_axis = walk.machine.hand(self.arm)
            self._tick("open")
            if walk.hands.rests(self.arm, row, (place, z, x_axis), x, earlier):
                break
            earlier = z
        else:
            raise ArmRefused("hold", name, "the hand does not come to rest on it")
        for _ in range(round(walk.hands.data.latch_time / walk.dt)):
            self._tick("closing", row)
        if not walk.close_hand(self.arm, row, number):
            raise ArmRefused("hold", name, "the latch does not close")


def _between(rows: Array, place: float) -> Array:
    """A row at a fractional place."""
    low = min(int(place), len(rows) - 2)
    out: Array = rows[low] + (place - low) * (rows[low + 1] - rows[low])
    return out
