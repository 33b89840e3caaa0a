"""A session of an operator with an arm: modes, pairs, rates at 50 Hz."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc import validation
from wbc.controller import Step
from wbc.coordinates import Adviser, CoordinatePair, Mode, PairController, mode_pairs, parts
from wbc.coordinates.modes import mode
from wbc.coordinates.pair_stack import row_count
from wbc.errors import RangeError, UnknownNameError
from wbc.tasks import Item
from wbc.teleop.order import Order

#: Orders a second
RATE = 50.0
#: An order older than this counts for nothing [s]
STALE = 0.5


@dataclass(frozen=True)
class Seen:
    """What an operator is told after a tick.

    Attributes:
        step: the tick. active: pair in use. blending: a change is under way. advised: the pair that the adviser would
            use, or "" without one. stale: the last order is too old, rates are zero.
    """

    step: Step
    active: str
    blending: bool
    advised: str
    stale: bool


class Teleoperation:
    """Drives an arm of :func:`wbc.robots.operator_arm` by an operator's orders.

        session = Teleoperation("spdm", ["M1", "M6"])
        session.reset(q)
        seen = session.step(q, Order((0.01, 0, 0, 0, 0, 0)))      # 50 times a second
        session.step(q, Order(pair="body_joint | hands"))

    One sub-chain moves at a time: locks of a pair are the brakes of all others. Rates are those of the active pair's
    task rows, at most six; an order without rates leaves the last ones, which count for half a second. The fastest rate
    that a row may be given is ``fastest``; what the joints cannot do the limits take from the task.

    Args:
        modes: whose pairs can be chosen. pairs: more pairs, of one's own. items: further constraints.
        seconds: time of a change of pairs [s]. fastest: rates in metres and in radians [m/s, rad/s].
        advice: state the adviser's choice among the pairs with the active one's task. automatic: follow it.

    Raises:
        UnknownNameError, MissingPartError: no such robot or mode, or a mode that the robot has not.
        RangeError: no pairs, or one with a task of more than six rows.
    """

    def __init__(
        self,
        robot: str,
        modes: Iterable[str | Mode] = ("M1", "M2"),
        *,
        pairs: Sequence[CoordinatePair] = (),
        items: Sequence[Item] = (),
        seconds: float = 2.0,
        fastest: tuple[float, float] = (0.3, 0.07),
        advice: bool = False,
        automatic: bool = False,
        acceleration: float = 0.02,
        backend: str = "auto",
    ) -> None:
        found = parts(robot)
        slow = validation.scalar("acceleration", acceleration, low=0.0, open_low=True, unit="rad/s^2")
        self.robot = found.robot.with_limits(acceleration=slow)
        chosen = [mode(one) for one in modes]
        given = dict.fromkeys([*(p for one in chosen for p in mode_pairs(robot, one)), *pairs])
        for pair in given:
            rows = row_count(self.robot, pair.task)
            if rows > 6:
                raise RangeError("pairs", pair.name, f"its task has {rows} rows, an operator gives at most 6 rates")
        self._seconds = validation.scalar("seconds", seconds, low=0.0, unit="s")
        self._fastest = [validation.scalar("fastest", x, low=0.0, open_low=True) for x in fastest]
        self._automatic = validation.flag("automatic", automatic)
        self.control = PairController(self.robot, list(given), 1.0 / RATE, items=items, backend=backend)
        self._advisers: dict[str, Adviser] = {}
        if advice or automatic:
            self._prepare(list(given), backend)
        self._order, self._age = Order(), 0.0

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all pairs, in order."""
        return tuple(self.control.pairs)

    @property
    def units(self) -> tuple[str, ...]:
        """m or rad of each row of the active pair's task."""
        return self.control.units(self.control.pair.task)

    def reset(self, q: Any) -> None:
        """Begin at a configuration, at rest.

        Raises:
            ShapeError, NotFiniteError, RotationError: no configuration; nothing is changed.
        """
        self.control.reset(q)
        self._order, self._age = Order(), 0.0

    def step(self, q: Any, order: Order | None = None) -> Seen:
        """One tick.

        Args:
            order: None for nothing new.

        Raises:
            UnknownNameError: no such pair. RangeError: more rates than the task has rows, or too fast ones. ShapeError,
                NotFiniteError, RotationError: no configuration. Nothing is changed by any of them.
        """
        q = self.robot.configuration("q", q)
        if order is not None:
            self._take(order)
        else:
            self._age += self.control.dt
        stale = self._age > STALE + 0.5 * self.control.dt
        advised = self._advise(q)
        if self._automatic and advised and advised != self.control.active and not self.control.blending:
            self.control.switch(advised, self._seconds)
        self.control.command(self._rates(self.control.pair, Order() if stale else self._order))
        step = self.control.step(q)
        return Seen(step, self.control.active, self.control.blending, advised, stale)

    def _take(self, order: Order) -> None:
        """Check an order as a whole, then follow it."""
        name = order.pair or self.control.active
        if name not in self.control.pairs:
            raise UnknownNameError("pair", name, self.control.pairs)
        fresh = Order() if order.stop else order
        self._rates(self.control.pairs[name], fresh)
        if name != self.control.active:
            self.control.switch(name, self._seconds)
        self._order, self._age = fresh, 0.0

    def _rates(self, pair: CoordinatePair, order: Order) -> np.ndarray:
        """An order as rates of all task rows of a pair."""
        count = row_count(self.robot, pair.task)
        given = np.array(order.rates)
        if given[count:].any():
            raise RangeError("rates", order.rates, f"{pair.name!r} commands {count} rows")
        out = np.zeros(count)
        out[: min(count, len(given))] = given[:count]
        for k, unit in enumerate(self.control.units(pair.task)):
            limit = self._fastest[0 if unit == "m" else 1]
            if abs(out[k]) > limit:
                raise RangeError("rates", order.rates, f"row {k + 1} is faster than {limit:g} {unit}/s")
        return out

    def _prepare(self, pairs: list[CoordinatePair], backend: str) -> None:
        """One adviser for all pairs that command the same."""
        by_task: dict[Any, list[CoordinatePair]] = {}
        for pair in pairs:
            by_task.setdefault(pair.task, []).append(pair)
        for alike in by_task.values():
            if len(alike) > 1:
                adviser = Adviser(self.robot, alike, exact=False, backend=backend)
                self._advisers |= {pair.name: adviser for pair in alike}

    def _advise(self, q: Any) -> str:
        adviser = self._advisers.get(self.control.active)
        return "" if adviser is None else adviser.recommend(q, self.control.active)
