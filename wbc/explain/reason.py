"""What stands in the way of a task: data, and the same as a sentence in SI units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc.validation import Array

#: More that hold a task are told by name alone
_MANY = 4


def amount(value: float, unit: str) -> str:
    """A number with its unit, lengths below a metre in millimetres or micrometres: ``31 mm/s``."""
    prefix = ""
    if (unit == "m" or unit.startswith("m/")) and np.isfinite(value) and 1e-7 <= abs(value) < 1.0:
        value, prefix = (1e3 * value, "m") if abs(value) >= 1e-4 else (1e6 * value, "u")
    return f"{value if abs(value) > 1e-13 else 0.0:.3g} {prefix}{unit}".rstrip()


def amounts(parts: tuple[tuple[float, str], ...]) -> str:
    """Parts of an error by unit; those that are nothing beside the others are left out."""
    named = [amount(value, unit) for value, unit in parts if value > 1e-6] or [amount(*parts[0])]
    return " and ".join(named)


@dataclass(frozen=True, eq=False)
class Reason:
    """Why a task does or does not converge.

    Attributes:
        task: its name. kind: ``done``: nothing to do; ``slow``: as its gain, or braking in time, wants it;
            ``limited``: speed or acceleration limits slow it down; ``held``: other items slow it down or turn it aside;
            ``singular``: no joint serves a direction of it, though its target can be reached; ``minimum``: the gradient
            of its error vanishes within what the others leave, though its target can be reached; ``reach``: it cannot.
        error: norm of its error by unit. rate: how fast that falls now by unit, negative where it grows.
        gain: of the task [1/s].
        beyond: error by unit at the nearest configuration that a search found. nearest: that configuration [nq], None
            where none was searched. place: position of the task's frame there [m], None for tasks without one.
            starts: of the search.
        singular: smallest singular value of the task's rows, in radians and characteristic lengths. direction: label
            and share of each row in the direction that no joint serves. lost: error along it. restores: the joint that
            moves most along the steepest way out, empty where the error has no slope downhill from here.
        by: items and bounds that hold it, the strongest first. without: what puts it out of
            reach, position limits or holds; without them it is within.
        follows: of a task at a moving target, the part of the rate it asks for that it has; None for others.
    """

    task: str
    kind: str
    error: tuple[tuple[float, str], ...]
    rate: tuple[tuple[float, str], ...]
    gain: float
    beyond: tuple[tuple[float, str], ...] = ()
    nearest: Array | None = None
    place: Array | None = None
    starts: int = 0
    singular: float = np.inf
    direction: tuple[tuple[str, float], ...] = ()
    lost: tuple[tuple[float, str], ...] = ()
    restores: str = ""
    by: tuple[str, ...] = ()
    without: tuple[str, ...] = ()
    follows: float | None = None

    def __str__(self) -> str:
        say = {
            "done": self._done,
            "slow": self._slow,
            "limited": self._limited,
            "held": self._held,
            "singular": self._singular,
            "minimum": self._minimum,
            "reach": self._reach,
        }
        return say[self.kind]() + "."

    def _done(self) -> str:
        return f"{self.task} has nothing to do: its error is {amounts(self.error)}"

    def _slow(self) -> str:
        if self.gain == 0.0:
            return f"{self.task} is {amounts(self.error)} off and stays there because its gain is 0 1/s"
        text = f"{self.task} is {amounts(self.error)} off and {self._comes()}"
        worst = max(range(len(self.error)), key=lambda k: self.error[k][0])
        share = self.rate[worst][0] / (self.gain * max(self.error[worst][0], 1e-12))
        if share > 0.9:
            return f"{text}, as its gain of {self.gain:.3g} 1/s asks"
        return f"{text}: {100 * share:.2g} % of what its gain of {self.gain:.3g} 1/s asks, so that the joints can brake"

    def _comes(self) -> str:
        parts = [(value, unit) for value, unit in self.rate if abs(value) > 1e-6]
        if not parts:
            return "does not move towards its target"
        # The word belongs to the first part; a part of the other sign says so itself
        near = [amount(value, f"{unit}/s") for value, unit in parts if value > 0.0]
        far = [amount(-value, f"{unit}/s") for value, unit in parts if value < 0.0]
        words = ([f"comes nearer by {' and '.join(near)}"] if near else []) + (
            [f"goes away by {' and '.join(far)}"] if far else []
        )
        return " and ".join(words)

    def _limited(self) -> str:
        return f"{self._goes()}; slowed by {self._held_by()}"

    def _held(self) -> str:
        return f"{self._goes()}; held back by {self._held_by()}"

    def _goes(self) -> str:
        if self.follows is None:
            return f"{self.task} is {amounts(self.error)} off and {self._comes()}"
        return f"{self.task} follows its moving target at {100.0 * self.follows:.2g} % of the rate that this takes"

    def _held_by(self) -> str:
        """What holds it; of many the names, with the rows of an item together."""
        if len(self.by) <= _MANY:
            return ", ".join(self.by)
        items: dict[str, list[str]] = {}
        for text in self.by:
            item, _, row = text.partition(" (")[0].partition("/")
            items.setdefault(item, []).extend([row] if row else [])
        return ", ".join(f"{item} ({', '.join(rows)})" if rows else item for item, rows in items.items())

    def _minimum(self) -> str:
        text = f"{self.task} is at a local minimum, {amounts(self.error)} off: no velocity"
        if self.by:
            return f"{text} that {self._held_by()} would allow brings it nearer, though its target can be reached"
        return f"{text} brings it nearer, though another configuration reaches its target"

    def _singular(self) -> str:
        along = ", ".join(f"{share:+.2g} {label}" for label, share in self.direction)
        text = (
            f"{self.task} is singular: no joint moves it along ({along}), in which {amounts(self.lost)} of its error "
            f"of {amounts(self.error)} lie; smallest singular value {self.singular:.2g}"
        )
        return f"{text}. The target can be reached, and moving {self.restores} begins it" if self.restores else text

    def _reach(self) -> str:
        text = (
            f"{self.task} is out of reach by {amounts(self.beyond)}, at the nearest configuration that "
            f"{self.starts} searches found"
        )
        if self.place is not None:
            text += f", with its frame at ({', '.join(f'{x:.3g}' for x in self.place)}) m"
        if self.without:
            text += f"; it is within reach without {', '.join(self.without)}"
        return text
