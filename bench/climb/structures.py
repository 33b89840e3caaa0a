"""Walkers on random structures of scarce holds, by the old room and by ``wbc.climb``: for ``bench.climb.parity``."""

from __future__ import annotations

import functools
import pathlib
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.climb import structures as scarce
from tests.walking.trials import structures as obstructed
from tests.walking.trials.torque_trials import walker_of
from tests.walking.trials.trials import ARMS, among
from wbc.climb import BodyPlace, ClimbLoop, ClimbOptions, MotionOptions, first_stance, plan_climb
from wbc.climb.checker import check
from wbc.climb.climber import Climber, ClimbLimb
from wbc.climb.contacts import GripHand
from wbc.climb.machines import FLIP
from wbc.climb.scene import of_structure
from wbc.climb.time_law import MotionSpeeds
from wbc.errors import WbcError
from wbc.multibody import pin
from wbc.walking import save_structure
from wbc.walking.planner.plan import NoPlanError
from wbc.walking.run.request import PathRequest, Site
from wbc.walking.run.session import mode_of, perform_walk

#: Speed of the body on structures of ``tests.climb.structures`` at most [m/s]
SPEED = 0.1


@dataclass(frozen=True, eq=False)
class StructureCase:
    """A walk: its name, what is asked for, and how many arms the walker has."""

    name: str
    request: PathRequest
    arms: int


def structure_cases(part: str, count: int, arms: int | None, folder: pathlib.Path) -> Iterator[StructureCase]:
    """So many of a part, family by family in turn.

    Args:
        part: ``structures``: those of the walker's trials, with three to six arms; ``families``: those of
            ``tests.climb.structures``, with three.
        arms: in place of these numbers. folder: gets files of the structures.
    """
    families = list(obstructed.FAMILIES if part == "structures" else scarce.FAMILIES)
    for k in range(count):
        family, seed = families[k % len(families)], k // len(families)
        many = arms or (ARMS[seed % len(ARMS)] if part == "structures" else 3)
        if part == "structures":
            request = among(family, seed, walker_of(many), folder)
        else:
            trial = scarce.drawn(family, seed)
            file = save_structure(trial.structure, folder / f"{family}-{seed}.csv")
            request = PathRequest(Site(str(file)), trial.start, (trial.goal,), SPEED, 0.1)
        yield StructureCase(f"{family} {seed}, {many} arms", request, many)


@functools.cache
def climber_with(arms: int) -> Climber:
    """The published walker's climber with another number of arms."""
    machine = walker_of(arms)
    limbs = [ClimbLimb(arm.hand, GripHand(rolls=True), FLIP, arm.name) for arm in machine.arms]
    return Climber(machine.robot, limbs, name=f"walker of {arms}")


def by_old_room(case: StructureCase) -> tuple[Any, ...]:
    """A row of the table; processor time of the plan alone."""
    walker = walker_of(case.arms)
    mode, begun = mode_of(case.request, walker), time.process_time()
    try:
        plan = mode.plan()
        refused = "" if plan.complete else plan.reason
    except NoPlanError as error:
        plan, refused = None, str(error)
    spent = time.process_time() - begun
    if refused or plan is None:
        return "-", "-", f"{spent:.2f}", "-", "-", f"refused: {refused[:100]}"
    run = perform_walk(case.request, walker)
    end = run.outcome if run.outcome == "arrived" else f"{run.outcome}: {run.reason[:100]}"
    return len(plan.regrasps), "-", f"{spent:.2f}", "-", "-", end


def by_climb(case: StructureCase) -> tuple[Any, ...]:
    """A row of the table: over stances to the place and turn of the body at which the request ends."""
    path, climber = case.request.path(walker_of(case.arms).arm_data), climber_with(case.arms)
    first, last = (pin.SE3(np.array(path.poses[k])) for k in (0, -1))
    scene, begun = of_structure(case.request.site.build()), time.process_time()
    speeds = MotionSpeeds(speed=case.request.speed, turn_rate=case.request.turn_rate)
    try:
        start = first_stance(climber, scene, climber.with_body(climber.rest, first))
        goal = BodyPlace(last.translation, last.rotation)
        plan = plan_climb(climber, scene, start, goal, ClimbOptions(motion=MotionOptions(speeds=speeds)))
    except WbcError as error:
        return "-", "-", f"{time.process_time() - begun:.2f}", "-", "-", f"refused: {str(error)[:100]}"
    spent, begun = time.process_time() - begun, time.process_time()
    run = ClimbLoop(plan).run(most=2.0 * float(plan.times[-1]) + 10.0)
    ticking, t = time.process_time() - begun, run.log["t"]
    report = check(run.log, climber, scene)
    found = "clean" if report.clean else "; ".join(map(str, report.violations))
    end = found if run.outcome == "arrived" else f"{run.outcome}: {run.reason}"
    return (len(plan.moves), "-", f"{spent:.2f}", f"{1e6 * ticking / len(t):.0f}", f"{t[-1] / (spent + ticking):.1f}",
            end)  # fmt: skip


def structure_rows(
    part: str, count: int, arms: int | None, only: list[str], by: list[str]
) -> Iterator[tuple[Any, ...]]:
    """Rows of the table of a part."""
    with tempfile.TemporaryDirectory() as folder:
        for case in structure_cases(part, count, arms, pathlib.Path(folder)):
            if only and case.name.split(",")[0] not in only:
                continue
            for one in by:
                yield case.name, one, *(by_old_room(case) if one == "old" else by_climb(case))
