"""Pairs of task and constraint coordinates on a page: what there is to command, and a warning before rank is lost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from wbc import validation
from wbc.coordinates import CoordinatePair
from wbc.coordinates.chains import braked
from wbc.coordinates.control.conditioning import Conditioning
from wbc.robot import Robot
from wbc.validation import Array
from wbc.viewer.messages import PAIRED, WALKED, MessageError
from wbc.viewer.tick import Tick

#: How far ahead a loss of rank is told [s]
AHEAD = 4.0
#: Instants at which it is looked for, now among them
LOOKS = 9


class PairAbout(NamedTuple):
    """One pair as a page has it.

    Attributes:
        pair: its coordinates. items: names of the stack's items that are on while it is active.
        rows, units: of its task, m or rad. swapped: name of the pair that commands what this one holds and holds what
            it commands, "" for none. least: the least singular value below which its task gives way.
    """

    pair: CoordinatePair
    items: frozenset[str]
    rows: tuple[str, ...]
    units: tuple[str, ...]
    swapped: str
    least: float


class Pairing(NamedTuple):
    """The pairs of an arm, and the fastest rates that a page may ask for [m/s, rad/s]."""

    pairs: tuple[PairAbout, ...]
    fastest: tuple[float, float]

    def declared(self) -> dict[str, Any]:
        """For the message ``hello``."""
        pairs = [
            {"name": one.pair.name, "rows": one.rows, "units": one.units, "swapped": one.swapped} for one in self.pairs
        ]
        return {"pairs": pairs, "fastest": self.fastest}

    def checked(self, message: Mapping[str, Any]) -> None:
        """Refuse what no pair obeys; rates are those of the pair that is active when they are taken.

        Raises:
            WbcError: which field does not fit.
        """
        kind = message["type"]
        if kind == "pair":
            validation.one_of("pair.name", message["name"], [one.pair.name for one in self.pairs])
        elif kind == "drive":
            rates = validation.ordinary_array("drive.rates", message["rates"])
            if rates.ndim != 1 or np.abs(rates).max(initial=0.0) > 1.0 + 1e-9:
                raise MessageError("drive.rates", message["rates"], "expected parts of full speed, -1 to 1")
        elif kind in ("set", "rate") or kind in WALKED:
            raise MessageError("message.type", kind, "coordinates are driven by pairs", PAIRED)


class PairWatch:
    """What a page is told of the pairs at each tick."""

    def __init__(self, robot: Robot, pairing: Pairing) -> None:
        self._robot, self._pairs = robot, pairing.pairs
        self._names = frozenset[str]().union(*(one.items for one in pairing.pairs))
        some = [braked(robot, one.pair) for one in pairing.pairs]
        groups, brakes = [(*one.task, *one.held) for one in some], [one.joints for one in some]
        self._conditioning = Conditioning(robot, groups, brakes=brakes, backend="vm")
        self._least = np.array([one.least for one in pairing.pairs])

    def told(self, tick: Tick) -> dict[str, Any]:
        """The active pair, its least singular value and that below which its task gives way, and a warning or ""."""
        number = self.active(tick)
        sigma, warning = self.ahead(number, tick.q, tick.step.v)
        about = self._pairs[number]
        return {"pair": about.pair.name, "sigma": sigma, "least": about.least, "warning": warning}

    def active(self, tick: Tick) -> int:
        """Number of the pair whose items are on."""
        on = {name for name in self._names if tick.is_on(tick.block(name))}
        # A stop switches nothing off, and a switch changes all items at once
        return next((k for k, one in enumerate(self._pairs) if one.items == on), 0)

    def ahead(self, number: int, q: Array, v: Array) -> tuple[float, str]:
        """(least singular value of a pair now, what happens to it in :data:`AHEAD` seconds at these joint rates)."""
        times: Sequence[float] = np.linspace(0.0, AHEAD, LOOKS).tolist() if v.any() else [0.0]
        looks = np.array([self._conditioning.sigmas(self._robot.integrate(q, v, time)) for time in times])
        now, name = float(looks[0, number]), self._pairs[number].pair.name
        lost = np.flatnonzero(looks[:, number] < self._least[number])
        if not lost.size:
            return now, ""
        first = int(lost[0])
        when = f"in {times[first]:.1f} s at this speed" if first else "now"
        return now, f"{name} is near a locus {when}: its task gives way there.{self._better(number, looks[first])}"

    def _better(self, number: int, sigmas: Array) -> str:
        """The pair with the same task that keeps most of its rank there."""
        task = self._pairs[number].pair.task
        alike = [k for k, one in enumerate(self._pairs) if one.pair.task == task and sigmas[k] >= 2.0 * self._least[k]]
        if not alike:
            return " No pair with this task keeps its rank there."
        best = max(alike, key=lambda k: float(sigmas[k] / self._least[k]))
        return f" {self._pairs[best].pair.name} is not."
