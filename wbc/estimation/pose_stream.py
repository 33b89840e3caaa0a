"""Poses as they come: late, out of order, now and then not at all."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from wbc import validation
from wbc.errors import SolverError
from wbc.estimation.pose_filter import FrameMotion, PoseFilter
from wbc.multibody import pin
from wbc.validation import Array


class StreamState(StrEnum):
    """What an estimate rests on: ``TRACKED``, measurements; ``HELD``, measurements too old to follow, so that the frame
    is brought to rest; ``LOST``, none: the frame stands still, and whoever works on it must stop.
    """

    TRACKED = "tracked"
    HELD = "held"
    LOST = "lost"


@dataclass(frozen=True)
class DropoutPolicy:
    """What is said of a frame while measurements fail to come.

    With ``age`` the time since the last measurement was taken, the motion is that predicted at the age s(age),

        s = age                                                age <= predict             TRACKED
        s = predict + x - x^2 / (2 hold),  x = age - predict   up to predict + hold       HELD
        s = predict + hold / 2                                 from there on              LOST

    so the frame goes on, comes to rest along its predicted path without a jump of its velocity, and stands still. The
    twist is that of this motion. A stream that was lost begins anew with the next measurement.

    Attributes:
        predict: [s], covers latency and single lost frames. hold: [s], > 0.

    Raises:
        ShapeError, NotFiniteError, RangeError: not such numbers.
    """

    predict: float = 0.3
    hold: float = 0.5

    def __post_init__(self) -> None:
        object.__setattr__(self, "predict", validation.scalar("predict", self.predict, low=0.0, unit="s"))
        object.__setattr__(self, "hold", validation.scalar("hold", self.hold, low=0.0, open_low=True, unit="s"))

    def ahead(self, age: float) -> tuple[float, float, StreamState]:
        """(s, ds/dage, state) of an age."""
        beyond = age - self.predict
        if beyond <= 0.0:
            return age, 1.0, StreamState.TRACKED
        if beyond < self.hold:
            return self.predict + beyond - beyond**2 / (2.0 * self.hold), 1.0 - beyond / self.hold, StreamState.HELD
        return self.predict + 0.5 * self.hold, 0.0, StreamState.LOST


@dataclass(frozen=True, eq=False)
class FrameEstimate:
    """A frame now: pose in the world, twist and its rate (world axes), the age of the last measurement [s], and what
    the estimate rests on.
    """

    pose: pin.SE3
    twist: Array
    acceleration: Array
    age: float
    state: StreamState


class PoseStream:
    """Time-stamped poses in, the frame's motion now out.

        stream.push(stamp, pose)                 # whenever one arrives; the stamp says when it was taken
        now = stream.at(time)                    # every tick
        controller["table"].set(pose=now.pose, twist=now.twist, acceleration=now.acceleration)

    The filter stands at the time of the last measurement, so latency is prediction over the measurement's age, and no
    history is kept. A measurement older than the last one is counted in ``late`` and left out.

    Args:
        filter: what estimates. policy: what follows when measurements fail to come.
        delay: how much later than it was taken a measurement is stamped [s], see :func:`wbc.estimation.calibrate`.

    Raises:
        ShapeError: no filter or no policy. RangeError: a negative delay.
    """

    def __init__(self, filter: PoseFilter, policy: DropoutPolicy | None = None, delay: float = 0.0) -> None:
        self._filter = validation.instance("filter", filter, PoseFilter, "a PoseFilter")
        self.policy = validation.instance("policy", policy or DropoutPolicy(), DropoutPolicy, "a DropoutPolicy")
        self._delay = validation.scalar("delay", delay, low=0.0, unit="s")
        self.late = 0

    def push(self, stamp: float, pose: Any) -> None:
        """Take a measurement in.

        Raises:
            WbcError: no time or no pose; nothing is changed.
        """
        taken = validation.scalar("stamp", stamp, unit="s") - self._delay
        last = self._filter.time
        if last is not None and taken < last:
            validation.pose("pose", pose)
            self.late += 1
            return
        if last is not None and taken - last >= self.policy.predict + self.policy.hold:
            measured = validation.pose("pose", pose)
            self._filter.reset()
            pose = measured
        self._filter.update(taken, pose)

    def at(self, time: float) -> FrameEstimate:
        """The frame at a time, not before the last measurement was taken, by the policy; lost where the time is before
        that by more than the policy's own, since a clock was set back: see :meth:`reset`.

        Raises:
            SolverError: there was no measurement.
        """
        if self._filter.time is None:
            raise SolverError("at", time, "there is no measurement yet")
        age = validation.scalar("time", time, unit="s") - self._filter.time
        # Far before the last measurement: a clock was set back, and what is measured now is left out as too old
        age = abs(age) if age < -(self.policy.predict + self.policy.hold) else max(age, 0.0)
        s, pace, state = self.policy.ahead(age)
        motion: FrameMotion = self._filter.at(self._filter.time + s)
        braking = -1.0 / self.policy.hold if state is StreamState.HELD else 0.0
        acceleration = pace**2 * motion.acceleration + braking * motion.twist
        return FrameEstimate(motion.pose, pace * motion.twist, acceleration, age, state)

    def reset(self) -> None:
        """Forget every measurement."""
        self._filter.reset()
        self.late = 0
