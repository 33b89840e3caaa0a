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
import subprocess
import time
from typing import Any

import numpy as np

from bench.figures.store import stamp
from bench.plan import constrained, descriptions, judge, problems
from bench.plan.peers import patiently
from bench.plan.tables import CONTENDERS, ratios, table
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


class Peer:
    """A process that plans as another package does."""

    def __init__(self, python: str, name: str, core: int) -> None:
        command = [python, str(pathlib.Path(__file__).with_name("peers.py")), name, str(core)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def solve(self, problem: dict[str, Any]) -> dict[str, Any]:
        """A path, and the time that it took."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(problem) + "\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"a peer ended with {self._process.wait()}")
        return dict(json.loads(line))

    def close(self) -> None:
        """End it."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


def row(robot: str, scene: str, seed: int, peers: dict[str, Peer]) -> dict[str, Any]:
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
        found |= {name: peer.solve(given) for name, peer in peers.items()}
    referee = judge.CoalJudge(problem, planner)
    out: dict[str, Any] = {"robot": robot, "scene": scene, "seed": seed}
    for name, answer in found.items():
        path = answer["path"]
        out[name] = {
            **{key: answer[key] for key in ("seconds", "search", "law") if key in answer},
            "length": None if path is None else judge.length(path),
            "fault": "" if path is None else referee.fault(path),
        }
    return out


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", default=",".join(problems.ROBOTS))
    parser.add_argument("--scenes", default=",".join(problems.SCENES))
    parser.add_argument("--seeds", type=int, default=19)
    parser.add_argument("--first", type=int, default=0, help="seed of the first problem")
    parser.add_argument("--peers-python", default="")
    parser.add_argument("--core", type=int, default=0)
    parser.add_argument("--constrained", action="store_true")
    parser.add_argument("--join", nargs="+", type=pathlib.Path, default=())
    parser.add_argument("--write", type=pathlib.Path)
    options = parser.parse_args()
    os.sched_setaffinity(0, {options.core})
    if options.constrained:
        begun, rows = stamp(), []
        for kind in constrained.KINDS:
            for seed in range(options.seeds):
                rows.append(constrained.row(kind, seed, SECONDS))
                print(json.dumps(rows[-1]), flush=True)
        print(f"{constrained.table(rows)}\nload {os.getloadavg()[0]:.2f}")
        if options.write:
            options.write.write_text(json.dumps({"stamp": begun, "rows": rows}, indent=1) + "\n")
        return
    peers = {n: Peer(options.peers_python, n, options.core) for n in CONTENDERS[1:]} if options.peers_python else {}
    begun, rows = stamp(), [json.loads(line) for file in options.join for line in file.open() if line.startswith("{")]
    asked = [
        (r, s, n)
        for r in options.robots.split(",")
        for s in options.scenes.split(",")
        for n in range(options.first, options.seeds)
    ]
    try:
        for robot, scene, seed in () if rows else asked:
            rows.append(row(robot, scene, seed, peers))
            print(json.dumps(rows[-1]), flush=True)
    finally:
        for peer in peers.values():
            peer.close()
    compared = tuple(name for name in CONTENDERS[1:] if name in rows[0])
    print(table(rows, ("wbc", *compared)))
    if compared:
        print(ratios(rows, compared))
    print(f"load {os.getloadavg()[0]:.2f}")
    if options.write:
        options.write.write_text(json.dumps({"stamp": begun, "rows": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()
