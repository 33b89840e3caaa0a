"""Motions of one hand while the body stands: joint angles along poses, checked before anything moves."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import ceil

import numpy as np

from wbc.errors import WbcError
from wbc.multibody import pin
from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.arms.puma import LIMIT_NAMES, ArmKinematics
from wbc.walking.loop.foresight import Foresight

#: Parts of joint rates and accelerations that motions use, and margin to the other limits [rad]
PART, MARGIN = 0.9, 0.01
#: Motions that ask too much of a joint are made slower, by this factor and at most so often
SLOWER, TRIES = 1.25, 12
#: A hand within this of a waypoint is there [m, rad]
THERE = 1e-9


class ArmRefused(WbcError):
    """A motion of a hand that is not possible, with the reason; nothing has moved."""


@dataclass(frozen=True)
class Standing:
    """A body that stands, and what a hand of it must stay clear of.

    Attributes:
        sight: proves motions. held: row of an arm -> row of the hold.
        arm: row of the arm that moves. body: pose of the body. q: configuration. dt: control period [s].
    """

    walker: Walker
    sight: Foresight
    held: Mapping[int, int]
    arm: int
    body: pin.SE3
    q: Array
    dt: float

    def along(self, poses: Sequence[pin.SE3], speed: float, turn_rate: float) -> Array:
        """Joints tick by tick ``[n, 6]`` [rad] from where the arm is through poses of the hand in the structure.

        From pose to pose the hand goes straight and turns about one axis with x = 10 s^3 - 15 s^4 + 6 s^5, whose top
        speed is 15 / 8 of the mean; it stops at each. Slower than asked where a joint needs it.

        Raises:
            ArmRefused: a pose out of reach, a limit, the structure or another arm is too near.
        """
        out = self._through(self.q[self.walker.arms[self.arm].q][None], poses, speed, turn_rate)
        self._check_clear(out, {})
        return out

    def onto(self, off: Sequence[pin.SE3], on: Sequence[pin.SE3], hold: int, speed: float, turn_rate: float) -> Array:
        """As :meth:`along` through ``off``, by joints to the first pose of ``on``, and straight through the others.

        The posture there is the one that is reached soonest of those that lead on.

        Args:
            hold: row of the one that the hand comes to.

        Raises:
            ArmRefused: none does; the reason is that of the last one.
        """
        kinematics, base = self._kinematics, self._base
        rows = self._through(self.q[self.walker.arms[self.arm].q][None], off, speed, turn_rate)
        found, valid = kinematics.inverse(base.actInv(on[0]).homogeneous[None])
        choices = [
            kinematics.nearest(found[:, k : k + 1], valid[:, k : k + 1], rows[-1]) for k in range(found.shape[1])
        ]
        why = ArmRefused("hold", on[-1].translation.tolist(), "out of reach")
        for q, branch, _ in sorted(choices, key=lambda choice: float(choice[2][0])):
            if branch[0] < 0:
                continue
            line = partial(_line, rows[-1], q[0] - rows[-1])
            try:
                across = self._timed(line, 0.5, "hold", on[0])
                out = self._through(np.concatenate([rows, across[1:]]), on[1:], speed, turn_rate)
                self._check_clear(out, {self.arm: hold})
            except ArmRefused as error:
                why = error
                continue
            return out
        raise why

    @property
    def _kinematics(self) -> ArmKinematics:
        return ArmKinematics(self.walker.arm_data)

    @property
    def _base(self) -> pin.SE3:
        return self.body * self.walker.arms[self.arm].base

    def _through(self, rows: Array, poses: Sequence[pin.SE3], speed: float, turn_rate: float) -> Array:
        """Rows, and from their last one straight through poses."""
        here = self._base * pin.SE3(self._kinematics.forward(rows[-1]))
        for k, pose in enumerate(poses):
            step = pin.log3(here.rotation.T @ pose.rotation)
            least = max(np.linalg.norm(pose.translation - here.translation) / speed, np.linalg.norm(step) / turn_rate)
            if least >= THERE:
                straight = partial(self._straight, (here, pose, step), rows[-1], f"poses[{k}]")
                more = self._timed(straight, 15 / 8 * float(least), f"poses[{k}]", pose)
                rows = np.concatenate([rows, more[1:]])
            here = pose
        return rows

    def _timed(self, make: Callable[[Array], Array], duration: float, field: str, pose: pin.SE3) -> Array:
        """Rows of one part of the motion, in the duration [s] or in what its joints need.

        Args:
            make: parts of the motion in [0, 1] -> rows.
        """
        data = self._kinematics.data
        for _ in range(TRIES):
            s = np.linspace(0.0, 1.0, max(ceil(duration / self.dt), 2) + 1)
            out = make(s**3 * (10.0 - 15.0 * s + 6.0 * s * s))
            first = np.abs(np.diff(out, axis=0)) / self.dt / (PART * np.array(data.joint_rates))
            second = np.abs(np.diff(out, 2, axis=0)) / self.dt**2 / (PART * np.array(data.joint_accelerations))
            worst = np.maximum(first.max(axis=0), second.max(axis=0))
            if worst.max() <= 1.0:
                return out
            duration *= SLOWER
        joint = int(worst.argmax()) + 1
        raise ArmRefused(field, pose.translation.tolist(), f"joint {joint} would have to turn too fast")

    def _straight(self, line: tuple[pin.SE3, pin.SE3, Array], start: Array, field: str, x: Array) -> Array:
        """Joints at parts x of the line from a pose to another that is turned by a step, (pose, other, step)."""
        (here, pose, step), kinematics, base = line, self._kinematics, self._base
        hands = [
            pin.SE3(here.rotation @ pin.exp3(step * part), here.translation * (1 - part) + pose.translation * part)
            for part in x.tolist()
        ]
        found, valid = kinematics.inverse(np.array([(base.actInv(h)).homogeneous for h in hands]), limits=False)
        rows = [start]
        for q, solved in zip(found[1:], valid[1:], strict=True):
            near, branch, _ = kinematics.nearest(q[None], solved[None], rows[-1])
            if branch[0] < 0:
                raise ArmRefused(field, pose.translation.tolist(), "out of reach")
            rows.append(near[0])
        out = np.array(rows)
        margins = kinematics.margins(out[1:])
        if margins.min() < min(MARGIN, float(kinematics.margins(start).min())):
            name = LIMIT_NAMES[int(margins.min(axis=0).argmin())]
            raise ArmRefused(field, pose.translation.tolist(), f"the motion leads beyond the {name}")
        return out

    def _check_clear(self, rows: Array, to: Mapping[int, int]) -> None:
        """Refuse what comes too near to the structure or to the machine itself.

        Args:
            to: row of the arm -> row of the hold that its hand comes to.
        """
        mine, held = self.walker.arms[self.arm], dict(self.held)
        q = np.repeat(self.q[None], len(rows), axis=0)
        q[:, mine.q] = rows
        sight, hold = self.sight, held.pop(self.arm, -1)
        left = sight.holds({self.arm: hold})
        if hold < 0:
            left = sight.around(self.arm, (self._base * pin.SE3(self._kinematics.forward(rows[0]))).translation)
        found = sight.nearest(np.arange(len(rows), dtype=np.float64) * self.dt, q, left, sight.holds(to), held)
        if found is not None:
            raise ArmRefused("poses", len(rows), f"the arm would come too near: {found}")


def _line(begin: Array, change: Array, x: Array) -> Array:
    """begin + x change."""
    return np.asarray(begin + x[:, None] * change)
