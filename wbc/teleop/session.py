"""A session of an operator with an arm: modes, pairs, rates at 50 Hz, and what became of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc import validation
from wbc.controller import Status
from wbc.coordinates import (
    Adviser,
    Condition,
    CoordinatePair,
    Mode,
    PairController,
    PairStep,
    mode_pairs,
    modes_of,
    motion_cue,
    parts,
    regular_start,
)
from wbc.coordinates.advice.determinant_places import closed_form
from wbc.coordinates.advice.modes import mode
from wbc.coordinates.control.pair_stack import row_count
from wbc.coordinates.pair import pairs_of
from wbc.coordinates.scales import scales
from wbc.errors import RangeError
from wbc.robot import Robot
from wbc.robots.operator_arms import OPERATOR_ARMS
from wbc.sealed import Sealed
from wbc.tasks import Item
from wbc.teleop.order import Order
from wbc.validation import Array

#: Orders a second
RATE = 50.0
#: An order older than this counts for nothing [s]
STALE = 0.5
#: Modes whose pairs there are where nobody says which, as far as the robot has them
USUAL = (Mode.M1, Mode.M2)
#: Acceleration of the joints of the published arms where nobody says which [rad/s^2]
SLOW = 0.02
#: Acceleration of the joints of other arms that have no limit [rad/s^2]
PLAIN = 10.0
#: A part of the command below this is not lost but rounding and the lag of one tick
NOTHING = 1e-3
#: A locus that is known exactly is the nearest one where it is within this factor of the first-order estimate
ALIKE = 2.0
#: Share of a limit from which on a joint counts as at it
REACHED = 1.0 - 1e-6


@dataclass(frozen=True, eq=False)
class Seen:
    """What an operator is shown after a tick.

    Attributes:
        step: the tick. active: pair in use. blending: a change is under way. stale: the last order is too old, rates
            are zero.
        sigma: least singular value of the scaled rows of the pair, see :class:`wbc.coordinates.Adviser`. kept: sigma
            over that of the task alone, 1 at most. advised: the pair to use among those that command the same.
        asked, met: rates of the task rows that were ordered, and those that the command gives [m/s, rad/s].
        lost: |D (asked - met)| / |D asked|, D: metres over the arm's length; 0 where nothing is asked.
        why: what took it, in words.
        ramping: rates are on their way to what is asked: nothing holds them back but a change of pairs, or
            accelerations of joints, and those no further than in the tick before. Such a part of the command is late
            and not lost.
    """

    step: PairStep
    active: str
    blending: bool
    stale: bool
    sigma: float
    kept: float
    advised: str
    asked: Array
    met: Array
    lost: float
    why: tuple[str, ...]
    ramping: bool


class Teleoperation(Sealed):
    """Drives an arm by an operator's orders.

        session = Teleoperation("spdm", ["M1", "M6"])
        q = session.start()                                       # away from singular configurations
        session.reset(q)
        seen = session.step(q, Order((0.01, 0, 0, 0, 0, 0)))      # 50 times a second
        session.step(q, Order(pair="body_joint | hands"))

    One sub-chain moves at a time: locks of a pair are the brakes of all others. Rates are those of the active pair's
    task rows, at most six; an order without rates leaves the last ones, which count for half a second. The fastest rate
    that a row may be given is ``fastest``; what the joints cannot do the limits take from the task, and every
    :class:`Seen` says how much that was and why.

    Args:
        robot: what :func:`wbc.robots.load` takes by name or file, or a robot; see :func:`wbc.coordinates.parts`.
        modes: whose pairs can be chosen; default: M1 and M2, as far as the robot has them. pairs: more pairs, of one's
            own. items: further constraints.
        seconds: time of a change of pairs [s]. fastest: rates in metres and in radians [m/s, rad/s].
        automatic: change to the pair that is advised.
        acceleration: of all joints [rad/s^2]; default: 0.02 for the published arms, else the robot's own, and 10 where
            it has none.
        scaled: rates that the joints cannot have are slowed down together, and keep their direction.

    Raises:
        UnknownNameError, MissingPartError: no such robot or mode, or a mode that the robot has not.
        RangeError: no pairs, or one with a task of more than six rows.
    """

    def __init__(
        self,
        robot: str | Robot,
        modes: Iterable[str | Mode] | None = None,
        *,
        pairs: Sequence[CoordinatePair] = (),
        items: Sequence[Item] = (),
        seconds: float = 2.0,
        fastest: tuple[float, float] = (0.3, 0.07),
        automatic: bool = False,
        acceleration: float | None = None,
        scaled: bool = False,
        backend: str = "auto",
    ) -> None:
        chosen = (
            [mode(one) for one in validation.items("modes", modes, "modes")]
            if modes is not None
            else modes_of(robot, USUAL)
        )
        self.robot = _slowed(parts(robot).robot, robot, acceleration)
        given = dict.fromkeys([*(p for one in chosen for p in mode_pairs(robot, one)), *pairs_of(pairs, some=False)])
        for pair in given:
            rows = row_count(self.robot, pair.task)
            if rows > 6:
                raise RangeError("pairs", pair.name, f"its task has {rows} rows, an operator gives at most 6 rates")
        self._seconds = validation.scalar("seconds", seconds, low=0.0, unit="s")
        metres, radians = validation.ordinary_array("fastest", fastest, (2,)).tolist()
        self._fastest = [validation.scalar("fastest", x, low=0.0, open_low=True) for x in (metres, radians)]
        self._automatic = validation.flag("automatic", automatic)
        self.control = PairController(self.robot, list(given), 1.0 / RATE, items=items, scaled=scaled, backend=backend)
        self.adviser = Adviser(self.robot, list(given), exact=False, backend=backend)
        self._tall = {pair.name for pair in given if pair.over_determined(self.robot)}
        for pair in given:
            if pair.name in self._tall:
                # What a cue needs is made here, not in the first tick that has one
                motion_cue(self.robot, pair, self.robot.neutral, np.zeros(row_count(self.robot, pair.task)))
        self._scale = {pair.name: scales(self.robot, pair.task)[0] for pair in given}
        self._order, self._age = Order(), 0.0
        #: Rates asked for in the last tick, and how far they were missed
        self._asked, self._missed = np.zeros(0), np.inf

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all pairs, in order."""
        return tuple(self.control.pairs)

    @property
    def units(self) -> tuple[str, ...]:
        """m or rad of each row of the active pair's task."""
        return self.control.units(self.control.pair.task)

    def start(self) -> Array:
        """A configuration to begin at, away from singular ones of any pair; see :func:`regular_start`."""
        return regular_start(self.robot, list(self.control.pairs.values()))

    def reset(self, q: Any) -> None:
        """Begin at a configuration, at rest.

        Raises:
            ShapeError, NotFiniteError, RotationError: no configuration; nothing is changed.
        """
        self.control.reset(q)
        self._order, self._age = Order(), 0.0
        self._asked = np.zeros(0)

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
        sigma, task, advised = self.adviser.look(q, self.control.active)
        if self._automatic and advised != self.control.active and not self.control.blending:
            self.control.switch(advised, self._seconds)
            sigma, task, _ = self.adviser.look(q, advised)
        blending = self.control.blending
        self.control.command(self._rates(self.control.pair, Order() if stale else self._order))
        before = self.control.controller.last_command
        step = self.control.step(q)
        asked, met = self.control.asked, self.control.met(step.v)
        scale = self._scale[self.control.active]
        size = float(np.linalg.norm(scale * asked))
        missed = float(np.linalg.norm(scale * (asked - met)))
        lost = missed / size if size > 0.0 else 0.0
        kept = min(1.0, sigma / task) if task > 0.0 else float(sigma > 0.0)
        at, solved = self._at_limits(step, before), step.ended is Status.SOLVED
        why = self._why(q, step, sigma, kept, blending, at) if lost > NOTHING or not solved else ()
        held_back = at.keys() - {"acceleration"} or self.control.eased or not solved
        nearer = missed <= self._missed or not np.array_equal(asked, self._asked)
        ramping = lost > NOTHING and not held_back and (blending or (nearer and bool(at)))
        if ramping:
            why = ("rates rise or fall to what is asked", *why)
        self._asked, self._missed = asked, missed
        active = self.control.active
        return Seen(step, active, self.control.blending, stale, sigma, kept, advised, asked, met, lost, why, ramping)

    def nearest_locus(self, q: Any, name: str) -> str:
        """Where the rank of a pair, or of its task, is lost next, and how far away that is, in words.

        Determinants are factored for it, which takes seconds where that was not done before.

        Raises:
            UnknownNameError: no such pair. ShapeError, NotFiniteError, RotationError: no configuration.
        """
        pair = self.control.pairs[validation.one_of("pair", name, self.control.pairs)]
        here = next(one for one in self.adviser.advise(q) if one.pair == name)
        lost = f"where {'its task' if here.condition is Condition.TASK else 'the pair'} loses rank"
        known = closed_form(self.robot, pair)
        found = known.nearest(q) if known is not None else None
        if found is not None and abs(found[1]) <= ALIKE * here.distance:
            return f"{abs(found[1]):.2g} {self.robot.dof_units[found[0].dof]} from {found[0]}, {lost}"
        return f"about {here.distance:.2g} rad from {lost}"

    def _at_limits(self, step: PairStep, before: Array) -> dict[str, list[str]]:
        """Joints whose rates end at a limit, by what it limits: their acceleration, their rate or their position."""
        out: dict[str, list[str]] = {}
        limits, names = self.robot.limits, self.robot.dof_names
        for joint in dict.fromkeys(b.row for b in step.binding if b.row in names and b.bound != "equal"):
            k = names.index(joint)
            if abs(step.v[k] - before[k]) >= REACHED * limits.acceleration[k] * self.control.dt:
                kind = "acceleration"
            else:
                kind = "rate" if abs(step.v[k]) >= REACHED * limits.velocity[k] else "position"
            out.setdefault(kind, []).append(joint)
        return out

    def _why(
        self, q: Array, step: PairStep, sigma: float, kept: float, blending: bool, at: dict[str, list[str]]
    ) -> tuple[str, ...]:
        """What took a part of the command."""
        out = []
        if blending:
            out.append("pairs are changing")
        if self.control.eased:
            what = "the task is near a singular configuration" if kept > 0.5 else "this pair is near a locus of its own"
            out.append(f"{what}, sigma {sigma:.2g}")
        if self.control.active in self._tall:
            cue = motion_cue(self.robot, self.control.pair, q, self.control.asked)
            out.append(f"more rows than joints: {cue}")
        out += [f"{kind} limits of {', '.join(joints)}" for kind, joints in at.items()]
        if step.relaxed:
            out.append(f"relaxed: {', '.join(dict.fromkeys(slack.item for slack in step.relaxed))}")
        if step.ended is not Status.SOLVED:
            out.append(f"the tick is {step.ended}")
        return tuple(out) or ("other constraints, or the pair has no full rank here",)

    def _take(self, order: Order) -> None:
        """Check an order as a whole, then follow it."""
        validation.instance("order", order, Order, "an Order")
        name = validation.one_of("pair", order.pair or self.control.active, self.control.pairs)
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


def _slowed(robot: Robot, asked: str | Robot, acceleration: float | None) -> Robot:
    """A robot with the acceleration limits of manual control."""
    if acceleration is not None:
        slow = validation.scalar("acceleration", acceleration, low=0.0, open_low=True, unit="rad/s^2")
        return robot.with_limits(acceleration=slow)
    if isinstance(asked, str) and asked in OPERATOR_ARMS:
        return robot.with_limits(acceleration=SLOW)
    own = robot.limits.acceleration
    free = ~np.isfinite(own) & (np.arange(robot.nv) >= robot.base_nv)
    return robot.with_limits(acceleration=np.where(free, PLAIN, own)) if free.any() else robot
