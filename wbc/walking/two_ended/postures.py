"""The posture of the two-ended arm between two holds, one for each pair, so that stances can be searched."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wbc.geometry import segment_distances
from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.arms.two_ended import TwoEndedKinematics
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.grips.rolls import frame_on

#: Pairs of the capsules near tip, first boom, second boom, far tip that may meet: those of the robot's self pairs
PAIRS = ((0, 1), (0, 2), (0, 3), (1, 3), (2, 3))
#: Angles of joint 1 that are tried, from limit to limit
ROLLS = 217
#: What a squared angle costs: the rolls, the yaws, the pitches at the hands, the elbow
WEIGHTS = np.array([0.1, 1.0, 0.02, 0.0, 0.02, 1.0, 0.1])
#: Postures whose clearance is looked at together, the best first
TOGETHER = 16


def touching_distance(walker: Walker) -> float:
    """A hand of the two-ended arm this near to its hold may touch what the hold stands on [m]: half its width, the
    clearance and what the plan keeps.

    Raises:
        ShapeError: another machine.
    """
    radius = walker.two_ended_data.wrist_radius
    return radius + walker.tolerances.clearance + 2 * walker.margins.held_clearance


class ArmShapes:
    """Four capsules about the tips and booms of the two-ended arm.

    Args:
        walker: the two-ended arm. structure: what it stands on.

    Attributes:
        kinematics: of the arm. least: distance of its links from anything but its own radius [m].
        exempt: a hand this near to its hold may touch what the hold stands on [m].

    Raises:
        ShapeError: another machine.
    """

    def __init__(self, walker: Walker, structure: Structure) -> None:
        self.exempt, self._structure = touching_distance(walker), structure
        self.kinematics = TwoEndedKinematics(walker.two_ended_data)
        self.least = walker.tolerances.clearance + walker.margins.held_clearance
        self._radii = np.array(self.kinematics.radii)

    def clear(self, frames: Array, ends: Array) -> NDArray[np.bool_]:
        """Whether postures keep their clearance.

        Args:
            frames: frames 0 to 7 in the structure ``[n, 8, 4, 4]`` [m].
            ends: holds that the near and the far hand leave or come to ``[2, k, 3]`` [m].

        Returns:
            ``[n]``.
        """
        points = self.kinematics.points_of(frames)
        starts, stops = (points[:, [link[end] for link in self.kinematics.links]] for end in (0, 1))
        free = self._structure.segment_clearance(starts, stops) - self._radii - self.least
        for tip, hand, holds in ((0, 0, ends[0]), (3, 7, ends[1])):
            places = frames[:, hand, :3, 3]
            near = np.linalg.norm(places[:, None] - holds, axis=2).min(axis=1) <= self.exempt
            free[near, tip] = np.inf
        i, j = np.array(PAIRS).T
        gaps = segment_distances(*(side[:, k] for k in (i, j) for side in (starts, stops)))
        apart = gaps - self._radii[i] - self._radii[j] - self.least
        out: NDArray[np.bool_] = (free >= 0.0).all(axis=1) & (apart >= 0.0).all(axis=1)
        return out


def from_hand_to_hand(near: Array, far: Array) -> Array:
    """Joints 1 to 7, or their rates, from those of both arms, which are from the body outwards ``[3]``, ``[4]``."""
    return np.concatenate([near[::-1], far])


def from_body_outwards(joints: Array, arm: int) -> Array:
    """Those of one arm (0 or 1) of joints 1 to 7 ``[..., 7]``: ``[..., 3]`` or ``[..., 4]``."""
    return joints[..., 2::-1] if arm == 0 else joints[..., 3:]


class Grip(NamedTuple):
    """A hand on a hold (its row), at one of its rolls (its number)."""

    hold: int
    roll: int


class PairPostures:
    """Postures of pairs of grips, the first hand's and the second's; results are cached.

    Of all postures in closed form, over joint 1, that keep their limits and the clearance, and whose elbow is bent to
    the same side (joint 4 > 0), the one with the least sum of weighted squared angles.
    """

    def __init__(self, walker: Walker, structure: Structure) -> None:
        self.shapes, self.structure = ArmShapes(walker, structure), structure
        self.kinematics, self.margins = self.shapes.kinematics, walker.margins
        self.limit = self.kinematics.position_limits[0] - self.margins.held_angle
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
