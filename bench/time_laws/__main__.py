"""``python -m bench.time_laws``: measure laws beside raw toppra and raw ruckig, print, write time_laws.md and .json.

Ctrl-C ends the measuring; what was measured until then is printed and written.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from bench.figures.store import stamp
from bench.harness import machine
from bench.pool import ROOT
from bench.program import Record, bars, measure, publish
from bench.time_laws import least_time, states, ticks
from bench.time_laws.tables import sheets
from wbc.interrupts import obey_interrupts

PACKAGES = ("wbc", "toppra", "ruckig", "numpy", "scipy", "pin")

#: Sizes of a quick run and of a full one: problems of each size, or states, or blocks of ticks for each course
QUICK = {"random set": 8, "small moves": 25, "torques": 6, "states": 20_000, "ticks": 12}
FULL = {"random set": 100, "small moves": 200, "torques": 30, "states": 1_000_000, "ticks": 80}

NOTES = """\
Ratios are the largest |velocity| / limit or |acceleration| / limit of a law. toppra's output is a cubic spline of \
time, or its path with constant accelerations between grid points: polynomials both, so that all ratios of the random \
set and the small moves come from the exact certificate, none from samples. In the random set both follow the same \
splines, the waypoints evenly over s in [0, 1]; in the small moves wbc takes its own parameter, the distance. A time \
is the least of two, for the path, the law and, for wbc, the certificate.

Torques are sampled, 8 times in each interval of the grid or more. "With bound" adds what may lie between samples: \
that counts for wbc, and only what was seen counts against toppra.

States: "random" are ruckig's own random inputs; the others lie within 1e-13 to 1e-8 of their target, in all joints \
("near rest"), in all but one, or in position alone. Excess and errors are computed from the cubics of wbc's laws, not \
by its certificate.

A tick of `Ruckig.update` includes the new target, the state as numpy arrays and `pass_to_input`; a tick of wbc's \
filter the new target, its check, and position limits."""


def parts_of(sizes: dict[str, int], seed: int, processes: int) -> dict[str, tuple[int, Iterator[Record]]]:
    """Part -> (number of records, the records as they are measured); each part has a seed of its own."""
    n, rngs = sizes, {name: np.random.default_rng([seed, number]) for number, name in enumerate(QUICK)}
    return {
        # First: what the other parts leave in memory makes collections of garbage, and so ticks, slower
        "ticks": (len(ticks.COURSES) * n["ticks"], ticks.blocks(rngs["ticks"], n["ticks"])),
        "random set": (2 * n["random set"], least_time.random_set(rngs["random set"], n["random set"])),
        "small moves": (7 * n["small moves"], least_time.small_moves(rngs["small moves"], n["small moves"])),
        "torques": (n["torques"], least_time.torques(rngs["torques"], n["torques"])),
        # Last: it takes the longest, and a run that is ended in it has everything else
        "states": (states.chunks(n["states"]), states.random_states(seed, n["states"], processes)),
    }


def main(given: list[str] | None = None) -> None:
    """Parse the arguments and run."""
    parser = argparse.ArgumentParser(prog="python -m bench.time_laws", description=__doc__)
    parser.add_argument("--full", action="store_true", help="the sizes of the published tables, 10^6 states")
    parser.add_argument("--share", type=float, default=1.0, help="of these sizes, for a shorter run")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1, help="for the states")
    parser.add_argument("--output", type=Path, help="folder; by default bench for full runs, else build/bench")
    chosen = parser.parse_args(given)
    output = chosen.output or (ROOT / "bench" if chosen.full else ROOT / "build" / "bench")
    sizes = {name: max(1, round(chosen.share * n)) for name, n in (FULL if chosen.full else QUICK).items()}
    host, begun = machine(), stamp()
    about = [
        f"{host['processor']}, Python {host['python']}; {host['cores']}; load {host['load']}.",
        f"States on {chosen.processes} processes, all else in one.",
        ", ".join(f"{name} {importlib.metadata.version(name)}" for name in PACKAGES)
        + f"; seed {chosen.seed}; "
        + ", ".join(f"{name} {size}" for name, size in sizes.items()),
    ]
    with bars() as progress:
        parts, interrupted = measure(parts_of(sizes, chosen.seed, max(1, chosen.processes)), progress)
    if interrupted:
        about.insert(0, f"Ended by Ctrl-C in: {interrupted}.")
    tables = sheets(parts)
    kept = {"stamp": begun, "about": about, "interrupted": interrupted, "tables": [vars(sheet) for sheet in tables]}
    publish(output / "time_laws", tables, [*about, *NOTES.split("\n\n")], kept)


if __name__ == "__main__":
    obey_interrupts()
    main()
