"""The bench of pairs' ticks, and what they cost at best."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from bench.pair_ticks import pair_ticks
from wbc.coordinates import PairController, mode_pairs, parts


def test_every_pair_is_measured() -> None:
    found = pair_ticks("spherical_4r", 40)
    assert list(found) == [pair.name for pair in mode_pairs("spherical_4r", "M1")]
    assert all(0.0 < bare < whole < 1.0 for whole, bare in found.values())


def test_a_tick_of_a_pair_stays_below_its_goal() -> None:
    """30 us for a command and a tick of the Space Station arm; the best of many, so that other load is no matter."""
    control = PairController(parts("ssrms").robot, mode_pairs("ssrms", "M1"))
    start = np.array([0.3, 0.4, -0.5, 1.2, 0.7, -0.6, 0.9])
    for pair in list(control.pairs)[:5]:
        control.switch(pair, 0.0)
        control.reset(start)
        q, best = start, np.inf
        for k in range(300):
            command = 0.002 * np.sin(k / 30.0 + np.arange(6))
            began = perf_counter()
            control.command(command)
            step = control.step(q)
            best = min(best, perf_counter() - began)
            q = q + control.dt * step.v
        assert best < 30e-6, pair
