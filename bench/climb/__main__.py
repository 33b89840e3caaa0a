"""``python -m bench.climb``: which robot walks which scene, why not, and how fast.

    python -m bench.climb                                     # all robots on all scenes, a process each
    python -m bench.climb --robots hexapod,anymal_c --scenes stairs,rubble --seeds 3
    python -m bench.climb torques --seeds 20                  # in MuJoCo: see bench/climb/torques.py

A cell is one seed: ``walked`` (arrived, no rule of the checker is broken), ``broken`` (which rule), ``refused`` (the
planner's reason), ``stopped`` (the loop's), or ``slow`` (no answer within the time). Times are of processors.
"""

from __future__ import annotations

import argparse
import collections
import concurrent.futures
import contextlib
import functools
import io
import json
import math
import pathlib
import resource
import signal
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

from bench.figures.store import FOLDER, stamp, write
from bench.sheet import Sheet

#: Heads of the table
HEADS = ("walk", "walked", "steps", "climb s", "plan s", "plan / climb", "real time", "ticks / real time", "else")


def one(robot: str, scene: str, seed: int) -> dict[str, Any]:
    """One cell, in this process."""
    from wbc.climb.request import ClimberRequest, ClimbRequest, PathRequest, SceneRequest
    from wbc.climb.session import climb
    from wbc.errors import WbcError

    about = {"robot": robot, "scene": scene, "seed": seed}
    # A busy machine must not end what the processor's time does not
    way, place = PathRequest(planning_time=math.inf), SceneRequest(scene=scene, seed=seed)
    try:
        done = climb(ClimbRequest(mode=way, climber=ClimberRequest(robot=robot), scene=place))
    except WbcError as error:
        return {**about, "result": "refused", "reason": f"{type(error).__name__}: {error}"}
    run, report = done.run, done.report
    assert report is not None
    cell = {**about, **done.figures, "duration": float(run.log["t"][-1]), "steps": len(done.plan.moves)}
    if run.outcome != "arrived":
        return {**cell, "result": "stopped", "reason": f"{run.outcome}: {run.reason}"}
    if not report.clean:
        return {**cell, "result": "broken", "reason": "; ".join(map(str, report.violations))}
    return {**cell, "result": "walked", "reason": ""}


def in_process(what: str, seconds: float, about: dict[str, Any]) -> dict[str, Any]:
    """One cell, in a process of its own that may take so much of the processor [s]."""
    command, whole = [sys.executable, "-m", "bench.climb", what, "--one", json.dumps(about)], math.ceil(seconds)
    done = subprocess.run(
        command, capture_output=True, text=True, check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (whole, whole)),
    )  # fmt: skip
    if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return {**about, "result": "slow", "reason": f"no answer within {whole} s of the processor"}
    lines = done.stdout.strip().splitlines()
    if done.returncode or not lines:
        last = (done.stderr.strip().splitlines() or [""])[-1]
        return {**about, "result": "failed", "reason": last}
    cell: dict[str, Any] = json.loads(lines[-1])
    return cell


def sheet(cells: Sequence[dict[str, Any]]) -> Sheet:
    """A row for each robot on each scene."""
    rows = []
    for robot, scene in dict.fromkeys((cell["robot"], cell["scene"]) for cell in cells):
        group = [cell for cell in cells if (cell["robot"], cell["scene"]) == (robot, scene)]
        walked, numbers = [cell for cell in group if cell["result"] == "walked"], ["-"] * 6
        if walked:
            steps, length, planning, real, ticks = (
                sum(cell[key] for cell in walked) / len(walked)
                for key in ("steps", "duration", "planning", "real_time", "loop_real_time")
            )
            numbers = [f"{steps:.0f}", f"{length:.1f}", f"{planning:.2f}", f"{planning / length:.2f}", f"{real:.1f}"]
            numbers += [f"{ticks:.1f}"]
        others = collections.Counter(f"{c['result']}: {c['reason']}" for c in group if c["result"] != "walked")
        why = "; ".join(f"{count} {text}" if count > 1 else text for text, count in others.items())
        rows.append((f"{robot}, {scene}", f"{len(walked)} of {len(group)}", *numbers, why.replace("|", "/")[:300]))
    return Sheet("Walks", HEADS, rows)


def main(arguments: Sequence[str] | None = None) -> int:
    """Fill the table."""
    parser = argparse.ArgumentParser(prog="python -m bench.climb", description=__doc__.splitlines()[0])
    parser.add_argument("what", nargs="?", default="scenes", choices=("scenes", "torques"))
    parser.add_argument("--robots", default="", help="names with commas; all")
    parser.add_argument("--scenes", default="", help="names with commas; all")
    parser.add_argument("--seeds", type=int, default=1, help="seeds of each, from --first on")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument(
        "--seconds", type=float, default=300.0, help="of the processor for each, compiling included [s]"
    )
    parser.add_argument("--workers", type=int, default=1, help="processes at once")
    parser.add_argument("--out", type=pathlib.Path, help="file of all cells, JSON")
    parser.add_argument("--write", action="store_true", help=f"the table into {FOLDER.name}/climb_WHAT.json too")
    parser.add_argument("--one", type=json.loads, metavar="CELL", help="one, as a line of JSON")
    given = parser.parse_args(arguments)
    from bench.climb import torques
    from wbc.climb import machines, scenes

    by_torques, begun = given.what == "torques", stamp()
    if given.one:
        with contextlib.redirect_stdout(io.StringIO()):
            cell = torques.walked(**given.one) if by_torques else one(**given.one)
        print(json.dumps(cell))
        return 0
    pairs = list(torques.WALKS) if by_torques else [(a, b) for a in machines.names() for b in scenes.families()]
    robots, places = (names.split(",") if names else [] for names in (given.robots, given.scenes))
    work = [
        {"robot": robot, "scene": scene, "seed": seed}
        for seed in range(given.first, given.first + given.seeds)
        for robot, scene in pairs
        if (not robots or robot in robots) and (not places or scene in places)
    ]
    cells, shown = list[dict[str, Any]](), torques.sheet if by_torques else sheet
    with concurrent.futures.ThreadPoolExecutor(given.workers) as pool:
        for cell in pool.map(functools.partial(in_process, given.what, given.seconds), work):
            cells.append(cell)
            told = f"{cell['robot']:16} {cell['scene']:16} {cell['seed']:3} {cell['result']:8} {cell['reason'][:160]}"
            print(told, file=sys.stderr)
            if given.out is not None:
                given.out.write_text(json.dumps(cells, indent=1), encoding="utf-8")
            if given.write:
                write(FOLDER / f"climb_{given.what}.json", begun, {"walks": shown(cells)})
    print(shown(cells).markdown())
    print(f"\n{collections.Counter(cell['result'] for cell in cells)} of {len(cells)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
