"""What an operator says at one moment: rates, and perhaps another pair."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from wbc import validation
from wbc.errors import RangeError, ShapeError

#: Rates that two hand controllers give at once
AT_ONCE = 6


@dataclass(frozen=True)
class Order:
    """An order.

    Attributes:
        rates: of the active pair's task rows, in their order [m/s, rad/s]; at most six, those left out are zero.
        pair: name of a pair to change to first, or None. stop: everything comes to rest, the rates are not read.

    Raises:
        ShapeError, NotFiniteError: no numbers. RangeError: more than six.
    """

    rates: tuple[float, ...] = ()
    pair: str | None = None
    stop: bool = False

    def __post_init__(self) -> None:
        numbers = validation.ordinary_array("rates", self.rates)
        if numbers.ndim != 1:
            raise ShapeError("rates", self.rates, "expected a row of numbers")
        if len(numbers) > AT_ONCE:
            raise RangeError("rates", self.rates, f"an operator gives at most {AT_ONCE} rates at a time")
        if self.pair is not None:
            validation.name("pair", self.pair)
        object.__setattr__(self, "stop", validation.flag("stop", self.stop))
        object.__setattr__(self, "rates", tuple(float(x) for x in numbers))


class Source(Protocol):
    """Where orders come from: a file, a keyboard, or a program."""

    def order(self, time: float, names: Sequence[str], active: str, units: Sequence[str]) -> Order | None:
        """The order at a time [s] since the start; None for nothing new, so that the last one holds until it is stale.

        Args:
            names: pairs to choose from. active: the present one. units: m or rad of each row of its task.

        Raises:
            StopIteration: the operator is done.
        """
