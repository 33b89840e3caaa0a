"""Walks under torques: in two simulators, in gravity, with faults; what the checker says, and what is borne."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import shorten

import numpy as np
import pinocchio as pin
from scipy.optimize import linprog

import wbc
from bench.sheet import Sheet
from tests.walking.trials.torque_trials import witnessed
from wbc.robots import Walker
from wbc.robots.walker_data import spaced_radius
from wbc.simulation import Encoders, GripKind, Motors
from wbc.validation import Array
from wbc.walking.checker import Report, check_walk
from wbc.walking.report.folder import rules_of
from wbc.walking.run.path_mode import PathMode
from wbc.walking.run.request import PathRequest, Site
from wbc.walking.run.session import perform_walk
from wbc.walking.torque.bearing import SHARE, stances
from wbc.walking.torque.faults import Fault, delay_of

#: What is asked for in all of them
REQUEST = PathRequest(Site(rigid=True), "13,9", ("13,14",))
#: Along -y, towards the holds [m/s^2]
MOST, MOON = (0.0, -1.0, 0.0), (0.0, -1.62, 0.0)
#: Directions of gravity that are tried, along the structure's axes
DIRECTIONS = {"towards the holds, -y": (0, -1, 0), "across, x": (1, 0, 0), "along the cylinder, z": (0, 0, 1)}
#: Letters of a refusal that the table has room for
WHY = 60
#: Walks at once
WORKERS = 2


def parts() -> dict[str, Sheet | str]:
    """A row for each trial, and one for each direction of gravity."""
    return {"walks": walks(), "bearable": bearable()}


@dataclass(frozen=True)
class Trial:
    """A walk under torques: on which plant, in which gravity, with what wrong."""

    name: str
    plant: str = "pinocchio"
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    faults: tuple[str, ...] = ()
    motors: Motors = field(default_factory=Motors)
    encoders: Encoders | None = None
    payload: float = 0.0
    arms: int = 3
    rigid: bool = True


TRIALS = (
    Trial("Pinocchio, no gravity"),
    Trial("MuJoCo, no gravity", "mujoco"),
    Trial("Pinocchio, 1 m/s^2", gravity=MOST),
    Trial("Pinocchio, on the Moon, 1.62 m/s^2", gravity=MOON),
    Trial("the same with four arms", gravity=MOON, arms=4),
    Trial("four arms on holds that let hands tilt", arms=4, rigid=False),
    Trial("20 kg on the body that the loop does not know", payload=20.0),
    Trial("friction that it does not know, 2 N m and 2 N m s", motors=Motors(coulomb=2.0, viscous=2.0)),
    Trial("encoders with noise, 1e-5 rad and 1e-3 rad/s", encoders=Encoders(position=1e-5, velocity=1e-3)),
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
        found = list(pool.map(tried, TRIALS))
    return Sheet("", ("walk", "end", "hold slip", "largest grip", "external checker"), found)


def tried(trial: Trial) -> tuple[str, ...]:
    """The row of a trial."""
    bare, faults = machine(trial.arms), tuple(map(Fault.read, trial.faults))
    request = replace(REQUEST, site=Site(rigid=trial.rigid))
    motors = replace(trial.motors, delay=delay_of(faults))
    loop = witnessed(bare, request.site.build(), trial.plant, trial.gravity, trial.payload, motors, trial.encoders,
                     faults)  # fmt: skip
    run = perform_walk(request, bare, plant=loop)
    print(f"{trial.name}: {run.outcome} {run.reason}", file=sys.stderr)
    if run.log is None or run.ticks is None:
        return (trial.name, shorten(f"{run.outcome}: {run.reason}", WHY, placeholder=" ..."), *[""] * 3)
    with TemporaryDirectory() as folder:
        urdf, rules = bare.urdf(Path(folder) / "robot.urdf"), rules_of(bare)
        found = [check_walk(log, urdf, run.structure, rules) for log in (loop.truth(run.log), run.log)]
    watch = loop.watch
    return (
        trial.name,
        f"{run.outcome} after {run.log.t[-1]:.1f} s",
        f"{1e3 * run.ticks.slip.max():.2g} mm",
        f"{watch.force:.0f} N, {watch.moment:.0f} N m",
        verdict(*found),
    )


def verdict(was: Report, read: Report) -> str:
    """Of where the robot was, and of what was read where that is another one."""
    true, seen = (", ".join(finding.kind for finding in report.violations) or "clean" for report in (was, read))
    return true if true == seen else f"{true}; of what was read: {seen}"


@cache
def machine(arms: int) -> Walker:
    """The walker; more than three arms stand as far from each other as three do."""
    data = wbc.robots.walker().arm_data
    radius = spaced_radius(arms, data.shoulder_radius)
    return wbc.robots.walker(arms, data=replace(data, shoulder_radius=radius))


def bearable() -> Sheet:
    """The largest gravity in which all stances of the course's plan can be held still."""
    rows = []
    for arms in (3, 4):
        mode = PathMode(REQUEST, machine(arms))
        looked = list(stances(machine(arms), mode.plan(), mode.structure))
        for name, direction in DIRECTIONS.items():
            least, when, hands = min(most_gravity(arms, looked, np.array(direction, dtype=float)))
            rows.append((f"{arms} arms, {name}", f"{least:.2f} m/s^2", f"{when:.1f} s, on {hands}"))
    return Sheet("", ("gravity", "borne at rest", "least at"), rows)


def most_gravity(
    arms: int, looked: list[tuple[float, Array, dict[str, GripKind]]], direction: Array
) -> Iterator[tuple[float, float, str]]:
    """At each stance the largest gravity, by the linear programme of wrenches within the rating, torques within their
    limits, and a base in balance; each with the reserve that a walk is refused without.
    """
    robot, rating = wbc.robots.with_masses(machine(arms)).robot, wbc.robots.hold_rating()
    model, limits = robot.model.copy(), SHARE * robot.limits.effort[6:]
    model.gravity.linear = direction
    data, box = model.createData(), SHARE * np.array([rating.force] * 3 + [rating.torque] * 2)
    for time, q, held in looked:
        weight = pin.computeGeneralizedGravity(model, data, q)
        rows = [pin.computeFrameJacobian(model, data, q, model.getFrameId(hand), pin.LOCAL)[:5] for hand in held]
        push = np.vstack(rows).T
        torque = np.hstack([-push[6:], weight[6:, None]])
        found = linprog(
            np.append(np.zeros(push.shape[1]), -1.0),
            A_ub=np.vstack([torque, -torque]),
            b_ub=np.tile(limits, 2),
            A_eq=np.hstack([push[:6], -weight[:6, None]]),
            b_eq=np.zeros(6),
            bounds=[(-most, most) for most in np.tile(box, len(held))] + [(0.0, None)],
        )
        yield float(found.x[-1]), time, ", ".join(hand.removesuffix("_hand") for hand in held)
