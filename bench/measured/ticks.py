"""Times of ticks."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from wbc.api import Controller


def median_us(controller: Controller, q: np.ndarray, ticks: int = 1000, turns: int = 5) -> float:
    """Median of ``controller.step(q)`` [us] about a configuration, of the quickest of some turns."""
    rng, least = np.random.default_rng(1), np.inf
    places = q + 1e-3 * rng.normal(size=(64, q.size))
    for _ in range(turns):
        spent = np.empty(ticks)
        for k in range(ticks):
            at = places[k % 64]
            began = perf_counter()
            controller.step(at)
            spent[k] = perf_counter() - began
        least = min(least, float(np.median(spent)))
    return 1e6 * least
