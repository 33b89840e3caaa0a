"""Pairs at run time: commanded rates, what is held, and changes from one pair to another without a jump."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np

from wbc import validation
from wbc.controller import core_of
from wbc.controller.step import state_of
from wbc.coordinates import expressions
from wbc.coordinates.control.conditioning import checked_configuration
from wbc.coordinates.control.easing import Easing
from wbc.coordinates.control.integrals import RateIntegrals, Rows
from wbc.coordinates.control.pair_stack import EASE, PairStack, pair_stack
from wbc.coordinates.control.pair_step import PairStep
from wbc.coordinates.control.rank_loss import RankLoss
from wbc.coordinates.control.serving import Served, served
from wbc.coordinates.pair import CoordinatePair
from wbc.coordinates.rate_matrices import RateMatrices
from wbc.coordinates.rows import Coordinate, coordinates
from wbc.robot import Robot
from wbc.sealed import Sealed
from wbc.tasks import Item
from wbc.validation import Array

#: A blend's acceleration is at most this part of a joint's limit
PAIR_SHARE = 0.8


class PairController(Sealed):
    """Drives a robot by the rates of the active pair's task coordinates.

        control = PairController(robot, [first, second], dt=0.02)
        control.reset(q)
        control.command([0.02, 0, 0, 0, 0, 0])          # rates of the active pair's task rows
        step = control.step(q)                          # step.v, as of any controller
        control.switch("second")

    **Held rows** have rate zero, or the one given to :meth:`prescribe`, exactly; drift from where they came to rest is
    taken back, for rates without an integral (alpha, beta, gamma) the drift along the path that the robot took. Of
    those, commanded ones follow their integral, too. **Near a locus** of the active pair the task gives way, see
    :class:`wbc.coordinates.control.easing.Easing`.

    **A switch** gives every row of the new pair that was not at rest the rate that it has now, and lets the difference
    to what is commanded fade like 1 - 3 s^2 + 2 s^3, s = time / seconds: where the new pair is regular the joint rates
    are continuous, and what both pairs hold stays exact. The time is the one asked for, or longer where a joint's
    acceleration limit needs it.

    What all pairs have in common lies in flat arrays with one number a row of all coordinates, in their order, so that
    a tick is a few operations on whole arrays; what changes only with the command is written only then.

    Attributes:
        declared: the pairs' stack. controller: its compiled controller.
        active: name of the active pair. blending: whether a switch is going on.
    """

    _changing = ("active", "blending")

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
        scaled: bool = False,
        backend: str = "auto",
    ) -> None:
        self.declared: PairStack = pair_stack(
            robot, pairs, dt, items=items, limits=limits, gain=gain, length=length, scaled=scaled
        )
        self.robot, self.dt = robot, self.declared.stack.dt
        self.controller = self.declared.stack.compile(backend=backend, wait=True)
        native = self.controller.backend == "native"
        self._rates = RateMatrices(robot, self.declared.coordinates, native=native)
        self._integrals = RateIntegrals(robot, self._rates)
        self._easing = Easing(robot, self.pairs.values(), self.declared.stack.length, self._rates, native=native)
        self._loss = RankLoss(robot, list(self.pairs.values()), backend="auto" if native else "vm")
        self._made = {
            name: served(self.controller, self.declared, pair, self._rates, self._integrals.masked)
            for name, pair in self.pairs.items()
        }
        self.active = next(iter(self.declared.pairs))
        count = len(self._rates.units)
        #: What is asked of each row, what was served of it in the last tick, and what a switch has yet to let fade
        self._command, self._served, self._fading = np.zeros(count), np.zeros(count), np.zeros(count)
        self._time, self._seconds = 0.0, 0.0
        self.blending = False
        #: Something that is written only when it changes has changed
        self._fresh = True
        #: Constraint coordinates that have rates: their references go along
        self._moving: tuple[Coordinate, ...] = ()
        self._q: Array | None = None
        self._every, self._weight = np.zeros((count, robot.nv)), 0.0
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
    def asked(self) -> Array:
        """Rates that the active pair's task rows were last commanded to have [m/s, rad/s]."""
        return self._command[self._now.task_rows]

    def met(self, v: Array) -> Array:
        """Rates of the active pair's task rows at the last configuration for joint rates ``v`` [m/s, rad/s]."""
        found: Array = self._every[self._now.task_rows] @ validation.ordinary_array("v", v, (self.robot.nv,))
        return found

    def sigma(self) -> float:
        """The least singular value of the active pair's scaled rows at the last configuration, see :class:`Adviser`."""
        return self._easing.sigma(self.active, self._every)

    @property
    def eased(self) -> bool:
        """Whether the task gave way in the last tick because a locus is near."""
        return bool(self.controller[EASE].weight > 0.0)

    def eased_below(self, name: str) -> float:
        """The least singular value below which a pair's task gives way, see :meth:`sigma`.

        Raises:
            UnknownNameError: no such pair.
        """
        return self._easing.threshold(validation.one_of("pair", name, self.pairs))

    def items_of(self, name: str) -> frozenset[str]:
        """Names of the stack's items that serve a pair.

        Raises:
            UnknownNameError: no such pair.
        """
        return frozenset(self._made[validation.one_of("pair", name, self.pairs)].items)

    def reset(self, q: Any, v: Any = None) -> None:
        """Start anew at a configuration: commands are zero, what the active pair holds is held where it is.

        Raises:
            ShapeError, NotFiniteError, RotationError: bad input; nothing is changed.
        """
        q = self.robot.configuration("q", q)
        self.controller.reset(q, v)
        for array in (self._command, self._served, self._fading):
            array[:] = 0.0
        self._q, self.blending, self._moving = q, False, ()
        self._integrals.forget()
        self._activate()
        self._latch(self.pair.constraint, q)

    def command(self, rates: Any) -> None:
        """Rates of the active pair's task rows [m/s, rad/s], until the next command or switch.

        Raises:
            ShapeError, NotFiniteError: not one finite number a row.
        """
        self._ask("command", self._now.task_rows, rates)

    def prescribe(self, rates: Any) -> None:
        """Rates of the active pair's constraint rows [m/s, rad/s]; zero at first. While they are not zero, drift of
        these coordinates is not corrected.

        Raises:
            ShapeError, NotFiniteError: not one finite number a row.
        """
        self._ask("prescribe", self._now.held_rows, rates)

    def halt(self) -> None:
        """Ask every coordinate for rest from the next tick on, also in the middle of a switch, which has then ended.

        Joints brake within their limits, which come before what is held.
        """
        for array in (self._command, self._fading):
            array[:] = 0.0
        self.blending, self._fresh = False, True
        self._integrals.restart(self.pair.task)
        if self._q is not None:
            self._latch(self.pair.constraint, self._q)

    def switch(self, name: str, seconds: float = 1.0) -> float:
        """Make another pair the active one; returns the time of the blend [s].

        Coordinates that are commanded in both pairs, or held in both, keep their rates; those of all others are zero.

        Raises:
            UnknownNameError: no such pair. RangeError: a negative time.
        """
        validation.one_of("pair", name, self.pairs)
        wanted = validation.scalar("seconds", seconds, low=0.0, unit="s")
        if name == self.active:
            return 0.0
        before, was, slices = self._held(), self.pair, self._rates.row_slices
        self.active = name
        alike = {*(set(was.task) & set(self.pair.task)), *(set(was.constraint) & set(self.pair.constraint))}
        for one, rows in slices.items():
            if one not in alike:
                self._command[rows] = 0.0
        self._fading[:] = 0.0
        if self._q is not None:
            v = self.controller.last_command
            now = self._rates.whole(self._q) @ v
            for one in self.pair.rows:
                if not (one in before and one in self.pair.constraint):
                    # A task that goes on lags by what it was asked for, not by how that has changed since
                    asked = self._served if one in alike and one in was.task else self._command
                    self._fading[slices[one]] = now[slices[one]] - asked[slices[one]]
            wanted = max(wanted, self._shortest(self._q, v))
            self._latch([one for one in self.pair.constraint if one not in before], self._q)
        self._integrals.restart(self.pair.task)
        self._time, self._seconds = 0.0, wanted
        if wanted == 0.0:
            self._fading[:] = 0.0
        self.blending = bool(self._fading.any())
        self._activate()
        self._mark_moving()
        return wanted

    def units(self, rows: Iterable[Coordinate]) -> tuple[str, ...]:
        """Unit of each row of some coordinates, of their integrals: m or rad."""
        return tuple(row.unit for one in coordinates("rows", rows) for row in expressions.labels(self.robot, one))

    def rates(self, q: Any) -> dict[Coordinate, Array]:
        """The matrix of every coordinate's rates at a configuration [rows, nv].

        Raises:
            ShapeError, NotFiniteError, RotationError: no configuration.
        """
        whole = self._rates.whole(self.robot.configuration("q", q))
        return {one: whole[rows] for one, rows in self._rates.row_slices.items()}

    def step(self, q: Any, v: Any = None, dt: Any = None) -> PairStep:
        """One cycle: the velocity for the next dt seconds, see :meth:`wbc.Controller.step`; its status says where the
        active pair is about to lose a rank.

        Raises:
            ShapeError, NotFiniteError, RotationError, RangeError: bad input.
        """
        q = checked_configuration(self.robot, q)
        if self._q is None:
            self._latch(self.pair.constraint, q)
        self._q = q.copy()
        period = self.dt if dt is None else validation.scalar("dt", dt, low=0.0, unit="s")
        now, every = self._now, self._rates.whole(q)
        self._every = every
        if self._integrals.rows.size:
            self._integrals.advance(q, every)
        if self.blending:
            self._fade(period)
        elif self._fresh:
            self._served[:] = self._command
            self._fresh = False
            now.write(self.controller, self._served)
        if self._moving:
            self._latch(self._moving, q)
            self._moving = tuple(one for one in self._moving if self._served[self._rates.row_slices[one]].any())
        if now.integral_rows.size:
            self._integrals.plan(now.integral_rows, self._q, every, self._served, period)
            now.write_integrals(self.controller, self._integrals)
        weight = self._easing.at(self.active, every)
        # Writing a weight costs more than a look at it
        if weight != self._weight:
            self.controller[EASE].weight = self._weight = weight
        step = self.controller.step(q, v, dt)
        return PairStep(
            state_of(step), core_of(self.controller).context, partial(self._loss.condition, self._q, self.active)
        )

    def _fade(self, period: float) -> None:
        """Serve what is asked and what is left of the difference that a switch began with."""
        self._time += period
        s = min(1.0, self._time / self._seconds) if self._seconds > 0.0 else 1.0
        np.multiply(self._fading, 1.0 - s * s * (3.0 - 2.0 * s), out=self._served)
        self._served += self._command
        self._now.write(self.controller, self._served)
        self._mark_moving()
        if s >= 1.0:
            self._fading[:] = 0.0
            self.blending, self._fresh = False, True

    def _ask(self, field: str, rows: Rows, rates: Any) -> None:
        plain = type(rates) is np.ndarray and rates.dtype == np.float64 and rates.shape == rows.shape
        if not (plain and abs(rates).max(initial=0.0) <= validation.LARGEST):
            rates = validation.ordinary_array(field, rates, rows.shape)
        self._command[rows] = rates
        self._fresh = True
        if field == "prescribe":
            self._mark_moving()

    def _mark_moving(self) -> None:
        """Constraint coordinates that have rates, or had them in the last tick."""
        slices = self._rates.row_slices
        busy = [
            one for one in self.pair.constraint if self._command[slices[one]].any() or self._served[slices[one]].any()
        ]
        self._moving = tuple(dict.fromkeys((*self._moving, *busy)))

    def _held(self) -> set[Coordinate]:
        """Constraint coordinates that are at rest."""
        slices = self._rates.row_slices
        moving = self._command != 0.0
        if self.blending:
            moving |= self._fading != 0.0
        return {one for one in self.pair.constraint if not moving[slices[one]].any()}

    def _activate(self) -> None:
        """Switch the items of the active pair on and all others off."""
        self._now: Served = self._made[self.active]
        self._integrals.follow(self._now.integral_rows)
        self._fresh, self._moving = True, ()
        self._weight = float(self.controller[EASE].weight)
        for name in (*self.declared.follow.values(), *self.declared.keep.values()):
            self.controller[name].enabled = name in self._now.items

    def _latch(self, rows: Iterable[Coordinate], q: Array) -> None:
        """What is held from now on is held where it is."""
        self._integrals.restart(rows)
        for one in rows:
            if expressions.reference(self.robot, one) is not None:
                value = expressions.here(self.robot, one, q)
                self.controller[self.declared.keep[one]].set(reference=value)

    def _shortest(self, q: Array, v: Array) -> float:
        """Time in which the joint rates can change to what the new pair wants."""
        made, every = self._made[self.active], self._rates.whole(q)
        rows = np.concatenate((made.task_rows, made.held_rows))
        change = np.abs(np.linalg.lstsq(every[rows], self._command[rows], rcond=1e-6)[0] - v)
        limit = self.robot.limits.acceleration
        slow = np.isfinite(limit) & (limit > 0.0)
        return float((1.5 * change[slow] / (PAIR_SHARE * limit[slow])).max(initial=0.0))
