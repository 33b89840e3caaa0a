"""What the walker is told to do in a mode: rates of its body, or the motion of one arm. Units: inch, radian, second.

    destination    of the body: straight lines past points (T, A, heading)
    joystick       of the body: counts of three axes
    handhold       of an arm: it goes to a place of the grid and grasps
    poses          of an arm: a sequence of hand poses
    velocity       of an arm: the hand's translation (joystick) and rotation (dials), turned into joint rates

While an arm moves the body stands on the other two. Hand poses and twists are in the fixed frame. Source: M. R.
Patterson's thesis, 3.3, 5.2 and the listing MAIN; the routine of arm control is not listed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeAlias

import numpy as np

from wbc.published.three_arm_walker.gait.gait import Gait
from wbc.published.three_arm_walker.machine.grid import Place
from wbc.published.three_arm_walker.machine.motion import CYCLE, BodyMotion
from wbc.published.three_arm_walker.machine.plant import CycleCommand, Fault, WalkerPose, moved
from wbc.validation import Array

#: Rates of T and A [grid units/s] and spin [rad/s] at a time of the mode [s], the body being at (T, A, heading); None
#: at the end
WalkCommand: TypeAlias = Callable[[float, Array], Array | None]
#: The arm lets go before the first of these, which has no meaning; the others are what the arms do in each cycle
ArmMotion: TypeAlias = Iterator[CycleCommand | Fault | None]

#: Largest rates of destination control: T and A [grid units/s], heading [rad/s]
RATES = np.array([0.25, 0.25, np.radians(1.0)])

#: Counts of the joystick: dead bands and counts per unit, of T, A and the spin. The second number of the scale is
#: damaged in print ("/16000"); 100000 makes full scale the published 3 in/s, 16000 would make it 18.6 in/s
DEAD_BAND = np.array([640.0, 640.0, 1280.0])
SCALE = np.array([100000.0, 100000.0, 640000.0])


class DestinationCommand:
    """Robot destination control: straight lines in (T, A, heading), each at constant rates, none above its largest.

        rate + (desired - actual) / dt,        duration = max_i |step_i| / RATES_i

    It ends when every rate behind the last point is below ``end``. The thesis's printed bound is damaged: 1 (0.1 grid
    units, 0.1 rad) or 0.1. Headings are compared within half a turn.

    Args:
        points: (T, A, heading [rad]) each. end: [grid units/s, rad/s].
    """

    def __init__(self, points: Sequence[Sequence[float]], end: float = 1.0) -> None:
        self.points, self.end = points, end
        self.line: Waypoints | None = None

    def __call__(self, time: float, place: Array) -> Array | None:
        """See :data:`WalkCommand`."""
        if self.line is None:
            self.line = Waypoints(np.vstack([place, self.points]))
        desired, rate = self.line.at(time)
        off = desired - place
        off[2] = (off[2] + np.pi) % (2.0 * np.pi) - np.pi
        if time < self.line.times[-1]:
            return np.asarray(rate + off / CYCLE)
        rates = off / CYCLE
        return None if (np.abs(rates) <= self.end).all() else np.asarray(rates)


class Waypoints:
    """Points (T, A, heading), m + 1 x 3, passed at constant rates.

    Attributes:
        times: at which they are passed, m + 1 [s].
    """

    def __init__(self, points: Array) -> None:
        self.points = points
        self.times = np.concatenate([[0.0], np.cumsum((np.abs(np.diff(points, axis=0)) / RATES).max(axis=1))])

    def at(self, time: float) -> tuple[Array, Array]:
        """(place, rates) at a time; the last place at rest from the end on."""
        if time >= self.times[-1]:
            return self.points[-1].copy(), np.zeros(3)
        i = int(np.searchsorted(self.times, time, side="right")) - 1
        rates = (self.points[i + 1] - self.points[i]) / (self.times[i + 1] - self.times[i])
        return self.points[i] + (time - self.times[i]) * rates, rates


def joystick(counts: Sequence[float], scale: Sequence[float] = tuple(SCALE)) -> Array:
    """Rates of T and A [grid units/s] and spin [rad/s] of three axes of -32768 to 32767 counts:

    rate = sign(J) max(|J + 1| - DEAD_BAND, 0) / scale
    """
    j = np.asarray(counts, dtype=float)
    return np.asarray(np.sign(j) * np.maximum(np.abs(j + 1.0) - DEAD_BAND, 0.0) / np.asarray(scale))


def to_handhold(gait: Gait, plant: WalkerPose, arm: int, place: Place) -> ArmMotion:
    """An arm, 0 to 2, goes to a place and grasps."""
    gait.start(arm, gait.swing(arm, plant, place), place)
    yield None
    while not gait.supporting[arm]:
        command = gait.track(arm, plant)
        if not gait.supporting[arm]:
            yield _tracked(gait, arm, command)


def past_poses(gait: Gait, plant: WalkerPose, arm: int, poses: Sequence[Array]) -> ArmMotion:
    """An arm, 0 to 2, takes its hand past poses, 4 x 4 each, to the last."""
    gait.start(arm, BodyMotion([plant.hands[arm], *poses], gait.calibration), None)
    yield None
    while not gait.arrived:
        command = gait.track(arm, plant)
        if not gait.arrived:
            yield _tracked(gait, arm, command)


def at_velocity(gait: Gait, plant: WalkerPose, arm: int, given: Callable[[float], Array]) -> ArmMotion:
    """An arm, 0 to 2, moves its hand at the twist given at each time, fixed axes [in/s, rad/s]; a key ends it."""
    gait.start(arm, None, None)
    yield None
    while True:
        twist = np.asarray(given(gait.time), dtype=float)
        joint = plant.place(arm, moved(plant.hands[arm], twist))
        yield gait.order(arm, twist) if joint is None else Fault(joint, arm + 1)


def _tracked(gait: Gait, arm: int, command: Array) -> CycleCommand | Fault:
    """The order, or the joint that keeps an ideally tracked hand from its motion."""
    return gait.order(arm, command) if gait.blocked is None else Fault(gait.blocked, arm + 1)
