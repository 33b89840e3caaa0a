"""Trials of walks from seeds: among random structures, by random rates, by tasks of one hand, resumed at random
instants, as holds vanish, under torques; the last five on built-in structures between random places.

``python -m tests.walking.trials.trials PART NAME FOLDER`` carries out one and prints its record.
"""

from __future__ import annotations

import json
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tests.walking.trials.second_checker import second_check
from tests.walking.trials.structures import FAMILIES, PITCH, random_structure
from tests.walking.trials.torque_trials import NECK, Record, torque, violations, walker_of
from wbc.errors import RangeError, WbcError
from wbc.interrupts import obey_interrupts
from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking import PlaneSurface, Structure, save_structure
from wbc.walking.checker import check_walk
from wbc.walking.loop.walk import Tick
from wbc.walking.planner.around import NONE_MET, around
from wbc.walking.planner.objective import Objective
from wbc.walking.planner.plan import HoldLost, NoPlanError
from wbc.walking.report.folder import rules_of, save_run
from wbc.walking.run.recording import WalkRecorder
from wbc.walking.run.request import ArmRequest, DriveRequest, PathRequest, Site, arm_task
from wbc.walking.run.resume_mode import ResumeRequest
from wbc.walking.run.session import WalkRun, mode_of, perform_walk

#: What is walked on where a part has no structure of its own; on the grid of the cylinder between which T and A
GROUNDS = ("cylinder", "plane", "truss", "module")
ROUND, ALONG = (4.0, 21.0), (6.0, 19.0)
#: How far beginning and end are apart, and from the ends of the structure [m]; the part of holds that may be missing
APART, MARGIN, MISSING = (0.9, 2.2), 0.8, 0.4
#: Arms of the walkers on random structures, seed by seed in turn
ARMS = (3, 3, 3, 4, 3, 3, 6, 3, 5, 3)
#: Arms of those of other parts, drawn with equal chances, and the parts in which they are
LIMBS, DRAWN = (2, 3, 4, 5, 6), ("velocity", "arm", "resume", "vanish")
#: Tasks of a hand: how many at most, how far from the base of the arm its holds are [m], largest rates [m/s, rad/s] and
#: how long each [s]; and how fast it leaves its hold first [m/s]
TASKS, REACH, HAND_RATES, SECONDS = 3, 1.7, np.array([0.1, 0.1, 0.1, 0.2, 0.2, 0.2]), (0.3, 2.0)
OFF = (0.05, 0.1)
#: Commanded rates of velocity trials: largest [m/s, m/s, rad/s], how many and how long each [s]
RATES, LEGS, LEG = np.array([0.12, 0.12, 0.1]), 4, 3.0


def structures(name: str, walker: Walker, folder: Path) -> Record:
    """A walk on ``FAMILY SEED``."""
    family, seed = name.split()
    return kept(perform_walk(among(family, int(seed), walker, folder), walker), folder)


def among(family: str, seed: int, walker: Walker, folder: Path) -> PathRequest:
    """What is asked for on a random structure, of which a file is left in the folder."""
    trial = random_structure(family, seed, walker.arm_data.shoulder_radius + NECK)
    file = trial.save(folder)
    rng = np.random.default_rng(seed)
    speed = float(rng.uniform(0.05, 0.15))
    objective: Objective = "velocity" if rng.random() < 0.5 else "destination"
    return PathRequest(Site(str(file)), trial.start, (trial.goal,), speed, 0.1, objective)


class RandomRates:
    """Rates that change every :data:`LEG` seconds, then none."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._legs = rng.uniform(-1.0, 1.0, (LEGS, 3)) * RATES

    def rates(self, t: float) -> Array | None:
        """At a time [s]."""
        leg = int(t / LEG)
        return self._legs[leg] if leg < LEGS else None


def velocity(name: str, walker: Walker, folder: Path) -> Record:
    """A body that is driven; ``SEED``."""
    rng = np.random.default_rng([1, int(name)])
    asked = _path(rng, walker)
    request = DriveRequest(asked.site, asked.start, asked.points, asked.speed, asked.turn_rate, "seed")
    return kept(perform_walk(request, walker, commands=RandomRates(rng)), folder)


def arm(name: str, walker: Walker, folder: Path) -> Record:
    """One hand of a body that stands goes to holds and by rates; ``SEED``."""
    rng = np.random.default_rng([6, int(name)])
    asked = _path(rng, walker)
    standing = DriveRequest(asked.site, asked.start, asked.points)
    chosen = walker.arms[int(rng.integers(len(walker.arms)))]
    holds, body = standing.site.build(), standing.beginning(walker.arm_data)
    base = body.act(chosen.base.translation)
    near = [name for name, at in zip(holds.ids, holds.positions, strict=True) if np.linalg.norm(at - base) < REACH]
    # First off the hold, towards the body
    off = np.concatenate([-body.rotation[:, 2] * rng.uniform(*OFF), np.zeros(3)])
    tasks = [_rate(off, rng.uniform(1.0, 2.0))]
    for _ in range(int(rng.integers(1, TASKS + 1))):
        if rng.random() < 0.5:
            tasks.append(f"hold {rng.choice(near)}")
        else:
            tasks.append(_rate(rng.uniform(-1.0, 1.0, 6) * HAND_RATES, rng.uniform(*SECONDS)))
    did = tuple(arm_task(text) for text in tasks)
    request = ArmRequest(asked.site, asked.start, asked.points, arm=chosen.name, tasks=did)
    return kept(perform_walk(request, walker), folder)


def resume(name: str, walker: Walker, folder: Path) -> Record:
    """A walk that goes on from a random instant of its log; ``SEED``."""
    rng = np.random.default_rng([2, int(name)])
    first = perform_walk(_path(rng, walker), walker)
    if first.log is None:
        return kept(first, folder)
    save_run(first, folder, check=False)
    at = float(rng.uniform(first.log.t[1], first.log.t[-1]))
    again = folder / "resumed"
    again.mkdir(exist_ok=True)
    return {"at": at, **kept(perform_walk(ResumeRequest(folder, at), walker), again)}


def vanish(name: str, walker: Walker, folder: Path) -> Record:
    """A walk on which holds vanish that are held, or that a hand is on its way to; ``SEED``."""
    rng = np.random.default_rng([3, int(name)])
    mode = mode_of(_path(rng, walker), walker)
    structure = mode.structure
    try:
        plan = mode.plan()
    except NoPlanError as error:
        return {"outcome": "refused", "reason": str(error)}
    if not plan.complete:
        return {"outcome": "refused", "reason": plan.reason}
    walk = mode.walk(plan, mode.compiled("auto"), None)
    recorder, when = WalkRecorder(walk), list(np.sort(rng.uniform(0.5, plan.path.duration, int(rng.integers(1, 4)))))

    def on_tick(tick: Tick) -> None:
        recorder.tick(tick)
        if when and walk.time >= when[0]:
            when.pop(0)
            # Not so many that the body would fall
            some = list(walk.held.values()) if len(walk.held) > walker.min_holds else []
            some += [walk.swinging.hold] if walk.swinging is not None else []
            walk.vanish([walk.structure.ids[int(rng.choice(some))]] if some else [])

    try:
        end, reason = walk.run(on_tick), ""
    except (NoPlanError, HoldLost) as error:
        end, reason = type(error).__name__, str(error)
    log = recorder.log()[0]
    log.save(folder)
    save_structure(structure, folder / "structure.csv")
    return {
        "outcome": end,
        "reason": reason,
        "walk_s": walk.time,
        **checked(log, walker, structure, folder),
    }


def kept(run: WalkRun, folder: Path) -> Record:
    """What is to be said of a run, which is left in the folder."""
    save_run(run, folder, check=False)
    out = {"outcome": run.outcome, "reason": run.reason}
    if run.log is None:
        return out
    return {**out, "walk_s": float(run.log.t[-1]), **checked(run.log, run.walker, run.structure, folder)}


def checked(log: Any, walker: Walker, structure: Structure, folder: Path) -> Record:
    """What both checkers find in a log."""
    robot = walker.urdf(folder / "robot.urdf")
    report = check_walk(log, robot, structure, rules_of(walker))
    return {
        "violations": violations(report),
        "second": second_check(folder / "run.npz", walker, robot, structure),
    }


PARTS: dict[str, Callable[[str, Walker, Path], Record]] = {
    "structures": structures,
    "velocity": velocity,
    "arm": arm,
    "resume": resume,
    "vanish": vanish,
    "torque": torque,
}


#: How many trials of a part there are for each random structure
SHARES = {"structures": 1.0, "velocity": 0.4, "arm": 0.2, "resume": 0.4, "vanish": 0.2, "torque": 0.2}


def names(part: str, count: int) -> list[str]:
    """Names of the trials of a part, where there are ``count`` structures, family by family in turn."""
    seeds = range(round(SHARES[part] * count))
    families = list(FAMILIES)
    return [f"{families[k % 7]} {k // 7}" if part == "structures" else str(k) for k in seeds]


def limbs(part: str, name: str) -> int:
    """How many arms the body of a trial has; under torques the trial draws its own."""
    if part == "structures":
        return ARMS[int(name.split()[1]) % len(ARMS)]
    if part not in DRAWN:
        return 3
    return LIMBS[int(np.random.default_rng([5, DRAWN.index(part), int(name)]).integers(len(LIMBS)))]


def tried(part: str, name: str, folder: Path) -> Record:
    """The record of one trial; an error of the package is its outcome."""
    folder.mkdir(parents=True, exist_ok=True)
    out = Record()
    try:
        arms = limbs(part, name)
        out |= {"arms": arms} if part != "torque" else {}
        out |= PARTS[part](name, walker_of(arms), folder)
    except WbcError as error:
        out |= {"outcome": "error", "reason": f"{type(error).__name__}: {error}"}
    except Exception as error:  # noqa: BLE001 (an error of a trial is what the benchmark looks for)
        where = traceback.extract_tb(error.__traceback__)[-1]
        out |= {
            "outcome": "crash",
            "reason": f"{type(error).__name__}: {error} ({Path(where.filename).name}:{where.lineno})",
        }
    return {"trial": name, **out}


def _rate(twist: Array, seconds: float) -> str:
    """The task of a hand that moves with a twist."""
    return f"rate {','.join(f'{rate:.4f}' for rate in twist)} for {seconds:.2f}"


def _path(rng: np.random.Generator, walker: Walker) -> PathRequest:
    """From somewhere to somewhere on a built-in structure, half of them with holds missing, with place for the body."""
    while True:
        ground = GROUNDS[int(rng.integers(len(GROUNDS)))]
        fraction, seed = float(rng.uniform(0.0, MISSING)) * (rng.random() < 0.5), int(rng.integers(1000))
        site = Site(ground, fraction=fraction, seed=seed)
        structure = site.build()
        start, goal = _grid_ends(rng) if ground == "cylinder" else _ends(rng, structure)
        request = PathRequest(site, start, (goal,), float(rng.uniform(0.05, 0.15)), 0.1)
        ends = request.path(walker.arm_data).poses[[0, -1]]
        if (around(walker, structure).bodies(ends) == NONE_MET).all():
            return request


def _grid_ends(rng: np.random.Generator) -> tuple[str, str]:
    """Two places of the cylinder's grid that are apart, turned about its normal by up to half a turn in all."""
    while True:
        places = rng.uniform((ROUND[0], ALONG[0], -90.0), (ROUND[1], ALONG[1], 90.0), (2, 3))
        off = np.linalg.norm((places[1] - places[0])[:2]) * PITCH
        if APART[0] < off < APART[1]:
            first, last = (",".join(f"{value:.2f}" for value in place) for place in places)
            return first, last


def _ends(rng: np.random.Generator, structure: Structure) -> tuple[str, str]:
    """Two holds that are apart, and from the ends of the structure."""
    points, plane = structure.positions, isinstance(structure.surface, PlaneSurface)
    low, high = points.min(axis=0), points.max(axis=0)
    axes = high - low > 2.0 * MARGIN if plane else np.arange(3) == int((high - low).argmax())
    inner = np.flatnonzero(((points >= low + MARGIN) & (points <= high - MARGIN))[:, axes].all(axis=1))
    gaps = np.linalg.norm(points[inner, None] - points[inner], axis=2)
    pairs = np.argwhere((gaps > APART[0]) & (gaps < APART[1]))
    first, last = inner[pairs[int(rng.integers(len(pairs)))]]
    return structure.ids[first], structure.ids[last]


if __name__ == "__main__":
    obey_interrupts()
    if len(sys.argv) != 4 or sys.argv[1] not in PARTS:
        raise RangeError("arguments", sys.argv[1:], f"expected PART NAME FOLDER, a part of {', '.join(PARTS)}")
    print(json.dumps(tried(sys.argv[1], sys.argv[2], Path(sys.argv[3]))))
