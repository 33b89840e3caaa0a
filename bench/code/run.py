"""Exports the controller of a problem, builds it, and times it in turns with the Python tick on the same path."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from bench.harness import OURS, pythons, statistics
from bench.pool import contest, cores
from bench.problems import Array, load
from bench.sheet import Sheet

NOTE = """\
The tick as C: `controller.export` of a problem, built by its own Makefile with gcc, and once more for this processor, \
along the states and run-time inputs of the Python tick, which runs in turns with it. Nanoseconds are by \
clock_gettime, in Python by perf_counter_ns, not corrected for their own reading, some {reading:.0f} ns. Instructions \
are means over passes, counted by valgrind, which cannot run the instructions of every processor. Differences are of \
all commands from Python's."""

#: Builds of the exported folder: what is told to make
BUILDS = {
    "exported C": (),
    "exported C, -march=native": ("TICK_FLAGS=-O3 -march=native", "ROWS_FLAGS=-O1 -fstrict-aliasing -march=native"),
}
PROGRAM = Path(__file__).with_name("cycles.c")
#: Turns, and passes in each; passes that valgrind sees
TURNS, ROUNDS, COUNTED = 10, 5, 4


def measure(problem: Path, rounds: int | None, say: Callable[[str], None]) -> dict[str, Any]:
    """Everything of the problem in a folder; times in nanoseconds, instructions of one tick."""
    case, name, work = load(problem), problem.name, (problem / "code").absolute()
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    turns = rounds or TURNS
    with contest(pythons(None), problem) as workers:
        worker = workers[OURS]
        say(f"{name}: exporting")
        worker.ask("export", folder=str(work))
        folders = {}
        for label, options in BUILDS.items():
            say(f"{name}: building {label}")
            folders[label] = build(work / "export", work / label.replace(" ", "_"), options)
        spent: dict[str, list[Array]] = {label: [] for label in folders}
        python: dict[str, list[float]] = {"call": [], "native": []}
        agree = {}
        for turn in range(turns):
            say(f"{name}: the tick as C and in Python, turn {turn + 1} of {turns}")
            for label, folder in folders.items():
                some, agree[label] = timed(folder, work / "path.bin")
                spent[label].append(some)
            for _ in range(ROUNDS):
                answer = worker.ask("time", ticks=case.ticks)
                for part, kept in python.items():
                    kept += answer.get(part, [])
    rows = []
    for label, folder in folders.items():
        say(f"{name}: counting instructions of {label}")
        counts = instructions(str(work / "path.bin"), folder)
        own = {} if counts is None else {"instructions": counts / case.ticks}
        rows.append({"what": label, "ns": tails(np.concatenate(spent[label])), "counts": own, **agree[label]})
    for label, part in (("Python: the native call alone", "native"), ("Python: controller.step(q)", "call")):
        if python[part]:
            rows.append({"what": label, "ns": tails(np.array(python[part])), "counts": {}})
    return {"title": case.problem.title, "ticks": case.ticks * turns * ROUNDS, "rows": rows}


def tails(values: Array) -> dict[str, float]:
    """Median and so on [ns]."""
    return {part: 1e3 * value for part, value in statistics(list(values)).items()}


def instructions(path: str, folder: Path) -> float | None:
    """Instructions of a pass by ``valgrind --tool=cachegrind``; None where it is missing or cannot run the program."""
    if shutil.which("valgrind") is None:
        return None
    counts = []
    for rounds in (1, 1 + COUNTED):
        tool = ["valgrind", "--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null"]
        command = [*tool, "./cycles", path, str(rounds)]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        counted = re.search(r"I\s+refs:\s+([\d,]+)", done.stderr)
        if done.returncode or not counted:
            return None
        counts.append(float(counted[1].replace(",", "")))
    return (counts[1] - counts[0]) / COUNTED


def build(source: Path, folder: Path, options: tuple[str, ...]) -> Path:
    """Build an export in a folder of its own, with the program that times it."""
    shutil.copytree(source, folder)
    shutil.copy(PROGRAM, folder)
    commands = (
        ["make", "-j2", "libwbc_tick.a", *options],
        ["gcc", "-std=c99", "-O2", "-Wall", "cycles.c", "libwbc_tick.a", "daqp/libdaqp.a", "-lm", "-o", "cycles"],
    )
    for command in commands:
        subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    return folder


def timed(folder: Path, path: Path) -> tuple[Array, dict[str, float]]:
    """Time of every tick [ns], and how far commands are from Python's."""
    times, (core, _) = folder / "times.bin", cores()
    pinned = [] if core is None else ["taskset", "-c", str(core)]
    command = [*pinned, "./cycles", str(path), str(ROUNDS), str(times)]
    done = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    bad, largest, reading = (float(word) for word in done.stdout.split())
    return np.fromfile(times), {"not solved": bad, "difference": largest, "read ns": reading}


def sheet(measured: dict[str, Any]) -> Sheet:
    """One problem."""
    columns = ("one tick", "ns", "p99", "p99.9", "max", "instructions", "largest difference [rad/s]")
    rows = []
    for row in measured["rows"]:
        times = [f"{row['ns'][part]:.0f}" for part in ("median", "p99", "p99.9", "max")]
        counted = f"{row['counts']['instructions']:.0f}" if "instructions" in row["counts"] else "-"
        rows.append((row["what"], *times, counted, f"{row['difference']:.0e}" if "difference" in row else "-"))
    return Sheet(f"The tick as C. {measured['title']} ({measured['ticks']} ticks each)", columns, rows)


def note(measured: dict[str, dict[str, Any]]) -> str:
    """What the reader must know."""
    return NOTE.format(reading=next(iter(measured.values()))["rows"][0]["read ns"])
