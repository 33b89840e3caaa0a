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


def parts_of(sizes: dict[str, int], seed: int, repeats: int, processes: int) -> dict[str, tuple[int, Iterator[Record]]]:
    """Part -> (number of records, the records as they are measured); each part has a seed of its own."""

    def rng(number: int) -> np.random.Generator:
        return np.random.default_rng([seed, number])

    n = sizes
    return {
        # First: what the other parts leave in memory makes collections of garbage, and so ticks, slower
        "ticks": (len(ticks.COURSES) * n["ticks"], ticks.blocks(rng(6), n["ticks"])),
        "random set": (2 * n["random set"], least_time.random_set(rng(1), n["random set"], repeats)),
        "small moves": (7 * n["small moves"], least_time.small_moves(rng(2), n["small moves"])),
        "torques": (n["torques"], least_time.torques(rng(3), n["torques"])),
        # Last: it takes the longest, and a run that is ended in it has everything else
        "states": (states.chunks(n["states"]), states.random_states(seed, n["states"], processes)),
    }


def setting(chosen: argparse.Namespace, sizes: dict[str, int]) -> list[str]:
    """What a reader has to know about the run."""
    host = machine()
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in PACKAGES)
    cores = f"{len(os.sched_getaffinity(0))} of {os.cpu_count()} cores"
    listed = ", ".join(f"{name} {size}" for name, size in sizes.items())
    return [
        f"{host['processor']}, {cores}, Python {host['python']}; load {host['load']}.",
        f"{host['threads']}; states on {chosen.processes} processes, all else in one.",
        f"{versions}; seed {chosen.seed}; {listed}.",
    ]


def arguments(given: list[str] | None) -> argparse.Namespace:
    """What is asked for."""
    parser = argparse.ArgumentParser(prog="python -m bench.time_laws", description=__doc__)
    parser.add_argument("--full", action="store_true", help="the sizes of the published tables, 10^6 states")
    parser.add_argument("--count", type=int, help="states from which raw ruckig and wbc start")
    parser.add_argument("--problems", type=int, help="problems of every other part, for a shorter run")
    parser.add_argument("--parts", nargs="+", choices=QUICK, help="only these")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1, help="for the states")
    parser.add_argument(
        "--output",
        type=Path,
        help="folder for time_laws.md and .json; by default bench for full runs, else build/bench",
    )
    chosen = parser.parse_args(given)
    chosen.output = chosen.output or (ROOT / "bench" if chosen.full else ROOT / "build" / "bench")
    return chosen


def sizes_of(chosen: argparse.Namespace) -> dict[str, int]:
    """Sizes of the parts."""
    sizes = dict(FULL if chosen.full else QUICK)
    if chosen.problems is not None:
        sizes = dict.fromkeys(sizes, max(1, chosen.problems)) | {"states": sizes["states"]}
    if chosen.count is not None:
        sizes["states"] = max(1, chosen.count)
    return sizes


def main(given: list[str] | None = None) -> None:
    """Parse the arguments and run."""
    chosen = arguments(given)
    sizes = sizes_of(chosen)
    work = parts_of(sizes, chosen.seed, 2, max(1, chosen.processes))
    if chosen.parts:
        work = {name: part for name, part in work.items() if name in chosen.parts}
    about, begun = setting(chosen, sizes), stamp()
    with bars() as progress:
        parts, interrupted = measure(work, progress)
    if interrupted:
        about.insert(0, f"Ended by Ctrl-C in: {interrupted}.")
    tables = sheets(parts)
    kept = {"stamp": begun, "about": about, "interrupted": interrupted, "tables": [vars(sheet) for sheet in tables]}
    publish(chosen.output / "time_laws", tables, [*about, *NOTES.split("\n\n")], kept)


if __name__ == "__main__":
    obey_interrupts()
    main()
