"""The posture of the two-ended arm between two holds: one for each pair, so that stances can be searched."""

from __future__ import annotations

from math import radians
from typing import NamedTuple

import numpy as np

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.arms.two_ended import TwoEndedKinematics
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.grips.rolls import frame_on
from wbc.walking.two_ended.shapes import ArmShapes

#: Angles of joint 1 that are tried, from limit to limit
ROLLS = 217
#: What is kept of the joint limits [rad]
ANGLE_ROOM = radians(2.0)
#: What a squared angle costs: the rolls, the yaws, the pitches at the hands, the elbow
WEIGHTS = np.array([0.1, 1.0, 0.02, 0.0, 0.02, 1.0, 0.1])
#: Postures whose clearance is looked at together, the best first
TOGETHER = 16


class Grip(NamedTuple):
    """A hand on a hold (its row), at one of its rolls (its number)."""

    hold: int
    roll: int


class PairPostures:
    """Postures of pairs of grips, the first hand's and the second's; what was computed is kept.

    Of all postures in closed form, over joint 1, that keep their limits and the clearance, and whose elbow is bent to
    the same side (joint 4 > 0), the one with the least sum of weighted squared angles.
    """

    def __init__(self, walker: Walker, structure: Structure) -> None:
        self.shapes, self.structure = ArmShapes(walker, structure), structure
        self.kinematics = TwoEndedKinematics(self.shapes.data)
        self.limit = self.shapes.data.position_limit - ANGLE_ROOM
        self._rolls = np.linspace(-self.limit, self.limit, ROLLS)
        self._known: dict[tuple[Grip, Grip], Array | None] = {}

    def frame(self, grip: Grip) -> Array:
        """The hand of a grip in the structure ``[4, 4]`` [m]."""
        return frame_on(self.structure, grip.hold, grip.roll)

    def between(self, near: Grip, far: Grip) -> Array | None:
        """Joints 1 to 7 ``[7]`` [rad]; None where there is no posture."""
        key = near, far
        if key not in self._known:
            self._known[key] = self._best(near, far)
        return self._known[key]

    def _best(self, near: Grip, far: Grip) -> Array | None:
        base, target = self.frame(near), self.frame(far)
        pose = np.linalg.inv(base) @ target
        found, valid = self.kinematics.inverse(np.repeat(pose[None], ROLLS, axis=0), self._rolls)
        found[..., 0] = self._rolls[:, None]
        q = found[valid & (np.abs(found).max(axis=-1) <= self.limit) & (found[..., 3] > 0.0)]
        ends = np.stack([base[:3, 3], target[:3, 3]])[:, None]
        order = np.argsort(np.round(q**2 @ WEIGHTS, 9), kind="stable")
        for begin in range(0, len(order), TOGETHER):
            some = q[order[begin : begin + TOGETHER]]
            clear = self.shapes.clear(base @ self.kinematics.frames(some), ends)
            if clear.any():
                return np.asarray(some[np.argmax(clear)])
        return None
