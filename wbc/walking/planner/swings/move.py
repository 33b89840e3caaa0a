"""A swing as the search over stances sees it."""

from __future__ import annotations

from typing import NamedTuple

Key = tuple[int, ...]


class Move(NamedTuple):
    """An arm's swing: from grip to grip, lifted and landed at samples of the path.

    Attributes:
        arm, source, target: row of the arm, and grips.
        lift, land: samples.
        duration: of the swing, latches and settling included [s].
        delay: by which the body is late after it, because it had to slow down [s].
        curve: which one, see :data:`wbc.walking.planner.swings.curve.ALTERNATIVES`.
    """

    arm: int
    source: int
    target: int
    lift: int
    land: int
    duration: float
    delay: float
    curve: int = 0


class Swing(NamedTuple):
    """A swing to be examined.

    Attributes:
        arm: row. source, target: grips. lift: sample of the body's path.
        until: last sample that the other arms can hold; the body waits there for the hand.
        others: grips of the other arms.
        soonest: sample at which the hand may land; a faster one takes until then.
    """

    arm: int
    source: int
    target: int
    lift: int
    until: int
    others: tuple[int, ...]
    soonest: int


class Chosen(NamedTuple):
    """How a hand swings: along which of the curves, and how long, latches and settling included [s]."""

    curve: int
    duration: float
