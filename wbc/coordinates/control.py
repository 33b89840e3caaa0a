"""Pairs at run time: commanded rates, what is held, and changes from one pair to another without a jump."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from wbc import validation
from wbc.controller import Step
from wbc.coordinates import expressions
from wbc.coordinates.conditioning import checked_configuration
from wbc.coordinates.easing import Easing
from wbc.coordinates.integrals import RateIntegrals
from wbc.coordinates.pair import CoordinatePair
from wbc.coordinates.pair_stack import EASE, PairStack, metric_of, pair_stack, row_count
from wbc.coordinates.rate_matrices import RateMatrices
from wbc.coordinates.rows import Coordinate
from wbc.errors import UnknownNameError
from wbc.robot import Robot
from wbc.tasks import Item
from wbc.validation import Array

#: A blend's acceleration is at most this part of a joint's limit
ROOM = 0.8
#: Commanded rows that are rates only lag their integral by this at most [m, rad]; what limits take is not made up for
LAG = 5e-4


class PairController:
    """Drives a robot by the rates of the active pair's task coordinates.

        control = PairController(robot, [first, second], dt=0.02)
        control.reset(q)
        control.command([0.02, 0, 0, 0, 0, 0])          # rates of the active pair's task rows
        step = control.step(q)                          # step.v, as of any controller
        control.switch("second")

    **Held rows** have rate zero, or the one given to :meth:`prescribe`, exactly; drift from where they came to rest is
    taken back, for rates without an integral (alpha, beta, gamma) the drift along the way that the robot went. Of
    those, commanded ones follow their integral, too. **Near a locus** of the active pair the task gives way, see
    :class:`wbc.coordinates.easing.Easing`.

    **A switch** gives every row of the new pair that was not at rest the rate that it has now, and lets the difference
    to what is commanded fade like 1 - 3 s^2 + 2 s^3, s = time / seconds: where the new pair is regular the joint rates
    are continuous, and what both pairs hold stays exact. The time is the one asked for, or longer where a joint's
    acceleration limit needs it.

    Attributes:
        declared: the pairs' stack. controller: its compiled controller.
        active: name of the active pair. blending: whether a switch is under way.
    """

    def __init__(
        self,
        robot: Robot,
        pairs: CoordinatePair | Iterable[CoordinatePair],
        dt: float = 0.02,
        *,
        items: Sequence[Item] = (),
        limits: bool = True,
        gain: float | None = None,
        length: float | None = None,
        backend: str = "auto",
    ) -> None:
        self.declared: PairStack = pair_stack(robot, pairs, dt, items=items, limits=limits, gain=gain, length=length)
        self.robot, self.dt = robot, self.declared.stack.dt
        self.controller = self.declared.stack.compile(backend=backend)
        native = self.controller.backend == "native"
        self._rates = RateMatrices(robot, self.declared.coordinates, native=native)
        self._sizes = {one: row_count(robot, [one]) for one in self.declared.coordinates}
        self.active = next(iter(self.declared.pairs))
        self._command: dict[Coordinate, Array] = {}
        self._fading: dict[Coordinate, Array] = {}
        self._served: dict[Coordinate, Array] = {}
        self._time, self._seconds = 0.0, 0.0
        self._moving: set[Coordinate] = set()
        self._integrals = RateIntegrals(robot, self.declared.coordinates)
        self._easing = Easing(robot, self.declared.stack.length, self._rates, native=native)
        self._q: Array | None = None
        self._activate()

    @property
    def pairs(self) -> dict[str, CoordinatePair]:
        """The stated set, by name."""
        return self.declared.pairs

    @property
    def pair(self) -> CoordinatePair:
        """The active one."""
        return self.pairs[self.active]

    @property
    def blending(self) -> bool:
        """Whether a switch is under way."""
        return bool(self._fading)

    def reset(self, q: Any, v: Any = None) -> None:
        """Start anew at a configuration: commands are zero, what the active pair holds is held where it is.

        Raises:
            ShapeError, NotFiniteError, RotationError: bad input; nothing is changed.
        """
        q = self.robot.configuration("q", q)
        self.controller.reset(q, v)
        self._command, self._fading, self._served, self._q = {}, {}, {}, q
        self._integrals.forget()
        self._activate()
        self._latch(self.pair.constraint, q)

    def command(self, rates: Any) -> None:
        """Rates of the active pair's task rows [m/s, rad/s], until the next command or switch.

        Raises:
            ShapeError, NotFiniteError: not one finite number a row.
        """
        self._command |= self._split("command", self.pair.task, rates)

    def prescribe(self, rates: Any) -> None:
        """Rates of the active pair's constraint rows [m/s, rad/s]; zero at first. While they are not zero, drift of
        these coordinates is not corrected.

        Raises:
            ShapeError, NotFiniteError: not one finite number a row.
        """
        self._command |= self._split("prescribe", self.pair.constraint, rates)

    def switch(self, name: str, seconds: float = 1.0) -> float:
        """Make another pair the active one; returns the time of the blend [s].

        Coordinates that are commanded in both pairs, or kept in both, keep their rates; those of all others are zero.

        Raises:
            UnknownNameError: no such pair. RangeError: a negative time.
        """
        if name not in self.pairs:
            raise UnknownNameError("pair", name, self.pairs)
        wanted = validation.scalar("seconds", seconds, low=0.0, unit="s")
        if name == self.active:
            return 0.0
        before, was, commands = self._held(), self.pair, self._command
        self.active = name
        alike = {*(set(was.task) & set(self.pair.task)), *(set(was.constraint) & set(self.pair.constraint))}
        self._command = {one: rate for one, rate in commands.items() if one in alike}
        self._fading = {}
        if self._q is not None:
            v, rows = self.controller.last_command, self.rates(self._q)
            for one in self.pair.rows:
                if not (one in before and one in self.pair.constraint):
                    # A task that goes on lags by what it was asked for, not by how that has changed since
                    asked = self._served.get(one) if one in alike else None
                    self._fading[one] = rows[one] @ v - (self._wanted(one) if asked is None else asked)
            wanted = max(wanted, self._shortest(rows, v))
            kept = [one for one in self.pair.constraint if one in before]
            self._latch([one for one in self.pair.constraint if one not in kept], self._q)
        self._integrals.restart(self.pair.task)
        self._time, self._seconds = 0.0, wanted
        if wanted == 0.0:
            self._fading = {}
        self._activate()
        return wanted

    def units(self, rows: Iterable[Coordinate]) -> tuple[str, ...]:
        """Unit of each row of some coordinates, of their integrals: m or rad."""
        return tuple(row.unit for one in rows for row in expressions.labels(self.robot, one))

    def rates(self, q: Any) -> dict[Coordinate, Array]:
        """The matrix of every coordinate's rates at a configuration [rows, nv].

        Raises:
            ShapeError, NotFiniteError, RotationError: no configuration.
        """
        whole = self._rates.whole(self.robot.configuration("q", q))
        return self._rates.split(whole, self._rates.places)

    def step(self, q: Any, v: Any = None, dt: Any = None) -> Step:
        """One cycle: the velocity for the next dt seconds, see :meth:`wbc.Controller.step`.

        Raises:
            ShapeError, NotFiniteError, RotationError, RangeError: bad input.
        """
        q = checked_configuration(self.robot, q)
        if self._q is None:
            self._latch(self.pair.constraint, q)
        self._q = np.array(q)
        period = self.dt if dt is None else validation.scalar("dt", dt, low=0.0, unit="s")
        self._time += period
        every = self._rates.whole(q)
        matrices = self._rates.split(every, self.pair.rows)
        self._integrals.advance(q, matrices)
        s = min(1.0, self._time / self._seconds) if self._seconds > 0.0 else 1.0
        left = 1.0 - s * s * (3.0 - 2.0 * s)
        self._served = {one: self._wanted(one) + left * self._fading.get(one, 0.0) for one in self.pair.task}
        for one, rate in self._served.items():
            self._follow(one, rate)
        for one in self.pair.constraint:
            rate = self._wanted(one) + left * self._fading.get(one, 0.0)
            self._keep(one, rate, q)
            self._integrals.plan(one, rate, period, matrices[one])
        for one, rate in self._served.items():
            self._integrals.plan(one, rate, period, matrices[one])
        if s >= 1.0:
            self._fading = {}
        ease, weight = self.controller[EASE], self._easing.at(self.pair, every)
        # Writing a weight costs more than a look at it
        if ease.weight != weight:
            ease.weight = weight
        return self.controller.step(q, v, dt)

    def _follow(self, one: Coordinate, rate: Array) -> None:
        """A task coordinate goes at a rate; what it is behind its integral, it makes up for."""
        item = self._item(one)
        item.speed = rate
        if one in self._integrals.masks and not self._tall:
            self._integrals.cap(one, LAG)
            item.offset = -self._integrals.off(one)

    def _keep(self, one: Coordinate, rate: Array, q: Array) -> None:
        """A constraint coordinate goes at a rate; at rest its drift is taken back."""
        handle = self.controller[self.declared.keep[one]]
        handle.speed = rate
        if rate.any() or one in self._moving:
            self._latch([one], q)
        self._moving = self._moving | {one} if rate.any() else self._moving - {one}
        if one in self._integrals.masks:
            handle.drift = self._integrals.off(one)

    def _item(self, one: Coordinate) -> Any:
        return self.controller[self.declared.follow[one, metric_of(self.pair, one)]]

    def _wanted(self, one: Coordinate) -> Array:
        return self._command.get(one, np.zeros(self._sizes[one]))

    def _held(self) -> set[Coordinate]:
        """Constraint coordinates that are at rest."""
        busy = {one for one, rate in self._fading.items() if rate.any()}
        return {one for one in self.pair.constraint if not self._wanted(one).any()} - busy

    def _split(self, field: str, rows: Sequence[Coordinate], rates: Any) -> dict[Coordinate, Array]:
        sizes = [self._sizes[one] for one in rows]
        numbers = validation.real_array(field, rates, (sum(sizes),))
        return dict(zip(rows, np.split(numbers, np.cumsum(sizes)[:-1]), strict=True))

    def _activate(self) -> None:
        """Switch the items of the active pair on and all others off."""
        self._tall = self.pair.over_determined(self.robot)
        wishes = {self.declared.follow[one, metric_of(self.pair, one)] for one in self.pair.task}
        kept = {self.declared.keep[one] for one in self.pair.constraint}
        for name in (*self.declared.follow.values(), *self.declared.keep.values()):
            self.controller[name].enabled = name in wishes or name in kept

    def _latch(self, rows: Iterable[Coordinate], q: Array) -> None:
        """What is held from now on is held where it is."""
        self._integrals.restart(rows)
        for one in rows:
            if expressions.reference(self.robot, one) is not None:
                value = expressions.here(self.robot, one, q)
                self.controller[self.declared.keep[one]].reference = value

    def _shortest(self, rows: dict[Coordinate, Array], v: Array) -> float:
        """Time in which the joint rates can change to what the new pair wants."""
        J = np.vstack([rows[one] for one in self.pair.rows])
        wanted = np.concatenate([self._wanted(one) for one in self.pair.rows])
        change = np.abs(np.linalg.lstsq(J, wanted, rcond=1e-6)[0] - v)
        limit = self.robot.limits.acceleration
        slow = np.isfinite(limit) & (limit > 0.0)
        return float((1.5 * change[slow] / (ROOM * limit[slow])).max(initial=0.0))
