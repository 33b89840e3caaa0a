"""Pairs that change by themselves, inside a stated set."""

from __future__ import annotations

from typing import Any

from wbc import validation
from wbc.coordinates.advice.adviser import Adviser
from wbc.coordinates.control.pair_controller import PairController
from wbc.coordinates.control.pair_step import PairStep
from wbc.errors import RangeError


class AutomaticPairs:
    """Drives a :class:`PairController` and changes to the pair that an :class:`Adviser` recommends.

        auto = AutomaticPairs(control, adviser, seconds=2.0)
        auto.command(rates)
        step = auto.step(q)

    All pairs of the adviser command the same task coordinates, so that a command goes on over a change. Changes wait
    for the end of a blend; what a blend keeps is said in :class:`PairController`.

    Attributes:
        control, adviser: as given. changes: (time [s], name) of every change.

    Raises:
        RangeError: a pair that the controller does not have, or pairs with different tasks.
    """

    def __init__(self, control: PairController, adviser: Adviser, seconds: float = 1.0) -> None:
        validation.instance("control", control, PairController, "a PairController")
        validation.instance("adviser", adviser, Adviser, "an Adviser")
        for name, pair in adviser.pairs.items():
            if control.pairs.get(name) != pair:
                raise RangeError("adviser", name, "the controller has no such pair")
            if pair.task != control.pair.task:
                raise RangeError("adviser", name, "its task is not that of the active pair")
        self.control, self.adviser = control, adviser
        self._seconds = validation.scalar("seconds", seconds, low=0.0, unit="s")
        self._time = 0.0
        self.changes: list[tuple[float, str]] = []

    def command(self, rates: Any) -> None:
        """See :meth:`PairController.command`."""
        self.control.command(rates)

    def step(self, q: Any, v: Any = None, dt: Any = None) -> PairStep:
        """One cycle, see :meth:`PairController.step`; a change begins before it."""
        if not self.control.blending:
            name = self.adviser.recommend(q, self.control.active)
            if name != self.control.active:
                self.control.switch(name, self._seconds)
                self.changes.append((self._time, name))
        step = self.control.step(q, v, dt)
        self._time += self.control.dt if dt is None else float(dt)
        return step
