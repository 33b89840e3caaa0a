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
        way: of the hand, see :data:`wbc.walking.planner.swings.curve.WAYS`.
    """

    arm: int
    source: int
    target: int
    lift: int
    land: int
    duration: float
    delay: float
    way: int = 0
