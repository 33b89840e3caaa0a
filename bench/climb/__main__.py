"""``python -m bench.climb``: which robot walks which scene, why not, and how fast.

    python -m bench.climb                                     # all robots on all scenes, a process each
    python -m bench.climb --robots hexapod,anymal_c --scenes stairs,rubble --seeds 3
    python -m bench.climb --plant mujoco --robots hexapod --seeds 20       # torques: friction, masses, delay

A cell is one seed: ``walked`` (arrived, no rule of the checker is broken), ``broken`` (which rule), ``refused`` (the
planner's reason), ``stopped`` (the loop's), or ``slow`` (no answer within the time). Times are of processors.
"""

from __future__ import annotations

import argparse
import collections
import contextlib
import io
import json
import math
import pathlib
import resource
import signal
import subprocess
import sys
from collections.abc import Iterable, Sequence
from typing import Any

#: What the loop does not know under torques: friction, masses, delay [s]
UNKNOWN = {"slippery": 0.8, "mass_error": 0.05, "delay": 0.005}
#: Rule of the checker by which closed contacts stay [m]
SLIPS = "closed contact slips"
#: Heads of the table
HEADS = (
    "robot",
    "scene",
    "walked",
    "steps",
    "climb s",
    "plan s",
    "plan / climb",
    "real time",
    "ticks / real time",
    "slip mm",
    "else",
)


def one(robot: str, scene: str, seed: int, plant: str) -> dict[str, Any]:
    """One cell, in this process."""
    from wbc.climb.request import ClimberRequest, ClimbRequest, PathRequest, PlantRequest, SceneRequest
    from wbc.climb.session import climb
    from wbc.errors import WbcError

    about = {"robot": robot, "scene": scene, "seed": seed, "plant": plant}
    moved = PlantRequest(plant=plant, **(UNKNOWN if plant == "mujoco" else {}))  # type: ignore[arg-type]
    # A busy machine must not end what the processor's time does not
    way, place = PathRequest(planning_time=math.inf), SceneRequest(scene=scene, seed=seed)
    request = ClimbRequest(mode=way, climber=ClimberRequest(robot=robot), scene=place, plant=moved)
    try:
        done = climb(request)
    except WbcError as error:
        return {**about, "result": "refused", "reason": f"{type(error).__name__}: {error}"}
    run, report = done.run, done.report
    assert report is not None
    cell = {**about, **done.figures, "duration": float(run.log["t"][-1]), "steps": len(done.plan.moves)}
    cell["least"] = {finding.rule: finding.worst for finding in report.findings}
    if run.outcome != "arrived":
        return {**cell, "result": "stopped", "reason": f"{run.outcome}: {run.reason}"}
    if not report.clean:
        return {**cell, "result": "broken", "reason": "; ".join(map(str, report.violations))}
    return {**cell, "result": "walked", "reason": ""}


def in_process(robot: str, scene: str, seed: int, plant: str, seconds: float) -> dict[str, Any]:
    """One cell, in a process of its own that may take so much of the processor [s]."""
    command = [sys.executable, "-m", "bench.climb", "--one", robot, scene, str(seed), plant]
    whole = math.ceil(seconds)
    about = {"robot": robot, "scene": scene, "seed": seed, "plant": plant}
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


def table(cells: Iterable[dict[str, Any]]) -> str:
    """The cells as Markdown, a line for each robot on each scene."""
    groups: dict[tuple[str, str], list[dict[str, Any]]] = collections.defaultdict(list)
    for cell in cells:
        groups[cell["robot"], cell["scene"]].append(cell)
    rows = [HEADS, ("---",) * len(HEADS)]
    for (robot, scene), group in groups.items():
        walked = [cell for cell in group if cell["result"] == "walked"]
        numbers = [""] * 7
        if walked:
            count = len(walked)
            steps, length, planning, real, ticks = (
                sum(cell[key] for cell in walked) / count
                for key in ("steps", "duration", "planning", "real_time", "loop_real_time")
            )
            slip = max(cell["least"].get(SLIPS) or 0.0 for cell in walked)
            numbers = [f"{steps:.0f}", f"{length:.1f}", f"{planning:.2f}", f"{planning / length:.2f}", f"{real:.1f}"]
            numbers += [f"{ticks:.1f}", f"{1e3 * slip:.2f}"]
        others = collections.Counter(f"{c['result']}: {c['reason']}" for c in group if c["result"] != "walked")
        why = "; ".join(f"{count} {text}" if count > 1 else text for text, count in others.items())
        rows.append((robot, scene, f"{len(walked)} of {len(group)}", *numbers, why.replace("|", "/")[:300]))
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def main(arguments: Sequence[str] | None = None) -> int:
    """Fill the table."""
    parser = argparse.ArgumentParser(prog="python -m bench.climb", description=__doc__.splitlines()[0])
    parser.add_argument("--robots", default="", help="names with commas; all")
    parser.add_argument("--scenes", default="", help="names with commas; all")
    parser.add_argument("--seeds", type=int, default=1, help="seeds of each, from --first on")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--plant", default="kinematic", choices=("kinematic", "mujoco"))
    parser.add_argument(
        "--seconds", type=float, default=120.0, help="of the processor for each, compiling included [s]"
    )
    parser.add_argument("--out", type=pathlib.Path, help="file of all cells, JSON")
    parser.add_argument("--one", nargs=4, metavar=("ROBOT", "SCENE", "SEED", "PLANT"), help="one, as a line of JSON")
    given = parser.parse_args(arguments)
    if given.one:
        robot, scene, seed, plant = given.one
        with contextlib.redirect_stdout(io.StringIO()):
            cell = one(robot, scene, int(seed), plant)
        print(json.dumps(cell))
        return 0
    from wbc.climb import machines, scenes

    robots = given.robots.split(",") if given.robots else list(machines.names())
    places = given.scenes.split(",") if given.scenes else list(scenes.families())
    cells = []
    for robot in robots:
        for scene in places:
            for seed in range(given.first, given.first + given.seeds):
                cell = in_process(robot, scene, seed, given.plant, given.seconds)
                cells.append(cell)
                print(f"{robot:16} {scene:16} {seed:3} {cell['result']:8} {cell['reason'][:160]}", file=sys.stderr)
                if given.out is not None:
                    given.out.write_text(json.dumps(cells, indent=1), encoding="utf-8")
    print(table(cells))
    walked = sum(cell["result"] == "walked" for cell in cells)
    print(f"\n{walked} of {len(cells)} walked; {collections.Counter(cell['result'] for cell in cells)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
