"""What a controller knows of an object: nothing, the truth, measurements as they come, or an estimate from these."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from wbc.estimation import DropoutPolicy, FrameMotion, PoseFilter, PoseStream, StreamState
from wbc.moving_target.motions import TargetMotion
from wbc.multibody import pin
from wbc.validation import Array

#: Measurements begin this long before the trial, as long as a filter takes to settle [s]
BEFORE = 1.0


class Knowledge(StrEnum):
    """What the controller is told of the object.

    ``NONE``: where it was at first, no compensation. ``POSE``: its exact pose. ``TWIST``: and its exact twist and
    acceleration, which are fed forward. ``LATE``: measured poses as they come, late and noisy. ``ESTIMATED``: the same
    through a filter that predicts the present pose and twist.
    """

    NONE = "none"
    POSE = "pose"
    TWIST = "twist"
    LATE = "late"
    ESTIMATED = "estimated"


@dataclass(frozen=True)
class Measurement:
    """What measures the object: standard deviations [m, rad], latency [s], period [s], and how often per second
    measurements stop coming, and for how long [s].
    """

    noise: tuple[float, float] = (0.5e-3, 0.5e-3)
    latency: float = 0.05
    period: float = 0.01
    dropouts: float = 0.0
    dropout: float = 0.2


class Known:
    """What the controller knows of one object over time.

    Args:
        process: restlessness that the filter assumes, see :class:`wbc.estimation.PoseFilter`. rng: of the measurements.
    """

    def __init__(
        self,
        knowledge: Knowledge,
        motion: TargetMotion,
        measurement: Measurement,
        process: tuple[float, float],
        policy: DropoutPolicy,
        rng: np.random.Generator,
    ) -> None:
        self._kind, self._motion, self._rng, self._m = knowledge, motion, rng, measurement
        self._next, self._quiet = -BEFORE, -np.inf
        self._waiting: list[tuple[float, pin.SE3]] = []
        self._stream = PoseStream(PoseFilter(np.maximum(measurement.noise, 1e-6), process), policy)
        self._first = motion.at(0.0)
        self._last = self._first.pose

    def at(self, t: float, true: FrameMotion) -> tuple[FrameMotion, bool]:
        """What is believed where ``true`` is the case, and whether the object is lost."""
        if self._kind is Knowledge.TWIST:
            return true, False
        if self._kind is Knowledge.NONE:
            return _still(self._first.pose), False
        if self._kind is Knowledge.POSE:
            return _still(true.pose), False
        self._arrive(t)
        if self._kind is Knowledge.LATE:
            return _still(self._last), False
        found = self._stream.at(t)
        return FrameMotion(found.pose, found.twist, found.acceleration), found.state is StreamState.LOST

    def _arrive(self, t: float) -> None:
        """Take the measurements that are there by now; noise is drawn when one is taken."""
        while self._next <= t + 1e-9:
            if self._rng.random() < self._m.dropouts * self._m.period:
                self._quiet = self._next + self._m.dropout
            if self._next >= self._quiet:
                true, error = self._motion.at(self._next).pose, self._rng.normal(size=6)
                place = true.translation + self._m.noise[0] * error[:3]
                pose = pin.SE3(pin.exp3(self._m.noise[1] * error[3:]) @ true.rotation, place)
                self._waiting.append((self._next, pose))
            self._next += self._m.period
        while self._waiting and self._waiting[0][0] + self._m.latency <= t + 1e-9:
            stamp, self._last = self._waiting.pop(0)
            if self._kind is Knowledge.ESTIMATED:
                self._stream.push(stamp, self._last)


def _still(pose: pin.SE3) -> FrameMotion:
    zero: Array = np.zeros(6)
    return FrameMotion(pose, zero, zero)
