"""An arm that a page drives by pairs of coordinates: rates of what is commanded, other pairs, and swaps."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from wbc.coordinates import CoordinatePair, expressions
from wbc.coordinates.rows import Coordinate
from wbc.simulation import Connection
from wbc.teleop import Order, Teleoperation
from wbc.viewer.beside import Viewer, show
from wbc.viewer.messages import MessageError
from wbc.viewer.operation import Operation
from wbc.viewer.paced import ticks
from wbc.viewer.pairing import PairAbout, Pairing

#: Rates at full stick [m/s, rad/s]
OPERATED_SPEED = (0.15, 0.05)


class PairOperation(Operation):
    """Obeys a page for :class:`wbc.teleop.Teleoperation`: its messages are ``pair``, ``swap`` and ``drive``.

    A stop asks every coordinate for rest at once; joints brake as fast as their acceleration limits allow, and what is
    held gives way for that.
    """

    def __init__(self, session: Teleoperation, pairing: Pairing) -> None:
        super().__init__(session.control.controller)
        self.session, self.pairing = session, pairing
        self._about = {one.pair.name: one for one in pairing.pairs}
        self._order: Order | None = None

    def check(self, message: Mapping[str, Any]) -> None:
        self.pairing.checked(message)

    def obey(self, message: Mapping[str, Any]) -> None:
        """Do what a message says.

        Raises:
            WbcError: it does not fit; nothing has changed.
        """
        self.check(message)
        kind = message["type"]
        if kind not in ("pair", "swap", "drive"):
            super().obey(message)
            return
        if self.stopped:
            raise MessageError("message", kind, f"the robot is stopped ({self.stopped}); resume first")
        if kind == "pair":
            self._order = Order(pair=message["name"], stop=True)
        elif kind == "swap":
            other = self._now.swapped
            if not other:
                raise MessageError("swap", self._now.pair.name, "no pair commands what this one holds")
            self._order = Order(pair=other, stop=True)
        elif self._order is None or not self._order.pair:
            units = self._now.units
            if len(message["rates"]) != len(units):
                reason = f"{self._now.pair.name} commands {len(units)} rows"
                raise MessageError("drive.rates", message["rates"], reason)
            full = np.array([self.pairing.fastest[0 if unit == "m" else 1] for unit in units])
            self._order = Order(tuple((full * np.clip(message["rates"], -1.0, 1.0)).tolist()))

    def stop(self, reason: str) -> None:
        if not self.stopped:
            self.stopped, self._order = reason, Order(stop=True)
            self.session.control.halt()

    def resume(self) -> None:
        self.stopped = ""

    def take(self) -> Order | None:
        """The order for the next tick, None for nothing new."""
        control = self.session.control
        if self.stopped and control.controller.last_command.any():
            # What is held is held where the joints come to rest, not where the stop was asked for
            control.halt()
        order, self._order = self._order, None
        return order

    @property
    def _now(self) -> PairAbout:
        return self._about[self.session.control.active]


def pairing_of(session: Teleoperation) -> Pairing:
    """The pairs of a session."""
    control = session.control
    out = []
    for name, pair in control.pairs.items():
        rows = tuple(_label(one, row.label) for one in pair.task for row in expressions.labels(session.robot, one))
        swapped = next((other for other, two in control.pairs.items() if _swaps(pair, two)), "")
        items = control.items_of(name)
        out.append(PairAbout(pair, items, rows, control.units(pair.task), swapped, control.eased_below(name)))
    return Pairing(tuple(out), OPERATED_SPEED)


def _label(one: Coordinate, row: str) -> str:
    """A row with the name of its coordinate, once."""
    return str(one) if str(one).endswith(row) else f"{one} {row}"


def _swaps(one: CoordinatePair, other: CoordinatePair) -> bool:
    """The other commands some of what the one holds, and holds all that the one commands."""
    return set(other.task) <= set(one.constraint) and set(one.task) <= set(other.constraint)


def operate(
    robot: str,
    seconds: float | None = None,
    *,
    start: Any = None,
    backend: str = "auto",
    announce: Callable[[Viewer], None] | None = None,
    **options: Any,
) -> None:
    """An arm in real time, driven by pairs of coordinates from the page, until it or the time ends.

    Args:
        robot: as of :class:`wbc.teleop.Teleoperation`. options: as of :func:`wbc.viewer.show`.
        start: configuration to begin at; default: the session's own.

    Raises:
        ShapeError, NotFiniteError: ``start`` is none.
        UnknownNameError, MissingPartError: no such robot, or it has no pairs. What :func:`wbc.viewer.show` raises.
    """
    session = Teleoperation(robot, backend=backend, fastest=OPERATED_SPEED)
    control, pairing = session.control, pairing_of(session)
    operation = PairOperation(session, pairing)
    q = session.start() if start is None else session.robot.configuration("start", start)
    session.reset(q)
    connection = Connection(None, session.robot, control.dt)
    with show(control.controller, operation=operation, pairing=pairing, **options) as viewer, connection:
        if announce is not None:
            announce(viewer)
        state = connection.reset(q)
        for _ in ticks(viewer, control.dt, seconds):
            seen = session.step(state.q, operation.take())
            viewer.update(seen.step)
            state = connection.drive(seen.step.v)
