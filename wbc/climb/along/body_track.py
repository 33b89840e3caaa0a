"""The way of a body: its poses at even instants of a motion at the asked speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.multibody import pin
from wbc.symbolic.joint_steps import place
from wbc.validation import Array

#: Time between instants [s]: joints are cubic between them
INSTANT = 0.05
#: Time in which a body turns from one leg of its way to the next [s]
BLEND = 0.6
#: Instants of a way at most: an hour
MOST = 72000


@dataclass(frozen=True, eq=False)
class BodyTrack:
    """A way of the body through poses, with a constant twist from each to the next,

        P(u) = P_k exp(u / T_k log(P_k^-1 P_{k+1})),   T_k = max(|translation| / speed, |turn| / turn_rate),

    whose twists go over into each other evenly within 0.6 s.

    Attributes:
        poses: of the body's link in the world, two or more.
        speed: of its origin [m/s].
        turn_rate: largest turn rate [rad/s].

    Raises:
        ShapeError, NotFiniteError, RotationError: fewer than two poses, or things that are none. RangeError: speeds
            that are not above 0, a way without length, or one that takes longer than an hour.
    """

    poses: Sequence[Any]
    speed: float
    turn_rate: float = 0.1

    def __post_init__(self) -> None:
        given = validation.items("BodyTrack.poses", self.poses, "poses")
        if len(given) < 2:
            raise ShapeError("BodyTrack.poses", len(given), "expected two poses or more")
        object.__setattr__(self, "poses", tuple(validation.pose("BodyTrack.poses", pose) for pose in given))
        validation.own_scalars(self, "speed", "turn_rate", low=0.0, open_low=True)
        if not self.duration > 0.0:
            raise RangeError("BodyTrack.poses", 0.0, "the way has no length")
        if self.duration > MOST * INSTANT:
            raise RangeError("BodyTrack.speed", self.speed, f"the way takes {self.duration:.3g} s, more than an hour")

    @cached_property
    def times(self) -> Array:
        """At which the body is at each of the poses, at full speed [s]."""
        out = [0.0]
        for twist, (one, other) in zip(self._legs, zip(self.poses, self.poses[1:], strict=False), strict=True):
            # The origin goes on a helix, whose length the twist has
            way = float(np.linalg.norm(twist[:3])) or float(np.linalg.norm(other.translation - one.translation))
            out.append(out[-1] + max(way / self.speed, float(np.linalg.norm(twist[3:])) / self.turn_rate))
        return np.array(out)

    @property
    def duration(self) -> float:
        """Of the whole way [s]."""
        return float(self.times[-1])

    @cached_property
    def instants(self) -> Array:
        """Even times from 0 to ``duration`` [s], about 0.05 s apart."""
        count = max(2, round(self.duration / INSTANT))
        return np.linspace(0.0, self.duration, count + 1)

    @cached_property
    def sampled(self) -> tuple[pin.SE3, ...]:
        """Poses at the instants."""
        pose, out = self.poses[0], [self.poses[0]]
        half = 0.5 * BLEND
        for a, b in zip(self.instants[:-1], self.instants[1:], strict=True):
            twist = np.zeros(6)
            # The twist of an interval is that of the legs within the blend about its middle
            middle = 0.5 * (a + b)
            low, high = max(middle - half, 0.0), min(middle + half, self.duration)
            low, high = max(low, 2.0 * middle - high), min(high, 2.0 * middle - low)
            for k, leg in enumerate(self._legs):
                share = min(high, self.times[k + 1]) - max(low, self.times[k])
                if share > 0.0:
                    twist += share / (high - low) * leg / (self.times[k + 1] - self.times[k])
            pose = pose * pin.exp6(pin.Motion((b - a) * twist))
            out.append(pose)
        # What the blends cut off is made up evenly
        left, count = pin.log6(out[-1].actInv(self.poses[-1])).vector, len(out) - 1
        return tuple(pose * pin.exp6(pin.Motion(k / count * left)) for k, pose in enumerate(out))

    @cached_property
    def places(self) -> Array:
        """Poses at the instants ``(n, 12)``: rotation row by row, then position."""
        return np.array([place(pose) for pose in self.sampled])

    @cached_property
    def twists(self) -> Array:
        """Twists of the body at the instants in its own axes, linear first ``(n, 6)`` [m/s, rad/s]."""
        steps = np.array([pin.log6(a.actInv(b)).vector for a, b in zip(self.sampled, self.sampled[1:], strict=False)])
        steps /= np.diff(self.instants)[:, None]
        return np.vstack([steps[:1], 0.5 * (steps[1:] + steps[:-1]), steps[-1:]])

    @cached_property
    def _legs(self) -> list[Array]:
        return [np.array(pin.log6(a.actInv(b)).vector) for a, b in zip(self.poses, self.poses[1:], strict=False)]
