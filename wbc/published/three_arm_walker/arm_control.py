"""Arm control: the body stands on two arms, the third is a manipulator. Units: inch, radian, second.

    handhold       a place of the grid: the arm goes there and grasps
    destination    a sequence of hand poses: the computer makes the motion
    velocity       the hand's translation (joystick) and rotation (dials), turned into joint rates

Source: M. R. Patterson's thesis, 3.3; the routine is not listed. Hand poses and twists are in the fixed frame.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from wbc.published.three_arm_walker.gait.gait import Gait
from wbc.published.three_arm_walker.machine.body import moved
from wbc.published.three_arm_walker.machine.grid import Place
from wbc.published.three_arm_walker.machine.motion import BodyMotion
from wbc.published.three_arm_walker.machine.plant import CycleCommand, Fault, WalkerPose
from wbc.validation import Array


class ArmMotion(Protocol):
    """A sub-mode of arm control."""

    def start(self, gait: Gait, plant: WalkerPose) -> None:
        """The arm lets go."""

    def step(self, gait: Gait, plant: WalkerPose) -> CycleCommand | Fault | None:
        """What the arms do in this cycle; None once it is done."""


class Handhold:
    """An arm, 0 to 2, goes to a place and grasps."""

    def __init__(self, arm: int, place: Place) -> None:
        self.arm, self.place = arm, place

    def start(self, gait: Gait, plant: WalkerPose) -> None:
        gait.start(self.arm, gait.swing(self.arm, plant, self.place), self.place)

    def step(self, gait: Gait, plant: WalkerPose) -> CycleCommand | Fault | None:
        command = gait.track(self.arm, plant)
        if gait.supporting[self.arm]:
            return None
        return _tracked(gait, self.arm, gait.order(self.arm, command))


class Destination:
    """An arm, 0 to 2, takes its hand past poses, 4 x 4 each, to the last."""

    def __init__(self, arm: int, poses: Sequence[Array]) -> None:
        self.arm, self.poses = arm, list(poses)

    def start(self, gait: Gait, plant: WalkerPose) -> None:
        motion = BodyMotion([plant.hands[self.arm], *self.poses], gait.calibration)
        gait.start(self.arm, motion, None)

    def step(self, gait: Gait, plant: WalkerPose) -> CycleCommand | Fault | None:
        command = gait.track(self.arm, plant)
        if gait.arrived:
            return None
        return _tracked(gait, self.arm, gait.order(self.arm, command))


class Velocity:
    """An arm, 0 to 2, moves its hand at the twist given at each time, fixed axes [in/s, rad/s]; a key ends it."""

    def __init__(self, arm: int, given: Callable[[float], Array]) -> None:
        self.arm, self.given = arm, given

    def start(self, gait: Gait, plant: WalkerPose) -> None:
        gait.start(self.arm, None, None)

    def step(self, gait: Gait, plant: WalkerPose) -> CycleCommand | Fault | None:
        twist = np.asarray(self.given(gait.time), dtype=float)
        joint = plant.place(self.arm, moved(plant.hands[self.arm], twist))
        return gait.order(self.arm, twist) if joint is None else Fault(joint, self.arm + 1)


def _tracked(gait: Gait, arm: int, order: CycleCommand) -> CycleCommand | Fault:
    """The order, or the joint that keeps an ideally tracked hand from its motion."""
    return order if gait.blocked is None else Fault(gait.blocked, arm + 1)
