"""Times targets, call and whole cycle of every contender on the three problems."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from bench.harness import OURS, pythons, statistics
from bench.pool import contest, turns
from bench.problems import load
from bench.sheet import Sheet, us

NOTE = """\
The whole cycle is targets, call and, for wbc, the next configuration: `controller.step(q, **targets)`, its `v` and \
`q_next`. Obstacles of the UR5: a barrier for each pair in pink, the collision limit in mink, self-collision with \
links fixed in the world in placo, whose constraint has no rate."""
#: Rounds of a problem: the slower the peers, the fewer
ROUNDS = {"panda": 25, "ur5": 10, "talos": 25}
TAILS = ("median", "p99", "p99.9", "max")


def measure(problem: Path, peers_python: str | None, rounds: int | None, say: Callable[[str], None]) -> dict[str, Any]:
    """Durations [us] of all contenders on the problem in a folder, in alternating rounds."""
    case, rounds = load(problem), rounds or ROUNDS[problem.name]
    spent: dict[str, dict[str, list[float]]] = {}
    with contest(pythons(peers_python), problem) as workers:
        for worker in workers.values():
            worker.ask("time", ticks=case.ticks)
        for turn, name in turns(list(workers), rounds):
            say(f"{problem.name}: round {turn + 1} of {rounds}, {name}")
            for part, values in workers[name].ask("time", ticks=case.ticks).items():
                spent.setdefault(name, {}).setdefault(part, []).extend(values)
    durations = {name: {part: statistics(values) for part, values in own.items()} for name, own in spent.items()}
    return {"title": case.problem.title, "ticks": case.ticks * rounds, "durations": durations}


def sheet(problem: dict[str, Any]) -> Sheet:
    """One problem."""
    ours, rows = problem["durations"][OURS]["call"]["median"], []
    for name, spent in problem["durations"].items():
        ratio = f"{spent['call']['median'] / ours:.2f}"
        around = [us(spent[part]["median"]) for part in ("aim", "cycle")]
        rows.append((name, *(us(spent["call"][tail]) for tail in TAILS), ratio, *around))
        if "native" in spent:
            rows.append(("  native call alone", *(us(spent["native"][tail]) for tail in TAILS), "", "", ""))
    columns = ("one tick [us]", *TAILS, "x wbc", "set targets", "whole cycle")
    return Sheet(f"{problem['title']} ({problem['ticks']} ticks each)", columns, rows)
