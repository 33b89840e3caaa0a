"""The walker on its structure, driven from a page: by rates, or to a hold that was clicked."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from wbc import robots
from wbc.errors import WbcError
from wbc.validation import Array
from wbc.viewer.beside import Viewer, show
from wbc.viewer.messages import RATE_LASTS, MessageError
from wbc.viewer.one_hand import OneHand
from wbc.viewer.operation import Operation
from wbc.viewer.paced import ticks
from wbc.viewer.scenery import checked
from wbc.viewer.walks import scenery_of
from wbc.walking.loop.state import Tick
from wbc.walking.modes.drive import Drive
from wbc.walking.planner.plan import Regrasp
from wbc.walking.run.drive_mode import DriveMode
from wbc.walking.run.request import DriveRequest, Site

#: Rates at full stick: round, along [m/s], spin [rad/s]
BODY_SPEED = np.array([0.05, 0.05, 0.04])
#: A body within this of its destination is there [m]
THERE = 0.02
#: A course that is off by more than this is set anew [rad]
OFF = 0.15
#: Points of a hand's path that are drawn
POINTS = 24
#: What a loop without an end gives at its end
END = object()


class WalkOperation(Operation):
    """Obeys a page for a walk: its messages are ``steer``, ``go``, ``ask``, ``approve``, ``arm`` and ``hand``.

    A stop is that of the walk: body and hand slow down along their paths, nothing is lifted and nothing planned.

    Args:
        on_tick: called after every tick. now: a clock [s].

    Attributes:
        waiting: the lift that waits for a yes, "" for none. hand: the one that is moved alone, None for none.
    """

    def __init__(
        self, drive: Drive, now: Callable[[], float] = time.monotonic, on_tick: Callable[[Tick], Any] = lambda _: None
    ) -> None:
        super().__init__(drive.walk.stack.controller)
        self.drive, self.waiting, self._now, self._on_tick = drive, "", now, on_tick
        self.hand: OneHand | None = None
        self._begins = drive.walk.structure.ids
        self._said, self._shown = "", tuple[Any, ...]()
        self._steered, self._until, self._goal = np.zeros(3), 0.0, -1
        self._approved = ""
        self._asks = False

    def check(self, message: Mapping[str, Any]) -> None:
        """Raise what :meth:`obey` would raise for values, and change nothing."""
        checked(message, self.drive.walk.structure.ids, tuple(arm.name for arm in self.drive.walk.walker.arms))

    def obey(self, message: Mapping[str, Any]) -> None:
        """Do what a message says.

        Raises:
            WbcError: it does not fit; nothing has changed.
        """
        self.check(message)
        kind = message["type"]
        if kind in ("steer", "go", "arm", "hand") and self.stopped:
            raise MessageError("message", kind, f"the robot is stopped ({self.stopped}); resume first")
        if kind == "arm":
            self._take_hand(message["name"])
        elif kind == "hand":
            if self.hand is None:
                raise MessageError("message", kind, "no arm is moved alone; choose one first")
            self.hand.ask(np.array([float(x) for x in message["rates"]]))
        elif kind == "go" and self.hand is not None:
            self.hand.go(message["hold"])
        elif kind == "steer" and self.hand is not None:
            raise MessageError("message", kind, f"{self.hand.arm} is moved alone, and the body stands")
        elif kind == "steer":
            self._steered = BODY_SPEED * np.array([float(x) for x in message["rates"]])
            self._until, self._goal = self._now() + RATE_LASTS, -1
        elif kind == "go":
            self._goal = self.drive.walk.structure.index(message["hold"])
        elif kind == "ask":
            self._asks = bool(message["on"])
            self.drive.walk.approve = self._approve if self._asks else None
            self.waiting = ""
        elif kind == "approve":
            self._approved, self.waiting = self.waiting, ""
        else:
            super().obey(message)

    def stop(self, reason: str) -> None:
        """Slow down along the paths; the first reason stays."""
        if not self.stopped:
            self.stopped, self._goal = reason, -1
            self._steered = np.zeros(3)
            self.drive.walk.abort()

    def resume(self) -> None:
        """Go on from there; the body stands until it is steered."""
        if self.stopped:
            self.stopped = ""
            self.drive.walk.carry_on()

    def tick(self) -> None:
        """One tick of the walk, or all those of a motion of the hand that is moved alone.

        Raises:
            WbcError: as of :meth:`wbc.walking.modes.drive.Drive.tick`.
        """
        if self.hand is not None and (reason := self.hand.move()):
            self._said = reason
        self.steer()
        self._seen(self.drive.tick())

    def steer(self) -> None:
        """Before a tick: the rates that hold now."""
        if self._goal >= 0:
            self.drive.steer(*self._course())
        elif self._now() > self._until or self.stopped:
            self.drive.steer(0.0, 0.0, 0.0)
        else:
            self.drive.steer(*self._steered)

    def _take_hand(self, name: str) -> None:
        """This arm is moved alone from now on; "": none is."""
        self._goal, self._steered, self._said = -1, np.zeros(3), ""
        if self.hand is not None and self.hand.arm != name:
            self.hand.leave()
            self.hand = None
        if name and self.hand is None:
            try:
                self.hand = OneHand(self.drive, name, self._seen, lambda: bool(self.stopped), self._now)
            except WbcError as error:
                self._said = str(error)
                raise

    def _seen(self, tick: Tick) -> None:
        """After a tick: what a page is told of the walk, where it has changed."""
        walk, arm = self.drive.walk, "" if self.hand is None else self.hand.arm
        shown = (walk.swinging, walk.progress.step, walk.structure, arm, self._said, self.drive.reason, self.waiting)
        if len(shown) != len(self._shown) or any(
            one is not other for one, other in zip(shown, self._shown, strict=True)
        ):
            self._shown = shown
            ways, reserved = [], set()
            if (swinging := walk.swinging) is not None:
                ways.append(_way(swinging.law.places))
                if swinging.hold >= 0 and not swinging.dropped:
                    reserved.add(walk.structure.ids[swinging.hold])
            coming = walk.plan.laws[walk.progress.next :][:1] if swinging is None else ()
            ways += [_way(law.places) for law in coming]
            if walk.progress.step is not None:
                reserved.add(walk.progress.step.target)
            there = set(walk.structure.ids)
            self.note = {
                "arm": arm,
                "reason": self._said or self.drive.reason,
                "waiting": self.waiting,
                "reserved": sorted(reserved),
                "gone": [hold for hold in self._begins if hold not in there],
                "ways": ways,
            }
        self._on_tick(tick)

    def _course(self) -> Array:
        """Straight for the hold that was clicked, until the body is over it."""
        walk, steering = self.drive.walk, self.drive.steering
        place, off = walk.structure.positions[self._goal], walk.q[:3]
        along = float(steering.axis @ (place - off))
        if steering.origin is None:
            across = float(np.cross(steering.normal, steering.axis) @ (place - off))
        else:
            one, other = (_flat(point - steering.origin, steering.axis) for point in (off, place))
            across = float(np.arctan2(steering.axis @ np.cross(one, other), one @ other)) * float(np.linalg.norm(one))
        left = np.array([across, along, 0.0])
        distance = float(np.linalg.norm(left))
        if distance < THERE:
            self._goal = -1
            return np.zeros(3)
        course = BODY_SPEED[0] * left / distance
        before = self.drive.command
        # Every other command is planned anew, so that one that is good enough stays
        if before[:2].any() and float(before @ course) > np.cos(OFF) * np.linalg.norm(before) * np.linalg.norm(course):
            return np.asarray(before)
        return np.asarray(course)

    def _approve(self, step: Regrasp) -> bool:
        name = f"{step.arm}: {step.source} -> {step.target}"
        if self._approved == name:
            self._approved = ""
            return True
        self.waiting = name
        return False


def climb(
    seconds: float | None = None,
    *,
    backend: str = "auto",
    announce: Callable[[Viewer], None] | None = None,
    structure: str = "cylinder",
    **options: Any,
) -> None:
    """The three-armed walker on a structure in real time, driven from the page, until it or the time ends.

    Args:
        structure: as of :class:`wbc.walking.run.request.Site`. options: as of :func:`wbc.viewer.show`.

    Raises:
        NoPlanError: it cannot stand there. What :func:`wbc.viewer.show` raises.
    """
    walker = robots.walker()
    mode = DriveMode(DriveRequest(Site(structure), commands="page"), walker, _Nobody())
    plan, stack = mode.plan(), mode.compiled(backend)
    walk = mode.walk(plan, stack, None)
    operation = WalkOperation(Drive(walk), on_tick=lambda _tick: shown())
    scenery = scenery_of(walker, walk.structure, walk.q)
    with show(stack.controller, operation=operation, scenery=scenery, **options) as viewer:
        if announce is not None:
            announce(viewer)
        paced = ticks(viewer, walk.dt, seconds)

        def shown() -> None:
            """In the middle of a hand's motion as well: its page is told, and what it says is obeyed."""
            if walk.step is not None:
                viewer.update(walk.step, walk.time)
            if next(paced, END) is END:
                operation.stop("the viewer has ended")

        while viewer.running and (seconds is None or walk.time < seconds):
            try:
                operation.tick()
            except WbcError as error:
                operation.stop(str(error))
                shown()


class _Nobody:
    """Commands of a mode that is carried out here."""

    def rates(self, time: float) -> Array | None:
        return np.zeros(3)


def _way(places: Array) -> list[list[float]]:
    """Some points of a way."""
    chosen = np.linspace(0, len(places) - 1, POINTS).round().astype(int)
    return [[float(x) for x in place] for place in places[chosen]]


def _flat(off: Array, axis: Array) -> Array:
    """Across an axis."""
    return np.asarray(off - (off @ axis) * axis)
