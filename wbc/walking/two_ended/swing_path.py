"""A swing of the two-ended arm as a path of all seven joints: one hand holds, the other one goes from hold to hold."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.trajectory import spline_path, time_optimal
from wbc.validation import Array
from wbc.walking.planner.swings.curve import step
from wbc.walking.planner.swings.law import SwingLaw
from wbc.walking.two_ended.postures import Grip, PairPostures

#: Points of a swing, heights at which it is computed, and parts at its ends in which the hand does not go across
POINTS, HEIGHTS, UPRIGHT = 73, 17, 0.2
#: How high hands go along the normals of their holds, with booms of BOOM [m]; the first that is clear is taken
LIFTS, BOOM = (1.0, 2.0, 4.0), 7.11
#: Intervals of the time law
INTERVALS = 300
#: From height to height no joint turns further [rad], else it is another branch
SMOOTH = 0.5


@dataclass(frozen=True)
class Turn:
    """A stance that changes: the arm (0 or 1) that swings, its grips before and after, and the grip of the other."""

    arm: int
    source: Grip
    target: Grip
    held: Grip


class TurnPaths:
    """Paths of swings, each made of the postures over the two holds, h above them, one after the other:

        q(x) = (1 - y) a(h) + y b(h),    h = L (1 - (1 - 2x)^2),    y = step((x - c) / (1 - 2c))

    a and b are in closed form with joint 1 at rest, so the hand leaves and arrives straight along the normals.
    """

    def __init__(self, postures: PairPostures) -> None:
        self.postures = postures
        self._known: dict[Turn, Array | None] = {}
        data, margins = postures.kinematics.data, postures.margins
        self._fastest = margins.swing_rate * data.joint_rate
        self._hardest = margins.swing_acceleration * data.joint_rate / data.acceleration_time

    def path(self, turn: Turn) -> Array | None:
        """Joints 1 to 7 along the first path that is possible and clear ``[POINTS, 7]`` [rad]; None if none is."""
        if turn not in self._known:
            scale = self.postures.kinematics.data.boom_length / BOOM
            paths = (self._made(turn, scale * lift) for lift in LIFTS)
            self._known[turn] = next((path for path in paths if path is not None), None)
        return self._known[turn]

    def seconds(self, turn: Turn) -> float:
        """A time that a swing takes about [s]: what its joints turn at full rate."""
        path = self.path(turn)
        if path is None:
            return np.inf
        turned = float(np.abs(np.diff(path, axis=0)).max(axis=1).sum())
        return turned / self._fastest + 2.0 * self.postures.kinematics.data.acceleration_time

    def from_air(self, turn: Turn, stop: Array) -> Array | None:
        """As :meth:`path`, of a hand in the air, which goes straight across or first up along its own axis.

        Args:
            turn: its source does not count. stop: joints as they come to rest ``[n, 7]`` [rad].
        """
        joints, target = stop[-1], self.postures.frame(turn.target)[:3, 3]
        held, pose = self.postures.frame(turn.held), self.postures.kinematics.forward(joints)
        hand = held @ (np.linalg.inv(pose) if turn.arm == 0 else pose)
        # A hand that is still near to what the hold is on that it has left or was about to take goes up first
        free, scale = self._clear(turn, stop, target), self.postures.kinematics.data.boom_length / BOOM
        left = target if free else hand[:3, 3]
        if not free and not self._clear(turn, stop, left):
            return None
        heights = ((up * scale, lift * scale) for lift in LIFTS for up in ((0.0, lift) if free else (lift,)))
        paths = (self._joined(turn, joints, hand, up, lift, left) for up, lift in heights)
        return next((path for path in paths if path is not None), None)

    def stop(self, joints: Array, rates: Array, spacing: float) -> Array:
        """Joints that come to rest together, every ``spacing`` [s], with the accelerations of swings ``[n, 7]`` [rad];
        from half of it before, so that the first step has their rates.

        Args:
            joints, rates: where they are ``[7]`` [rad] and how fast [rad/s].
        """
        count = int(np.ceil(np.abs(rates).max() / self._hardest / spacing + 0.5))
        times = (np.arange(count + 1.0)[:, None] - 0.5) * spacing
        out: Array = joints + rates * (times - 0.5 * np.maximum(times, 0.0) ** 2 / times[-1])
        return out

    def timed(self, path: Array, spacing: float) -> Array:
        """Joints in the least time under the limits, every ``spacing`` [s], from rest to rest ``[n, 7]`` [rad]."""
        law = time_optimal(spline_path(path), velocity=self._fastest, acceleration=self._hardest, intervals=INTERVALS)
        count = int(np.ceil(law.duration / spacing))
        return np.asarray(law.at(np.linspace(0.0, law.duration, count + 1)).position)

    def _made(self, turn: Turn, lift: float) -> Array | None:
        first, hand = self.postures.between(*self.pair(turn, turn.source)), self.postures.frame(turn.source)
        return None if first is None else self._joined(turn, first, hand, lift, lift, hand[:3, 3])

    def _joined(self, turn: Turn, first: Array, hand: Array, up: float, lift: float, left: Array) -> Array | None:
        """A path from a posture whose hand has a frame, first ``up`` [m], with ``lift`` above the target [m].

        Args:
            left: where the hand may be near to what a hold is on [m].
        """
        last = self.postures.between(*self.pair(turn, turn.target))
        if last is None:
            return None
        x = np.linspace(0.0, 1.0, POINTS)
        height = 1.0 - (1.0 - 2.0 * x) ** 2
        leaving = self._over(turn, hand, first, up)
        coming = self._over(turn, self.postures.frame(turn.target), last, lift)
        if leaving is None or coming is None:
            return None
        grid = np.linspace(0.0, 1.0, HEIGHTS)
        a, b = (np.stack([np.interp(height, grid, q[:, k]) for k in range(7)], axis=1) for q in (leaving, coming))
        y = step((x - UPRIGHT) / (1.0 - 2.0 * UPRIGHT))[:, None]
        path: Array = (1.0 - y) * a + y * b
        if np.abs(path).max() > max(self.postures.limit, np.abs(first).max()):
            return None
        return path if self._clear(turn, path, left) else None

    def pair(self, turn: Turn, grip: Grip) -> tuple[Grip, Grip]:
        """Grips of the near and of the far hand."""
        return (grip, turn.held) if turn.arm == 0 else (turn.held, grip)

    def _over(self, turn: Turn, hand: Array, q: Array, lift: float) -> Array | None:
        """Postures with the swinging hand 0 to ``lift`` above where it has a frame ``[HEIGHTS, 7]``, from ``q`` on."""
        postures = self.postures
        held = postures.frame(turn.held)
        raised = np.repeat(hand[None], HEIGHTS, axis=0)
        raised[:, :3, 3] -= np.linspace(0.0, lift, HEIGHTS)[:, None] * hand[:3, 2]
        pose = np.linalg.inv(raised) @ held if turn.arm == 0 else np.linalg.inv(held) @ raised
        found, valid = postures.kinematics.inverse(pose, q[0])
        out = np.empty((HEIGHTS, 7))
        last = q
        for k in range(HEIGHTS):
            near = postures.kinematics.unwound(found[k], last)
            far = np.where(valid[k], np.abs(near - last).max(axis=1), np.inf)
            best = int(np.argmin(far))
            if far[best] > SMOOTH:
                return None
            out[k] = last = near[best]
        return out

    def _clear(self, turn: Turn, path: Array, left: Array) -> bool:
        held, target = (self.postures.frame(grip)[:3, 3] for grip in (turn.held, turn.target))
        ends = np.array([[left, target], [held, held]])
        return bool(self.postures.shapes.clear(self.frames(turn, path), ends[:: 1 - 2 * turn.arm]).all())

    def frames(self, turn: Turn, q: Array) -> Array:
        """Frames 0 to 7 in the structure at postures ``[n, 7]`` while the other hand holds: ``[n, 8, 4, 4]`` [m]."""
        local = self.postures.kinematics.frames(q)
        held = self.postures.frame(turn.held)
        if turn.arm == 1:
            return np.asarray(held @ local)
        return np.asarray(held @ np.linalg.inv(local[:, 7])[:, None] @ local)


class TurnLaw(SwingLaw):
    """A table of the hand that swings and of all joints of its arm, from the lift to the landing.

    Args:
        hands: positions of the hand ``[n, 3]`` [m]. joints: of its arm, from the body outwards ``[n, joints]`` [rad].
        spacing: from row to row [s].
    """

    def __init__(self, hands: Array, joints: Array, spacing: float) -> None:
        times = np.linspace(0.0, (len(hands) - 1) * spacing, len(hands))
        super().__init__(times, hands, times / times[-1])
        self._joints = joints

    def posture(self, time: float) -> Array:
        """Joints at a time, clipped to the swing ``[joints]`` [rad]."""
        place = min(max(time / self.duration, 0.0), 1.0) * (len(self._joints) - 1)
        row = min(int(place), len(self._joints) - 2)
        out: Array = self._joints[row] + (place - row) * (self._joints[row + 1] - self._joints[row])
        return out

    def found(self, q: Array, v: Array) -> tuple[float, float]:
        """The time at which the joints are nearest to a posture ``[joints]`` [rad], and the pace from 0 to 1 that their
        rates are of its own there [rad/s].
        """
        row, part, _ = self._nearest(q)
        rates = (self._joints[row + 1] - self._joints[row]) / self.spacing
        pace = float(v @ rates / max(float(rates @ rates), 1e-12))
        return (row + part) * self.spacing, min(max(pace, 0.0), 1.0)

    def off(self, q: Array) -> float:
        """How far a posture ``[joints]`` is from the nearest one of the swing [rad]."""
        return self._nearest(q)[2]

    def _nearest(self, q: Array) -> tuple[int, float, float]:
        """Row, part of the way to the next one, and distance [rad] of the posture that is nearest to another one."""
        rows = self._joints
        spans, offs = np.diff(rows, axis=0), q - rows[:-1]
        squares = np.maximum((spans * spans).sum(axis=1), 1e-18)
        parts = np.clip((offs * spans).sum(axis=1) / squares, 0.0, 1.0)
        far = np.linalg.norm(offs - parts[:, None] * spans, axis=1)
        row = int(far.argmin())
        return row, float(parts[row]), float(far[row])
