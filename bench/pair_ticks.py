"""``python -m bench.pair_ticks``: median time of a tick of a coordinate pair, beside that of its controller."""

from __future__ import annotations

import argparse
from time import perf_counter

import numpy as np

from wbc.coordinates import PairController, mode_pairs, parts, regular_start

#: Ticks of each pair
TICKS = 1000


def pair_ticks(name: str, ticks: int = TICKS) -> dict[str, tuple[float, float]]:
    """Pair of M1 -> (median time of a command and a tick, of the bare controller's tick) [s], the arm in motion."""
    robot, pairs = parts(name).robot, mode_pairs(name, "M1")
    control, out = PairController(robot, pairs), {}
    start = regular_start(robot, pairs)
    for pair in control.pairs:
        control.switch(pair, 0.0)
        control.reset(start)
        q, rows = start.copy(), len(control.asked)
        spent, bare = np.empty(ticks), np.empty(ticks)
        for k in range(ticks):
            command = 0.002 * np.sin(k / 30.0 + np.arange(rows))
            began = perf_counter()
            control.command(command)
            step = control.step(q)
            spent[k] = perf_counter() - began
            q = q + control.dt * step.v
        for k in range(ticks):
            began = perf_counter()
            control.controller.step(q)
            bare[k] = perf_counter() - began
        out[pair] = float(np.median(spent)), float(np.median(bare))
    return out


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("arm", nargs="?", default="ssrms", help="name of a robot; default: ssrms")
    parser.add_argument("--ticks", type=int, default=TICKS)
    given = parser.parse_args()
    for pair, (whole, bare) in pair_ticks(given.arm, given.ticks).items():
        print(f"{pair:24} {1e6 * whole:6.1f} us, of these the controller {1e6 * bare:5.1f} us")


if __name__ == "__main__":
    main()
