"""``wbc bench``: the benchmarks of the repository."""

from __future__ import annotations

import os
import pathlib
import sys

import typer

from wbc.errors import WbcError

#: The repository, if the package is installed from one
ROOT = pathlib.Path(__file__).resolve().parents[2]

#: First argument -> the module, and its arguments, that measures something else than the tick
OTHERS = {
    "time-laws": "bench.time_laws",
    "ik": "bench.ik",
    "walk": "bench.walk",
    "resolvers": "bench.resolvers",
    "viewer": "bench.figures --only viewer",
    "batch": "bench.figures --only batch",
    "fsp": "bench.figures --only fsp fsp_norms",
}


class BenchError(WbcError):
    """The benchmark is not there: it is part of the repository, not of the installed package."""


def bench(context: typer.Context) -> None:
    """Compare with pink, mink and placo on the same problems (needs the repository).

    Arguments after the command go to the benchmark: wbc bench --problems panda --rounds 2

    wbc bench time-laws compares laws of motion with raw toppra and raw ruckig: wbc bench time-laws --count 100000

    wbc bench ik measures inverse kinematics on the protocol of TRAC-IK: wbc bench ik --full

    wbc bench walk plans and walks courses, turns, trenches and layouts: wbc bench walk --quick

    wbc bench resolvers drives the Space Station arm by classical rate resolution and by pairs

    wbc bench viewer measures what the viewer costs a loop, and how long a drag takes

    wbc bench batch measures ticks of thousands of robots, and a map of a million poses

    wbc bench fsp measures solution spaces, printed norms, and paths resolved as a whole
    """
    if not (ROOT / "bench" / "__main__.py").is_file():
        reason = "the benchmark is not installed with the package; run it from a clone of the repository"
        raise BenchError("bench", str(ROOT / "bench"), reason)
    given = list(context.args)
    module = OTHERS[given.pop(0)] if given and given[0] in OTHERS else "bench"
    # In place of this process: whoever interrupts or kills it means the benchmark, which ends with what it has
    os.chdir(ROOT)
    os.execv(sys.executable, [sys.executable, "-m", *module.split(), *given])
