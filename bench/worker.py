"""A process with one package on one problem: reads one JSON command a line, writes one JSON answer a line.

    {"do": "time", "ticks": 400}    ->  {"call": [ns, ...], "cycle": [ns, ...], ...}
    {"do": "export", "folder": "..."}  ->  {"done": true}             the tick as C and a path, see bench.code
    {"do": "open", "folder": "..."} ->  {"done": true}                  another problem instead
    {"do": "sample", "budget": 0.3} ->  {"call": [ns, ...], "states": [[...], ...]}
                                        as many ticks of one pass as take that long [s]

Every command starts from the first configuration. Run as ``python -m bench.worker CONTENDER FOLDER [CORE]``.
"""

from __future__ import annotations

import gc
import importlib
import sys
from pathlib import Path
from time import perf_counter, perf_counter_ns
from typing import Any

from bench.contender import Contender
from bench.problems import Case, load
from bench.worker_process import begin, serve

#: Contender -> module and the callable that builds it
CONTENDERS = {
    "wbc": ("bench.ours", "Ours"),
    "pink + daqp": ("bench.pinks", "with_daqp"),
    "mink + daqp": ("bench.minks", "Mink"),
    "mink + daqp, rows within 1 cm": ("bench.minks", "at_default_detection"),
    "placo": ("bench.placos", "Placo"),
}


def build(name: str, case: Case) -> Contender:
    """The contender of that name, on a problem."""
    module, attribute = CONTENDERS[name]
    contender: Contender = getattr(importlib.import_module(module), attribute)(case)
    return contender


def time_calls(contender: Contender, ticks: int) -> dict[str, Any]:
    """Durations of ``ticks`` ticks along the path [ns]."""
    contender.reset()
    out: dict[str, list[int]] = {name: [0] * ticks for name in ("aim", "call", "cycle")}
    for k in range(ticks):
        start = perf_counter_ns()
        contender.cycle(k)
        out["cycle"][k] = perf_counter_ns() - start
    contender.reset()
    for k in range(ticks):
        start = perf_counter_ns()
        contender.aim(k)
        aimed = perf_counter_ns()
        contender.call()
        out["call"][k] = perf_counter_ns() - aimed
        out["aim"][k] = aimed - start
        contender.settle()
    contender.reset()
    contender.aim(0)
    if contender.native() is not None:
        out["native"] = time_native(contender, ticks)
    return out


def time_native(contender: Contender, ticks: int) -> list[int]:
    """Durations of the native function alone along the same path [ns]."""
    contender.reset()
    out = []
    for k in range(ticks):
        contender.aim(k)
        out.append(contender.native() or 0)
        contender.settle()
    return out


def time_sample(contender: Contender, budget: float) -> dict[str, Any]:
    """Durations of the call along the path, for at most ``budget`` seconds but five ticks at least [ns]."""
    contender.reset()
    out: list[int] = []
    states = []
    end = perf_counter() + budget
    for k in range(contender.case.ticks):
        contender.aim(k)
        start = perf_counter_ns()
        contender.call()
        out.append(perf_counter_ns() - start)
        contender.settle()
        states.append(contender.state().tolist())
        if k >= 4 and perf_counter() > end:
            break
    return {"call": out, "states": states}


class Served:
    """The contender of a name on the problem that is open, and its answers to commands."""

    def __init__(self, name: str, folder: Path) -> None:
        self.name, self.contender = name, build(name, load(folder))

    def answer(self, command: dict[str, Any]) -> dict[str, Any]:
        """What a command is answered with."""
        if command["do"] == "open":
            self.contender = build(self.name, load(Path(command["folder"])))
            gc.collect()
            return {"done": True}
        if command["do"] == "time":
            return time_calls(self.contender, command["ticks"])
        if command["do"] == "sample":
            return time_sample(self.contender, command["budget"])
        return {"done": self.contender.export(Path(command["folder"]))}


def main() -> None:
    """Build, say so, then serve."""
    name, folder, *core = sys.argv[1:]
    begin(core)
    serve(Served(name, Path(folder)).answer, {"ready": name})


if __name__ == "__main__":
    main()
