"""A plant that takes as long as it says."""

from __future__ import annotations

import time
from collections.abc import Collection

from wbc import validation
from wbc.simulation.plant import Command, CommandKind, Plant, PlantState
from wbc.validation import Array


class RealTime:
    """A simulator at the pace of the clock: :meth:`advance` returns when the plant's time has gone by.

    Where it cannot keep up it waits for nothing, and makes up for it later.

    Args:
        plant: as fast as possible by itself. pace: seconds of the plant in one of the clock.

    Attributes:
        late: by which it has been behind the clock at most [s].
    """

    def __init__(self, plant: Plant, pace: float = 1.0) -> None:
        self.plant, self.late = plant, 0.0
        self._pace = validation.scalar("pace", pace, low=0.0, open_low=True)
        self.nq, self.nv, self.time_step = plant.nq, plant.nv, plant.time_step
        self.commands: Collection[CommandKind] = plant.commands
        self._begun: tuple[float, float] | None = None

    def reset(self, q: Array, time: float) -> None:
        """At rest at a configuration; the clock begins with the first :meth:`advance`."""
        self.plant.reset(q, time)
        self._begun, self.late = None, 0.0

    def read(self) -> PlantState:
        return self.plant.read()

    def apply(self, command: Command) -> None:
        self.plant.apply(command)

    def advance(self, dt: float) -> None:
        if self._begun is None:
            self._begun = time.perf_counter(), self.plant.read().time
        self.plant.advance(dt)
        clock, start = self._begun
        ahead = (self.plant.read().time - start) / self._pace - (time.perf_counter() - clock)
        if ahead > 0.0:
            time.sleep(ahead)
        else:
            self.late = max(self.late, -ahead)
