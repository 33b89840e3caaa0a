"""Times of ticks."""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter

import numpy as np

from wbc.api import Controller


def median_us(controller: Controller, q: np.ndarray, ticks: int = 1000, turns: int = 5) -> float:
    """Median of ``controller.step(q)`` [us] about a configuration, of the quickest of some turns."""
    return median_at(controller, q + 1e-3 * np.random.default_rng(1).normal(size=(64, q.size)), None, ticks, turns)


def median_at(
    controller: Controller, states: Sequence[np.ndarray], v: np.ndarray | None, ticks: int, turns: int
) -> float:
    """The same at some configurations, one after the other; ``v``: the velocity at all of them, if it is told."""
    least = np.inf
    for _ in range(turns):
        spent = np.empty(ticks)
        for k in range(ticks):
            at = states[k % len(states)]
            began = perf_counter()
            controller.step(at, v)
            spent[k] = perf_counter() - began
        least = min(least, float(np.median(spent)))
    return 1e6 * least
