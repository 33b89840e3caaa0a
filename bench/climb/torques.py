"""Walks under torques in MuJoCo, whose plant is not what plan and loop count on: friction, masses and delay."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from bench.sheet import Sheet
from tests.climb.by_hand import TRIPODS, climber, gait
from wbc.climb import BodyPlace, ClimbOptions, ContactPlan, first_stance, plan_climb, scenes
from wbc.climb.checker import CheckRules, check
from wbc.climb.loop import ClimbLoop, ClimbRun, LimbState
from wbc.climb.loop.stack import contact_frame
from wbc.climb.plants import ClimbPlant, PlantErrors
from wbc.climb.scene import size_of
from wbc.errors import WbcError

#: Friction [1], largest error of masses [1], and delay, which the loop knows [s]
UNKNOWN = {"friction": 0.8, "mass": 0.05, "delay": 0.005}
#: The gait that no planner is asked for, on a level floor
LEVEL = "tripods"
#: What walks on what, and how much of its course [1]; of stones and holds a fifth is missing
WALKS = {
    ("hexapod", LEVEL): 1.0, ("hexapod", "stepping_stones"): 0.25, ("anymal_c", "stepping_stones"): 0.25,
    ("wall_climber", "wall"): 0.5, ("talos_hand", "rail"): 1.0,
}  # fmt: skip
#: Feet that press with less do not count [N]
PRESSES = 5.0
HEADS = (
    "walk",
    "of the course",
    "clean",
    "steps",
    "walk, s",
    "plan, s",
    "ticks / real time",
    "slip, mm",
    "of the cone",
    "else",
)


def planned(robot: str, scene: str, seed: int, part: float) -> ContactPlan:
    """Over a part of a course.

    Raises:
        NoStancesError, MoveError: there is no plan.
    """
    machine = climber(robot)
    if scene == LEVEL:
        return gait(TRIPODS * 3, machine=machine, swing=0.5, rest=0.15)
    course, options = scenes.draw(scene, size_of(machine), seed, density=0.8), ClimbOptions.by_torques()
    q, end = (scenes.placed(machine, frame) for frame in (course.start, course.goal))
    first, last = (machine.body_pose(posture).translation for posture in (q, end))
    start = first_stance(machine, course.scene, q, options.stances)
    return plan_climb(machine, course.scene, start, BodyPlace(first + part * (last - first)), options)


def carried_out(plan: ContactPlan, errors: PlantErrors) -> tuple[ClimbRun, float]:
    """The run, and the largest part of friction there is, and of the ratings of grips, by MuJoCo's own contacts [1]."""
    plant, limbs = ClimbPlant(plan.climber, plan.scene, errors), plan.climber.limbs
    loop, most, part = ClimbLoop(plan, plant, delay=errors.delay), 2.0 * plan.times[-1] + 10.0, 0.0
    frictions = errors.friction * np.array([getattr(limb.contact, "friction", 1.0) for limb in limbs])
    grips = {contact_frame(limb): limb.contact.cone() for limb in limbs if limb.contact.pulls}
    while not loop.ended and loop.time < most:
        loop.tick()
        for move in loop.coming:
            # What comes after a landing counts on it
            landing = loop.states[move.limb] in (LimbState.REACHING, LimbState.LATCHING)
            assert not landing or loop.path_time <= move.land + 1e-9
        normal, along = plant.contact_forces().T
        presses = normal > PRESSES
        part = max(part, float((along / np.maximum(frictions * normal, 1e-9))[presses].max(initial=0.0)))
        for frame, wrench in plant.wrenches.items():
            slopes, bounds = grips[frame]
            borne = bounds > 0.0
            part = max(part, float(((slopes @ wrench)[borne] / bounds[borne]).max()))
    return loop.result(), part


def walked(robot: str, scene: str, seed: int) -> dict[str, Any]:
    """A cell of the table: how it went, and times of the processor [s]."""
    cell: dict[str, Any] = {"robot": robot, "scene": scene, "seed": seed}
    begun = time.process_time()
    try:
        plan = planned(robot, scene, seed, WALKS[robot, scene])
    except WbcError as error:
        return {**cell, "result": "refused", "reason": f"{type(error).__name__}: {error}"}
    planning, begun = time.process_time() - begun, time.process_time()
    run, of_cone = carried_out(plan, PlantErrors(**UNKNOWN, seed=seed))
    looping = time.process_time() - begun
    report = check(run.log, plan.climber, run.scene, CheckRules.by_torques())
    why = [f"{run.outcome}: {run.reason}"] if run.outcome != "arrived" else [str(text) for text in report.violations]
    return {
        **cell, "result": "broken" if why else "walked", "reason": "; ".join(why), "of_cone": of_cone,
        "slip": max(finding.worst for finding in report.findings if finding.rule.endswith("slips")),
        "steps": len(plan.moves), "duration": float(run.log["t"][-1]), "planning": planning, "looping": looping,
    }  # fmt: skip


def sheet(cells: Sequence[dict[str, Any]]) -> Sheet:
    """A row for each robot on each scene: sums over its seeds, and the worst of those that are clean."""
    rows = []
    for robot, scene in dict.fromkeys((cell["robot"], cell["scene"]) for cell in cells):
        group = [cell for cell in cells if (cell["robot"], cell["scene"]) == (robot, scene)]
        clean = [cell for cell in group if cell["result"] == "walked"]
        steps, length, planning, looping = (
            sum(cell[key] for cell in clean) for key in ("steps", "duration", "planning", "looping")
        )
        numbers = ["-"] * 6
        if clean:
            worst = 1e3 * max(cell["slip"] for cell in clean), max(cell["of_cone"] for cell in clean)
            numbers = [f"{steps}", f"{length:.0f}", f"{planning:.0f}", f"{length / looping:.1f}"]
            numbers += [f"{worst[0]:.2f}", f"{worst[1]:.2f}"]
        others = Counter(
            # Without the time at which it was
            f"{cell['result']}: {cell['reason'].partition(', seen at')[0][:90]}"
            for cell in group
            if cell["result"] != "walked"
        )
        why = "; ".join(f"{count} {text}" for text, count in others.items()).replace("|", "/")
        said = f"{robot}, {scene}", f"{WALKS[robot, scene]:g}", f"{len(clean)} of {len(group)}"
        rows.append((*said, *numbers, why))
    return Sheet("Walks under torques", HEADS, rows)
