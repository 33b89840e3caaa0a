"""One hand of a walk that stands, moved from a page: by rates, or to a hold."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from wbc.validation import Array
from wbc.viewer.messages import RATE_LASTS
from wbc.walking.loop.state import Tick
from wbc.walking.modes.arm_mode import ArmMode, ArmStopped
from wbc.walking.modes.drive import Drive
from wbc.walking.modes.hand_motion import ArmRefused

#: Rates at full stick [m/s, rad/s]
HAND_SPEED = np.array([0.08, 0.08, 0.08, 0.4])
#: How far ahead a motion by rates is proved clear, at best; where it is not, less is tried [s]
SHARES = (2.0, 1.0, 0.4)
#: Rates that differ by more than this begin another motion
OTHER = 0.1


class OneHand:
    """A hand that a page moves while the others hold and the body stands.

    A motion is proved clear before it begins, a second or two ahead; it ends within the hand's stop where the page lets
    go, asks for other rates or stops the robot.

    Args:
        drive: of a walk that stands. arm: name. on_tick: called after every tick of a motion. ended: asked before
            every tick, true where the robot is stopped. now: a clock [s].

    Raises:
        ArmRefused: the body moves, or too few of the other hands hold.
    """

    def __init__(
        self,
        drive: Drive,
        arm: str,
        on_tick: Callable[[Tick], Any],
        ended: Callable[[], bool],
        now: Callable[[], float],
    ) -> None:
        self.arm, self._drive, self._now, self._ended = arm, drive, now, ended
        self._mode = ArmMode(drive.walk, arm, on_tick, self._lets_go)
        self._rates, self._begun, self._until, self._hold = np.zeros(4), np.zeros(4), 0.0, ""

    def ask(self, rates: Array) -> None:
        """Parts of full speed: round, along, off the structure, and turning about the hand's axis [4]."""
        self._rates, self._until, self._hold = rates, self._now() + RATE_LASTS, ""

    def go(self, hold: str) -> None:
        """To a hold, and close there."""
        self._hold, self._rates = hold, np.zeros(4)

    def move(self) -> str:
        """All of the motion that is asked for now; why there is none, "" where there was or nothing is asked for."""
        hold, self._hold = self._hold, ""
        self._begun = self._rates if self._now() < self._until else np.zeros(4)
        try:
            if hold:
                self._begun = np.zeros(4)
                self._mode.to_hold(hold)
            elif self._begun.any():
                return self._by_rate()
        except ArmStopped:
            pass
        except ArmRefused as refusal:
            return str(refusal)
        return ""

    def leave(self) -> None:
        """The hand, where it is in the air, goes to a hold that the walk can go on from."""
        walk = self._drive.walk
        self._mode.leave()
        if len(walk.held) < len(walk.walker.arms):
            walk.set_down()

    def _by_rate(self) -> str:
        twist, reason = self._twist(), ""
        for seconds in SHARES:
            try:
                self._mode.by_rate(twist, seconds)
                return ""
            except ArmRefused as refusal:
                reason = str(refusal)
        return reason

    def _twist(self) -> Array:
        """Along the structure's directions where the hand is (linear; angular) [m/s, rad/s]."""
        steering, pose = self._drive.steering, self._mode.pose
        outward = -steering.normal
        if steering.origin is not None:
            off = pose.translation - steering.origin
            off = off - steering.axis * float(steering.axis @ off)
            outward = off / np.linalg.norm(off)
        rates = HAND_SPEED * self._begun
        axes = np.array([np.cross(steering.axis, outward), steering.axis, outward])
        return np.concatenate([rates[:3] @ axes, rates[3] * pose.rotation[:, 2]])

    def _lets_go(self) -> bool:
        """The page asks for something else than what is carried out."""
        if self._ended():
            return True
        if not self._begun.any():
            # On its way to a hold
            return bool(self._now() < self._until and self._rates.any())
        return bool(self._hold or self._now() > self._until or np.abs(self._rates - self._begun).max() > OTHER)
