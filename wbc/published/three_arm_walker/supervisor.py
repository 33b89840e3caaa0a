"""The supervisor: start, modes one after the other, all arms set down between them. Inch, radian, second.

A mode ends when its key is pressed, its time is over, its end is reached, or a joint would leave its limits; then every
arm in the air is set down. Nothing of a cycle that ends in a fault is carried out.

Source: M. R. Patterson's thesis, 3.3 and the listing MAIN. SETDWN is not listed; here an arm goes to the hold of its
list that is nearest to the middle of its reach, outward from the body:

    b + (b - o) / |b - o| (radius + r) / 2
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from wbc.published.three_arm_walker.gait.gait import LATE, Gait, Lift
from wbc.published.three_arm_walker.gait.holds import handholds
from wbc.published.three_arm_walker.machine.grid import Place
from wbc.published.three_arm_walker.machine.motion import CYCLE
from wbc.published.three_arm_walker.machine.plant import Fault, WalkerPose, body_place, body_twist
from wbc.published.three_arm_walker.machine.reach import ARMS, INNER, View
from wbc.published.three_arm_walker.modes import ArmMotion, WalkCommand
from wbc.published.three_arm_walker.record import WalkerRecorder
from wbc.validation import Array

Reason = Literal["key", "time", "reached", "limits", "no hold"]

#: Whether a mode ends now: called with its time [s] and the body's (T, A, heading)
Key = Callable[[float, Array], bool]


@dataclass(frozen=True)
class PublishedOutcome:
    """How a mode ended.

    Attributes:
        reason: ``key``, ``time``, ``reached``, ``limits`` (a joint), ``no hold`` (it did not begin).
        time: of the mode [s]. message: as the walker prints it.
        joint, arm: of the fault, from 1; None without one.
        set_down: whether all arms hold now. rows: of the log, those of the mode.
        lifts, replans: of the mode, in the order of time.
    """

    reason: Reason
    time: float
    message: str
    joint: int | None
    arm: int | None
    set_down: bool
    rows: slice
    lifts: tuple[Lift, ...]
    replans: tuple[Lift, ...]


class Supervisor:
    """MAIN: a gait on a plant."""

    def __init__(self, gait: Gait, plant: WalkerPose) -> None:
        self.gait, self.plant = gait, plant
        self.recorder = WalkerRecorder()

    @property
    def place(self) -> Array:
        """(T, A, heading [rad]) of the body."""
        return np.array(body_place(self.plant.body))

    def walk(self, command: WalkCommand, key: Key, duration: float = np.inf) -> PublishedOutcome:
        """A mode of walking, until it ends by itself, by key, or by time [s]."""

        def cycle(place: Array) -> Fault | Reason | None:
            rates = command(self.gait.time, place)
            if rates is None:
                return "reached"
            self.recorder.add(self.plant, self.gait, rates)
            twist = body_twist(self.plant.body, rates, self.gait.shoulders.height)
            return self.plant.move(twist, self.gait.step(self.plant, twist))

        return self._mode(cycle, key, duration)

    def control_arm(self, task: ArmMotion, key: Key, duration: float = np.inf) -> PublishedOutcome:
        """Arm control with the body standing, until the arm is done, by key, or by time [s]."""

        def cycle(place: Array) -> Fault | Reason | None:
            if not self.gait.cycle:
                next(task)
            self.recorder.add(self.plant, self.gait, np.zeros(3))
            order = next(task, None)
            if order is None:
                return "reached"
            return order if isinstance(order, Fault) else self.plant.move(np.zeros(6), order)

        return self._mode(cycle, key, duration)

    def set_down(self) -> Fault | None:
        """Bring every arm in the air to a hold, the body standing; the last fault on the way, if there was one."""
        fault = None
        for arm in range(ARMS):
            if not self.gait.supporting[arm]:
                fault = self._set_down(arm) or fault
        return fault

    def _set_down(self, arm: int) -> Fault | None:
        place = self._resting_place(arm)
        if place is None:
            return None
        motion = self.gait.swing(arm, self.plant, place)
        self.gait.start(arm, motion, place)
        for _ in range(int((motion.duration + LATE) / CYCLE) + 1):
            self.recorder.add(self.plant, self.gait, np.zeros(3))
            command = self.gait.track(arm, self.plant)
            fault = self.plant.move(np.zeros(6), self.gait.order(arm, command))
            if fault is not None:
                return fault
            self.gait.cycle += 1
            if self.gait.supporting[arm]:
                break
        return None

    def _resting_place(self, arm: int) -> Place | None:
        view = View(self.gait.shoulders, self.plant.body)
        hand = view.place(self.plant.hands[arm][:3, 3])
        found = handholds(view, arm, hand, self.gait.terrain, None)
        if not len(found):
            return None
        outward = view.bases[arm] - view.centre
        target = view.bases[arm] + outward / np.hypot(*outward) * 0.5 * (view.shoulders.reach + INNER)
        column, row = found[int(np.hypot(*(found - target).T).argmin())]
        return int(column), int(row)

    def _mode(self, cycle: Callable[[Array], Fault | Reason | None], key: Key, duration: float) -> PublishedOutcome:
        fault = self.set_down()
        self.gait.restart()
        first = len(self.recorder.rows)
        arm = self.gait.in_air
        if arm is not None:
            if fault is not None:
                return self._ended("limits", str(fault), first, fault)
            return self._ended("no hold", f"ARM {arm + 1} IS ON NO HANDHOLD.", first)
        while True:
            place = self.place
            if key(self.gait.time, place):
                return self._ended("key", "STOPPED BY KEY", first)
            if self.gait.time >= duration:
                return self._ended("time", "STOPPED BY TIME", first)
            result = cycle(place)
            if isinstance(result, Fault):
                return self._ended("limits", str(result), first, result)
            if result is not None:
                return self._ended(result, "TERMINAL POSITION REACHED", first)
            self.gait.cycle += 1

    def _ended(self, reason: Reason, message: str, first: int, fault: Fault | None = None) -> PublishedOutcome:
        """The mode's outcome, all arms being set down."""
        gait = self.gait
        time, rows = gait.time, slice(first, len(self.recorder.rows))
        joint, arm = (None, None) if fault is None else (fault.joint, fault.arm)
        if reason == "no hold" and gait.in_air is not None:
            arm = gait.in_air + 1
        else:
            self.set_down()
        moves = tuple(gait.lifts), tuple(gait.replans)
        return PublishedOutcome(reason, time, message, joint, arm, gait.in_air is None, rows, *moves)
