"""Runs all contenders on all problems in alternating rounds, so that a drift of the machine hits all alike."""

from __future__ import annotations

import contextlib
import platform
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from bench import startup
from bench.pool import Worker, cores
from bench.problems import Case, load
from bench.reference import Referee

OURS = "wbc"
PEERS = ("pink + daqp", "pink + quadprog", "mink + daqp", "placo")
#: Rounds of a problem: the slower the peers, the fewer
ROUNDS = {"panda": 25, "ur5": 10, "talos": 25}
Say = Callable[[str], None]


@dataclass(frozen=True)
class Plan:
    """What to run.

    Attributes:
        python: interpreter with this package.
        peers_python: interpreter with the peers; None: measure this package alone.
        folder: where the problems are.
        rounds: rounds a problem, None: :data:`ROUNDS`.
        names: problems.
    """

    python: str
    peers_python: str | None
    folder: Path
    rounds: int | None = None
    names: Sequence[str] = ("panda", "ur5", "talos")

    def contenders(self) -> dict[str, str]:
        """Contender -> its interpreter."""
        peers = {} if self.peers_python is None else dict.fromkeys(PEERS, self.peers_python)
        return {OURS: self.python} | peers


@dataclass
class Samples:
    """Everything measured of one contender on one problem; durations [ns]."""

    durations: dict[str, list[float]] = field(default_factory=dict)
    facts: dict[str, float] = field(default_factory=dict)
    tracking: dict[str, float | None] = field(default_factory=dict)

    def add(self, answer: dict[str, list[float]]) -> None:
        """Append the samples of one round."""
        for name, values in answer.items():
            self.durations.setdefault(name, []).extend(values)


def measure(plan: Plan, name: str, say: Say) -> dict[str, Any]:
    """All contenders on one problem."""
    case = load(plan.folder / name)
    core, _ = cores()
    contenders = plan.contenders()
    samples = {contender: Samples() for contender in contenders}
    rounds = plan.rounds or ROUNDS[name]
    with contextlib.ExitStack() as stack:
        workers = []
        for contender, python in contenders.items():
            say(f"{name}: starting {contender}")
            workers.append(stack.enter_context(Worker(python, contender, plan.folder / name, core)))
            samples[contender].facts = workers[-1].ready["facts"]
        for worker in workers:
            worker.ask("time", ticks=case.ticks)
        for k in range(rounds):
            say(f"{name}: round {k + 1} of {rounds}")
            turn = k % len(workers)
            for worker in workers[turn:] + workers[:turn]:
                samples[worker.contender].add(worker.ask("time", ticks=case.ticks))
        for worker in workers:
            say(f"{name}: accuracy of {worker.contender}")
            own = samples[worker.contender]
            own.tracking = tracking(case, worker.ask("path")["states"])
            own.tracking["solver_error"] = worker.ask("accuracy")["error"]
    return {
        "title": case.problem.title,
        "ticks": case.ticks * rounds,
        "contenders": {contender: summary(own) for contender, own in samples.items()},
    }


def tracking(case: Case, states: Sequence[Sequence[float]]) -> dict[str, float | None]:
    """How well a path was followed, by Pinocchio: errors at its end, smallest clearance on the way."""
    referee = Referee(case)
    smallest = np.inf
    for state in states if case.problem.obstacles else []:
        referee.update(np.array(state))
        smallest = min(smallest, float(referee.clearances()[0].min()))
    position, rotation = referee.errors(np.array(states[-1]), case.ticks - 1)
    return {"position": position, "rotation": rotation, "clearance": smallest if np.isfinite(smallest) else None}


def summary(samples: Samples) -> dict[str, Any]:
    """Medians and tails [us]."""
    return {
        "durations": {name: statistics(values) for name, values in samples.durations.items()},
        "facts": samples.facts,
        "tracking": samples.tracking,
    }


def statistics(nanoseconds: Sequence[float]) -> dict[str, float]:
    """Median, 99 %, 99.9 % and largest [us]."""
    values = np.array(nanoseconds) / 1e3
    median, p99, p999 = np.percentile(values, [50.0, 99.0, 99.9])
    return {"median": float(median), "p99": float(p99), "p99.9": float(p999), "max": float(values.max())}


def measure_startup(plan: Plan, say: Say) -> dict[str, Any]:
    """Import, compile and memory."""
    out: dict[str, Any] = {"import": {}, "compile": {}, "memory": {}}
    core, _ = cores()
    for package, module in startup.IMPORTS.items():
        python = plan.python if package == OURS else plan.peers_python
        if python is not None:
            say(f"import {package}")
            out["import"][package] = startup.import_seconds(python, module)
    for name in plan.names:
        say(f"{name}: compile with an empty cache, then with a full one")
        out["compile"][name] = startup.compile_seconds(plan.python, OURS, plan.folder / name)
    if "panda" in plan.names:
        for contender, python in plan.contenders().items():
            say(f"panda: memory of {contender}")
            out["memory"][contender] = startup.peak_memory(python, contender, plan.folder / "panda", core, 400)
    return out


def machine() -> dict[str, str]:
    """Where the figures come from, without naming the machine."""
    model = next(
        (line.split(":")[1].strip() for line in Path("/proc/cpuinfo").read_text().splitlines() if "model name" in line),
        platform.machine(),
    )
    load_average = Path("/proc/loadavg").read_text().split()[0]
    return {
        "processor": model,
        "python": platform.python_version(),
        "cores": cores()[1],
        "load": f"{load_average} (1 minute average before the run)",
        "garbage collector": "on, as Python starts it",
        "threads": ", ".join(f"{k} {v}" for k, v in startup.settings().items()),
    }
