"""``python -m bench.plan``: this package's planner beside OMPL with Coal and RoboPlan, on one core.

    python -m bench.plan --peers-python .venv-plan/bin/python              # 300 problems: robots x scenes x seeds
    python -m bench.plan --robots panda --scenes shelf --seeds 5 --write bench/data/plan.json
    python -m bench.plan --join panda.txt ur5.txt --write bench/data/plan.json    # what earlier runs printed

The peers are ``pip install ompl roboplan coal`` in an environment of their own; without ``--peers-python`` they are
left out. Times are of processors: planning and shortening from one configuration to another, without what is prepared
once a scene; of these the search alone, and, of this package's, rounding corners, the law and its proof besides.
``--constrained`` plans what the peers cannot state: cups that stay level, a tray in two hands, a base, a linkage.
"""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import time
from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np

from bench.figures.store import stamp
from bench.harness import interpreter
from bench.plan import constrained, descriptions, judge, problems
from bench.plan.peers import patiently
from bench.plan.tables import CONTENDERS, page
from bench.pool import Worker, contest
from wbc.plan import NoPathError

#: Processor time that each planner has [s]
SECONDS = 10.0


def solved_here(planner: Any, problem: problems.Problem, seed: int) -> dict[str, Any]:
    """A path of this package's, and what its law takes besides."""
    q, paths = planner.coordinates.configuration, []

    def plan(number: int, seconds: float) -> tuple[list[list[float]] | None, float]:
        begin = time.process_time()
        try:
            paths.append(planner.plan(q(problem.start), q(problem.goal), seed=number, seconds=seconds))
        except NoPathError:
            return None, time.process_time() - begin
        return paths[0].points.tolist(), time.process_time() - begin - paths[0].shortening

    answer = patiently(plan, seed, SECONDS)
    if paths:
        begin = time.process_time()
        paths[0].law()
        answer["law"] = time.process_time() - begin
    return answer


def row(robot: str, scene: str, seed: int, peers: Mapping[str, Worker]) -> dict[str, Any]:
    """All planners on one problem."""
    problem, planner = problems.problem(robot, scene, seed)
    found = {"wbc": solved_here(planner, problem, seed)}
    native = planner.native(planner.coordinates.configuration(problem.start))
    problem.low, problem.high = (np.array(side) for side in (native.sample_low, native.sample_high))
    if peers:
        limits = problem.low.tolist(), problem.high.tolist()
        text, links, boxes = descriptions.urdf(planner.coordinates, limits, problem.boxes)
        kept = planner.stack["self"].item.kept_pairs(planner.stack.robot)
        pairs = {frozenset((a[0], b[0])) for (a, b), _ in kept}
        names = planner.coordinates.names
        given = {
            "urdf": text, "srdf": descriptions.srdf(pairs, links, boxes, names), "joints": names, "seed": seed,
            "low": limits[0], "high": limits[1], "start": problem.start.tolist(), "goal": problem.goal.tolist(),
            "seconds": SECONDS,
        }  # fmt: skip
        found |= {name: peer.ask("plan", **given) for name, peer in peers.items()}
    out: dict[str, Any] = {"robot": robot, "scene": scene, "seed": seed}
    for name, answer in found.items():
        path = answer["path"]
        out[name] = {
            **{key: answer[key] for key in ("seconds", "search", "law") if key in answer},
            "length": None if path is None else judge.length(path),
            "fault": "" if path is None else judge.fault(problem, planner, path),
        }
    return out


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", default=",".join(problems.ROBOTS))
    parser.add_argument("--scenes", default=",".join(problems.SCENES))
    parser.add_argument("--seeds", type=int, default=19)
    parser.add_argument("--first", type=int, default=0, help="seed of the first problem")
    parser.add_argument("--peers-python", type=interpreter)
    parser.add_argument("--core", type=int, default=0)
    parser.add_argument("--constrained", action="store_true")
    parser.add_argument("--join", nargs="+", type=pathlib.Path, default=())
    parser.add_argument("--write", type=pathlib.Path)
    options = parser.parse_args()
    os.sched_setaffinity(0, {options.core})
    begun, rows = stamp(), [json.loads(line) for file in options.join for line in file.open() if line.startswith("{")]

    def measured(row: dict[str, Any]) -> None:
        rows.append(row)
        print(json.dumps(row), flush=True)

    if options.constrained:
        for kind, seed in product(constrained.KINDS, range(options.seeds)):
            measured(constrained.row(kind, seed, SECONDS))
        print(constrained.table(rows))
    else:
        who = dict.fromkeys(CONTENDERS[1:] if options.peers_python else (), options.peers_python)
        chosen = options.robots.split(","), options.scenes.split(","), range(options.first, options.seeds)
        with contest(who, pathlib.Path(), "bench.plan.peers") as peers:
            for robot, scene, seed in () if rows else product(*chosen):
                measured(row(robot, scene, seed, peers))
        print(page({"rows": rows}))
    print(f"load {os.getloadavg()[0]:.2f}")
    if options.write:
        options.write.write_text(json.dumps({"stamp": begun, "rows": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()
