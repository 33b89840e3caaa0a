"""The published walker in the thesis's units, for its tests: walks of one command, and what their logs say."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from wbc.published.three_arm_walker import PublishedLog, PublishedOutcome, PublishedWalker

INCH = 0.0254


def rows(*numbers: int) -> list[tuple[int, int]]:
    """Places of whole rows of holds."""
    return [(column, row) for column in range(1, 26) for row in numbers]


def driven(
    place: tuple[int, int],
    velocity: Any,
    until: Callable[[tuple[float, float, float]], bool] = lambda place: False,
    duration: float = 300.0,
    **options: Any,
) -> tuple[PublishedWalker, PublishedOutcome]:
    """A walker after one velocity command, round, along [in/s] and spin [rad/s], or a function of the time."""
    walker = PublishedWalker(place, **options)

    def inches(time: float) -> np.ndarray:
        given = velocity(time) if callable(velocity) else velocity
        return np.asarray(given, dtype=float) * [INCH, INCH, 1.0]

    return walker, walker.drive(inches, duration, key=lambda time: until(walker.place))


def along(
    speed: float, start: int, goal: int, removed: Iterable[Any] = (), **options: Any
) -> tuple[PublishedWalker, PublishedOutcome]:
    """Along column 13 from a row to another."""
    way = float(np.sign(goal - start))
    return driven(
        (13, start), (0.0, way * speed, 0.0), lambda place: way * (place[1] - goal) >= 0.0, removed=removed, **options
    )


def shared(log: PublishedLog) -> np.ndarray:
    """Cycles in which two arms have one place."""
    pairs = [(log.places[:, a] == log.places[:, b]).all(axis=1) for a, b in ((0, 1), (0, 2), (1, 2))]
    return np.asarray(np.any(pairs, axis=0))


def hold_offsets(log: PublishedLog) -> np.ndarray:
    """Distances of supporting hands from their holds [in]."""
    angle = np.radians(25.0 + 5.0 * log.places[..., 0])
    points = np.stack([-100.0 * np.cos(angle), 100.0 * np.sin(angle), -9.25 * log.places[..., 1]], axis=-1)
    return np.asarray(np.linalg.norm(log.hands[..., :3, 3] / INCH - points, axis=-1)[log.supporting])
