"""A process with one package on one problem: reads one JSON command a line, writes one JSON answer a line.

    {"do": "time", "ticks": 400}    ->  {"call": [ns, ...], "cycle": [ns, ...], ...}
    {"do": "path"}                  ->  {"states": [[...], ...]}        one pass along the path
    {"do": "accuracy"}              ->  {"error": largest difference to the exact solution, or null}
    {"do": "memory"}                ->  {"peak": bytes}
    {"do": "export", "folder": "..."}  ->  {"done": true}             the tick as C and a path, see bench.code
    {"do": "open", "folder": "..."} ->  {"facts": {...}}                another problem instead
    {"do": "sample", "budget": 0.3} ->  {"call": [ns, ...], "states": [[...], ...]}
                                        as many ticks of one pass as take that long [s]

Every command starts from the first configuration. Run as ``python -m bench.worker CONTENDER FOLDER [CORE]``.
"""

from __future__ import annotations

import gc
import importlib
import json
import sys
from collections.abc import Callable
from math import inf
from pathlib import Path
from time import perf_counter, perf_counter_ns
from typing import Any

from bench.contender import Contender
from bench.problems import Case, load
from bench.worker_process import begin

#: Contender -> module and the callable that builds it
CONTENDERS = {
    "wbc": ("bench.ours", "Ours"),
    "pink + daqp": ("bench.pinks", "with_daqp"),
    "pink + quadprog": ("bench.pinks", "with_quadprog"),
    "mink + daqp": ("bench.minks", "Mink"),
    "mink + daqp, rows within 1 cm": ("bench.minks", "at_default_detection"),
    "placo": ("bench.placos", "Placo"),
}
#: Every how many ticks the answer is compared with an exact solution
ACCURACY_STRIDE = 10


def build(name: str, case: Case) -> Contender:
    """The contender of that name, on a problem."""
    module, attribute = CONTENDERS[name]
    contender: Contender = getattr(importlib.import_module(module), attribute)(case)
    return contender


def time_calls(contender: Contender, ticks: int) -> dict[str, Any]:
    """Durations of ``ticks`` ticks along the path [ns]."""
    contender.reset()
    out: dict[str, list[int]] = {name: [0] * ticks for name in ("aim", "call", "settle", "cycle")}
    aim, call, settle, cycle = out.values()
    for k in range(ticks):
        start = perf_counter_ns()
        contender.cycle(k)
        cycle[k] = perf_counter_ns() - start
    contender.reset()
    for k in range(ticks):
        t0 = perf_counter_ns()
        contender.aim(k)
        t1 = perf_counter_ns()
        contender.call()
        t2 = perf_counter_ns()
        contender.settle()
        t3 = perf_counter_ns()
        aim[k], call[k], settle[k] = t1 - t0, t2 - t1, t3 - t2
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


def walk(contender: Contender) -> dict[str, Any]:
    """The configuration after every tick of one pass."""
    return {"states": time_sample(contender, inf)["states"]}


def accuracy(contender: Contender, reference: Callable[[], float | None] | None = None) -> dict[str, Any]:
    """Largest difference to an exact solution of the same QP along the path; null if the QP is not shown.

    ``reference`` measures it at one tick; default: the contender's own.
    """
    contender.reset()
    measure = reference or contender.reference_error
    worst: float | None = None
    for k in range(contender.case.ticks):
        contender.aim(k)
        if k % ACCURACY_STRIDE == 0:
            error = measure()
            worst = error if worst is None or error is None else max(worst, error)
        contender.call()
        contender.settle()
    return {"error": worst}


def peak_memory() -> dict[str, Any]:
    """Peak resident memory of this process [bytes].

    From /proc: ``ru_maxrss`` would also count the parent's memory, which a child has until it executes.
    """
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return {"peak": int(line.split()[1]) * 1024}
    raise OSError("no VmHWM in /proc/self/status")


def opened(name: str, folder: Path) -> Contender:
    """The contender of that name on the problem in a folder; ``facts`` say how long that took."""
    start = perf_counter()
    contender = build(name, load(folder))
    contender.facts = {"build": perf_counter() - start} | contender.facts
    return contender


def answer(contender: Contender, command: dict[str, Any]) -> dict[str, Any]:
    """What a command about the open problem is answered with."""
    answers: dict[str, Callable[[], dict[str, Any]]] = {
        "time": lambda: time_calls(contender, command["ticks"]),
        "path": lambda: walk(contender),
        "accuracy": lambda: accuracy(contender),
        "memory": peak_memory,
        "export": lambda: {"done": contender.export(Path(command["folder"]))},
        "sample": lambda: time_sample(contender, command["budget"]),
    }
    return answers[command["do"]]()


def serve(name: str, contender: Contender) -> None:
    """Answer commands until standard input ends."""
    for line in sys.stdin:
        command = json.loads(line)
        if command["do"] == "open":
            contender = opened(name, Path(command["folder"]))
            gc.collect()
            print(json.dumps({"facts": contender.facts}), flush=True)
        else:
            print(json.dumps(answer(contender, command)), flush=True)


def main() -> None:
    """Build, say how long that took, then serve."""
    name, folder, *core = sys.argv[1:]
    begin(core)
    contender = opened(name, Path(folder))
    print(json.dumps({"ready": name, "facts": contender.facts}), flush=True)
    serve(name, contender)


if __name__ == "__main__":
    main()
