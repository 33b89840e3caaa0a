"""What the controller said of every tick, columns of the log beside those of the walk."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from wbc.errors import ShapeError
from wbc.log import Log
from wbc.validation import Array

#: Fields of :class:`TickColumns`, which are columns of the log: unit and kind of number
TICK: Mapping[str, tuple[str, str]] = {
    "path_time": ("s", "f8"),
    "body_error": ("m", "f8"),
    "slip": ("m", "f8"),
    "cost": ("s", "f8"),
    "solved": ("", "?"),
}


@dataclass(frozen=True, eq=False)
class TickColumns:
    """n ticks; entry k belongs to the step from row k of the log to row k + 1.

    Attributes:
        path_time: u [s]. body_error: distance of the body from its command [m]. slip: of the worst held hand [m].
        cost: of the controller's tick [s]. solved: whether the controller's answer is one of all rows.
    """

    path_time: Array
    body_error: Array
    slip: Array
    cost: Array
    solved: NDArray[np.bool_]

    @classmethod
    def of(cls, log: Log) -> TickColumns:
        """From the columns of a log; the step of its last row leads to one that is not there.

        Raises:
            ShapeError: a log without them.
        """
        missing = [f.name for f in fields(cls) if f.name not in log]
        if missing:
            raise ShapeError(f"run.{missing[0]}", sorted(log.columns), "the log says nothing of the controller's ticks")
        return cls(*(np.array(log[f.name][:-1]) for f in fields(cls)))

    def padded(self, name: str) -> np.ndarray:
        """A field with an entry for each row of the log: 0, where no step follows."""
        values: np.ndarray = getattr(self, name)
        return np.append(values, np.zeros(1, values.dtype))
