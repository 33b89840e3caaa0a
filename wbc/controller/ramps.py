"""Weights and prices that change smoothly over some ticks, so that tasks join, leave and change rank without a jerk."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Protocol

from wbc.quick_dataclasses import dataclass

#: Share of the larger weight at which a weight of zero begins or ends
_FLOOR = 1e-6


class Ramped(Protocol):
    """What has a weight that ramps: a handle."""

    @property
    def item_name(self) -> str: ...
    @property
    def ramped(self) -> float: ...
    def put_ramped(self, value: float) -> None:
        """Write the weight."""


@dataclass
class Ramp:
    """A weight on its way: ln w goes from its first to its last value like 3 s^2 - 2 s^3, s = time / seconds.

    A weight of zero takes the place of 1e-6 of the other one on the way.
    """

    handle: Ramped
    first: float
    last: float
    seconds: float
    time: float = 0.0

    def at(self, time: float) -> float:
        """The weight [time in s]."""
        s = time / self.seconds if self.seconds > 0.0 else 1.0
        if s >= 1.0 or self.first == self.last:
            return self.last
        floor = _FLOOR * max(self.first, self.last)
        low, high = (math.log(weight if weight > 0.0 else floor) for weight in (self.first, self.last))
        return math.exp(low + (high - low) * s * s * (3.0 - 2.0 * s))


class Ramps:
    """The ramps of one controller, one a task."""

    def __init__(self) -> None:
        self._running: dict[str, Ramp] = {}

    def __bool__(self) -> bool:
        return bool(self._running)

    def start(self, handle: Ramped, last: float, seconds: float) -> None:
        """From the present weight on; takes the place of a ramp of the same task."""
        self._running[handle.item_name] = Ramp(handle, handle.ramped, last, seconds)

    def assume(self, other: Ramps, handles: Mapping[str, Ramped]) -> None:
        """Go on with the ramps of another controller from where they are."""
        self._running = {name: replace(ramp, handle=handles[name]) for name, ramp in other._running.items()}

    def stop(self, name: str) -> None:
        """The weight stays as it is."""
        self._running.pop(name, None)

    def advance(self, seconds: float) -> None:
        """The next tick's weights."""
        for name, ramp in list(self._running.items()):
            ramp.time += seconds
            ramp.handle.put_ramped(ramp.at(ramp.time))
            if ramp.time >= ramp.seconds:
                del self._running[name]
