"""Exports the controller of a problem, builds it, and times it in turns with the Python tick on the same path."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from bench.code.counting import per_pass
from bench.harness import OURS, Plan, statistics
from bench.pool import Worker, cores
from bench.problems import Array, load

#: Builds of the exported folder: what is told to make
BUILDS = {
    "exported C": (),
    "exported C, -march=native": ("TICK_FLAGS=-O3 -march=native", "ROWS_FLAGS=-O1 -fstrict-aliasing -march=native"),
}
PROGRAM = Path(__file__).with_name("cycles.c")
#: Turns, and pairs of passes in each; passes that counters see
TURNS, ROUNDS, COUNTED = 10, 5, 4


def measure(plan: Plan, name: str, say: Callable[[str], None]) -> dict[str, Any]:
    """Everything of one problem; times in nanoseconds, counts of one tick."""
    case, (core, _) = load(plan.folder / name), cores()
    work = (plan.folder / name / "code").absolute()
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    turns = plan.rounds or TURNS
    with Worker(plan.python, OURS, plan.folder / name, core) as worker:
        say(f"{name}: exporting")
        worker.ask("export", folder=str(work))
        folders = {}
        for label, options in BUILDS.items():
            say(f"{name}: building {label}")
            folders[label] = build(work / "export", work / label.replace(" ", "_"), options)
        cycles, spent = {label: [] for label in folders}, {label: [] for label in folders}
        python: dict[str, list[float]] = {"call": [], "native": []}
        agree = {}
        for turn in range(turns):
            say(f"{name}: the tick as C and in Python, turn {turn + 1} of {turns}")
            for label, folder in folders.items():
                some, agree[label] = timed(folder, work / "path.bin", core)
                cycles[label].append(some[:, 0])
                spent[label].append(some[:, 1])
            for _ in range(ROUNDS):
                answer = worker.ask("time", ticks=case.ticks)
                for part, kept in python.items():
                    kept += answer.get(part, [])
    rows = []
    for label, folder in folders.items():
        say(f"{name}: counting instructions of {label}")
        counter, counts = per_pass("./cycles", str(work / "path.bin"), folder, COUNTED)
        rows.append({
            "what": label, "ns": tails(np.concatenate(spent[label])), "cycles": tails(np.concatenate(cycles[label])),
            "counter": counter, "counts": {what: count / case.ticks for what, count in counts.items()}, **agree[label],
        })  # fmt: skip
    for label, part in (("Python: the native call alone", "native"), ("Python: controller.step(q)", "call")):
        if python[part]:
            own = {"what": label, "ns": tails(np.array(python[part]))}
            rows.append(own | {"cycles": None, "counter": "none", "counts": {}})
    return {"title": case.problem.title, "ticks": case.ticks * turns * ROUNDS, "rows": rows}


def tails(values: Array) -> dict[str, float] | None:
    """Median and so on; None where nothing was counted."""
    return {k: 1e3 * v for k, v in statistics(list(values)).items()} if values.any() else None


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


def timed(folder: Path, path: Path, core: int | None) -> tuple[Array, dict[str, float]]:
    """(counter, nanoseconds) of every tick [samples, 2], and how far commands are from Python's."""
    times = folder / "times.bin"

    def pin() -> None:
        if core is not None:
            os.sched_setaffinity(0, {core})

    command = ["./cycles", str(path), str(ROUNDS), str(times)]
    done = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True, preexec_fn=pin)
    bad, largest, cycles, nanoseconds = (float(word) for word in done.stdout.split())
    samples = np.fromfile(times).reshape(ROUNDS, 2, -1).transpose(0, 2, 1).reshape(-1, 2)
    return samples, {"not solved": bad, "difference": largest, "read cycles": cycles, "read ns": nanoseconds}
