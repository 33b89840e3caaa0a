"""Walks under torques: on two plants, in gravity, with faults; what the checker says, and what is borne."""

from __future__ import annotations

import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cache
from multiprocessing import get_context
from textwrap import shorten

import numpy as np

import wbc.robots
from bench.sheet import Sheet
from wbc.climb import BodyPlace, ClimbOptions, ContactPlan, plan_climb
from wbc.climb.along import AlongOptions, BodyTrack, plan_along
from wbc.climb.bearing import check_borne
from wbc.climb.checker import CheckRules, check
from wbc.climb.climber import Climber
from wbc.climb.faults import PlantFault
from wbc.climb.grids import INCH, cylinder_grid, grid_pose
from wbc.climb.loop import ClimbLoop
from wbc.climb.machines import walking_arms
from wbc.climb.plants import PlantErrors, climb_plant
from wbc.errors import RangeError, WbcError
from wbc.robots.walker_data import spaced_radius

#: Way of the body: column, rows, distance from the axis [m], speed [m/s]
COLUMN, ROWS, RADIUS, SPEED = 13.0, (9.0, 11.5, 14.0), 152 * INCH, 4 * INCH
Gravity = tuple[float, float, float]
#: Along -y, towards the holds [m/s^2]
MOST, MOON = (0.0, -1.0, 0.0), (0.0, -1.62, 0.0)
#: Directions of gravity that are tried, along the scene's axes
DIRECTIONS: dict[str, Gravity] = {
    "towards the holds, -y": (0, -1, 0), "across, x": (1, 0, 0), "along the cylinder, z": (0, 0, 1),
}  # fmt: skip
#: The largest that is tried, and halvings of the interval [m/s^2], [1]
LARGEST, HALVINGS = 8.0, 9
#: Letters of a reason that the table has room for
WHY = 90
#: Walks at once
WORKERS = 2
HEADS = ("walk", "end", "grip slip", "largest grip", "ticks / real time", "checker")


def parts() -> dict[str, Sheet | str]:
    """A row for each trial, and one for each direction of gravity."""
    return {"walks": walks(), "bearable": bearable()}


@dataclass(frozen=True)
class Trial:
    """A walk under torques: on which plant, in which gravity, with what wrong."""

    name: str
    plant: str = "pinocchio"
    gravity: Gravity = (0.0, 0.0, 0.0)
    faults: tuple[str, ...] = ()
    errors: PlantErrors = field(default_factory=PlantErrors)
    arms: int = 3
    swivels: bool = False


TRIALS = (
    Trial("Pinocchio, no gravity"),
    Trial("MuJoCo, no gravity", "mujoco"),
    Trial("Pinocchio, 1 m/s^2", gravity=MOST),
    Trial("Pinocchio, on the Moon, 1.62 m/s^2", gravity=MOON),
    Trial("MuJoCo, on the Moon", "mujoco", gravity=MOON),
    Trial("four arms on the Moon", gravity=MOON, arms=4),
    Trial("three arms, 2.5 m/s^2", gravity=(0.0, -2.5, 0.0)),
    Trial("four arms on holds that let hands tilt", arms=4, swivels=True),
    Trial("20 kg on the body that the loop does not know", errors=PlantErrors(payload=20.0)),
    Trial("friction that it does not know, 2 N m and 2 N m s", errors=PlantErrors(rubbing=2.0)),
    Trial("20 ms of delay, known", faults=("delay 0.02",)),
    Trial("a motor of a hand that holds goes limp", faults=("limp arm3_joint2 at 4",)),
    Trial("one of a hand in the air", faults=("limp arm2_joint2 at 3.2",)),
    Trial("a grip slips by 5 mm", faults=("slip arm2 0.005 at 2",)),
    Trial("a hold breaks off, three hold", faults=("break arm1 at 0.5",)),
    Trial("a hold breaks off, two hold", faults=("break arm1 at 3",)),
)  # fmt: skip


def walks() -> Sheet:
    """A row for each trial; each in a process that has none of the others' state."""
    # Forked processes would share locks of what is loaded here
    with ProcessPoolExecutor(WORKERS, get_context("spawn")) as pool:
        return Sheet("", HEADS, list(pool.map(tried, TRIALS)))


def tried(trial: Trial) -> tuple[str, ...]:
    """The row of a trial."""
    robot = machine(trial.arms, trial.swivels)
    try:
        plan = planned(robot, trial.gravity)
        plant = climb_plant(trial.plant, robot, plan.scene, trial.errors, list(map(PlantFault.read, trial.faults)))
        assert plant is not None
        goal = BodyPlace(robot.body_pose(plan.q[-1]).translation)
        loop = ClimbLoop(
            plan, plant, delay=plant.errors.delay,
            replan=lambda scene, at: plan_climb(robot, scene, at, goal, ClimbOptions.by_torques()),
        )  # fmt: skip
    except WbcError as error:
        return (trial.name, shorten(f"refused: {error}", WHY, placeholder=" ..."), *[""] * 4)
    begun = time.process_time()
    run = loop.run(3.0 * float(plan.times[-1]))
    spent, t = time.process_time() - begun, run.log["t"]
    print(f"{trial.name}: {run.outcome} {run.reason}", file=sys.stderr)
    report = check(run.log, robot, run.scene, CheckRules.by_torques())
    slip = next(finding.worst for finding in report.findings if finding.rule == "closed grip slips")
    wrenches = np.abs(run.log.array("wrench")).reshape(len(t), -1, 2, 3).max(axis=(0, 1, 3))
    end = f"{run.outcome} after {t[-1]:.1f} s" + (f": {run.reason}" if run.reason else "")
    return (
        trial.name,
        shorten(end, WHY, placeholder=" ..."),
        f"{1e3 * max(slip, 0.0):.2g} mm",
        f"{wrenches[0]:.0f} N, {wrenches[1]:.0f} N m",
        f"{t[-1] / spent:.1f}",
        ", ".join(finding.rule for finding in report.violations) or "clean",
    )


@cache
def machine(arms: int, swivels: bool = False) -> Climber:
    """The walker; more than three arms stand as far from each other as three do."""
    data = wbc.robots.walker().arm_data
    radius = spaced_radius(arms, data.shoulder_radius)
    robot = walking_arms(wbc.robots.walker(arms, data=replace(data, shoulder_radius=radius)), f"walker of {arms}")
    limbs = [replace(limb, contact=replace(limb.contact, rolls=False, swivels=True)) for limb in robot.limbs]
    return replace(robot, limbs=limbs) if swivels else robot


@cache
def planned(robot: Climber, gravity: Gravity) -> ContactPlan:
    """Along the way at its speed."""
    options, scene = ClimbOptions.by_torques(), replace(cylinder_grid(), gravity=np.array(gravity, dtype=float))
    way = BodyTrack([grid_pose(COLUMN, row, RADIUS) for row in ROWS], SPEED)
    return plan_along(robot, scene, way, None, AlongOptions(options.motion, options.stances.margin))


def bearable() -> Sheet:
    """The largest gravity in which all stances of the weightless plan are borne, and where the next one is not."""
    rows = []
    for arms in (3, 4):
        plan = planned(machine(arms), (0.0, 0.0, 0.0))
        for name, direction in DIRECTIONS.items():
            least, most, why = 0.0, LARGEST, ""
            for _ in range(HALVINGS):
                size = 0.5 * (least + most)
                scene = replace(plan.scene, gravity=size * np.array(direction, dtype=float))
                try:
                    check_borne(replace(plan, scene=scene))
                    least = size
                except RangeError as error:
                    most, why = size, str(error).partition("stand on ")[2].partition(" (got")[0]
            rows.append((f"{arms} arms, {name}", f"{least:.2f} m/s^2", shorten(why, WHY, placeholder=" ...")))
    return Sheet("", ("gravity", "borne at rest", "beyond it"), rows)
