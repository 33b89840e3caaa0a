"""Walks under torques: in two simulators, in three gravities, with faults on board; and what the checker says."""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pinocchio as pin
from scipy.optimize import linprog

import wbc
from bench.sheet import Sheet
from tests.simulation.machines import HANDS
from wbc.errors import WbcError
from wbc.robots import Walker
from wbc.simulation import Encoders, GripKind, GrippingMujocoPlant, Motors, PinocchioPlant
from wbc.walking import Structure, cylinder
from wbc.walking.body_path import grid_path
from wbc.walking.checker import check_walk
from wbc.walking.log.log import CLOSED, WalkLog
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import PATIENCE, SLACK, Tick, Walk
from wbc.walking.planner.planner import plan_walk
from wbc.walking.run.carrying_out import CarryingOut
from wbc.walking.run.recording import WalkRecorder
from wbc.walking.torque.faults import Fault, delay_of
from wbc.walking.torque.loop import TorqueLoop
from wbc.walking.torque.stack import TorqueStack
from wbc.walking.torque.tested import Tested

#: Along -y, towards the holds [m/s^2]
CERES, PLUTO, MOON = (0.0, -0.28, 0.0), (0.0, -0.62, 0.0), (0.0, -1.62, 0.0)
#: Walks at once
WORKERS = 4
#: A body that is farther from its command has fallen [m]
FALLEN = 0.3
#: Rows of a log from one stance that is looked at to the next
STRIDE = 20


def parts() -> dict[str, Sheet | str]:
    """A row for each trial."""
    walks, log = torques()
    return {"walks": walks, "bearable": bearable(log)}


@dataclass(frozen=True)
class Trial:
    """A walk under torques: which plant, in which gravity, with what wrong."""

    name: str
    plant: str = "pinocchio"
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    faults: tuple[str, ...] = ()
    motors: Motors = field(default_factory=Motors)
    encoders: Encoders | None = None
    payload: float = 0.0


TRIALS = (
    Trial("Pinocchio, no gravity"),
    Trial("a joint goes limp in the air", faults=("limp arm3_joint2 at 4",)),
    Trial("MuJoCo, no gravity", "mujoco"),
    Trial("Pinocchio, on Ceres, 0.28 m/s^2", gravity=CERES),
    Trial("Pinocchio, on Pluto, 0.62 m/s^2", gravity=PLUTO),
    Trial("Pinocchio, on the Moon, 1.62 m/s^2", gravity=MOON),
    Trial("20 kg on the body that the loop does not know", payload=20.0),
    Trial("friction that it does not know, 2 N m and 2 N m s", motors=Motors(coulomb=2.0, viscous=2.0)),
    Trial("encoders with noise, 1e-5 rad and 1e-3 rad/s", encoders=Encoders(position=1e-5, velocity=1e-3)),
    Trial("20 ms of delay, known", faults=("delay 0.02",)),
    Trial("the same, MuJoCo", "mujoco", faults=("delay 0.02",)),
    Trial("a grip slips by 1 mm", faults=("slip arm2 0.001 at 2",)),
    Trial("a grip slips by 5 mm", faults=("slip arm2 0.005 at 2",)),
    Trial("a hold breaks off, three hold", faults=("break arm1 at 0.5",)),
    Trial("a hold breaks off, two hold", faults=("break arm1 at 3",)),
)


def torques() -> tuple[Sheet, WalkLog]:
    """A row for each trial, and the log of the first; each in a process of its own."""
    # Forked processes would share locks of what is loaded here
    with ProcessPoolExecutor(WORKERS, get_context("spawn")) as pool:
        found = list(pool.map(tried, TRIALS))
    columns = ("walk", "end", "found wrong by the loop", "hold slip", "grip off its hold", "largest grip",
               "momentum given", "external checker")  # fmt: skip
    return Sheet("", columns, [row for row, _ in found]), found[0][1]


def tried(trial: Trial) -> tuple[tuple[str, ...], WalkLog]:
    """The row of a trial, and its log."""
    bare, structure = wbc.robots.walker(), cylinder(rigid=True)
    plan = plan_walk(bare, structure, grid_path([(13, 9), (13, 14)], 0.1016))
    heavy, faults = wbc.robots.with_masses(bare, trial.gravity), tuple(map(Fault.read, trial.faults))
    motors = replace(trial.motors, delay=delay_of(faults))
    payloads = {"body": pin.Inertia.FromSphere(trial.payload, 0.2)} if trial.payload else None
    plant: Tested
    if trial.plant == "mujoco":
        plant = GrippingMujocoPlant(heavy.robot, HANDS, motors=motors)
    else:
        plant = PinocchioPlant(
            heavy.robot, integrator="midpoint", motors=motors, encoders=trial.encoders, payloads=payloads
        )
    loop = TorqueLoop(
        TorqueStack(heavy, [GripKind.AXIS]), plant, delay=motors.delay, encoders=trial.encoders, faults=faults
    )
    walk = Walk(bare, structure, plan, stack=WalkStack(bare, structure, collisions=False), plant=loop)
    end, log, kinds, slip = _walked(walk, bare, structure)
    watch = loop.watch
    print(f"{trial.name}: {end}", file=sys.stderr)
    grip, given = f"{watch.force:.0f} N, {watch.moment:.0f} N m", f"{watch.given[0]:.0f} N s"
    noted = "; ".join(f"{text} at {when:.2f} s" for when, text in watch.noted) or "nothing"
    row = (trial.name, f"{end} after {walk.time:.1f} s", noted, slip, f"{1e3 * watch.drift:.2g} mm", grip, given, kinds)
    return row, log


class FallenError(WbcError):
    """The body is far from its command."""


def _walked(walk: Walk, machine: Walker, structure: Structure) -> tuple[str, WalkLog, str, str]:
    """How it ended, and what the checker says of its log."""
    recorder, slip = WalkRecorder(walk), 0.0
    longest = PATIENCE * walk.plan.path.duration + SLACK

    def tick() -> Tick:
        nonlocal slip
        tick = walk.tick()
        slip = max(slip, tick.slip)
        if tick.body_error > FALLEN:
            raise FallenError("body", tick.body_error, "fell")
        return tick

    doing = CarryingOut(walk, recorder, tick=tick)
    while not walk.done and walk.time < longest and doing.step():
        pass
    end: str = doing.outcome or ("arrived" if walk.done else "late")
    end = {"refused": "fell", "plant failed": "ended"}.get(end, end)
    log = recorder.log()[0]
    with TemporaryDirectory() as folder:
        report = check_walk(log, machine.urdf(Path(folder) / "robot.urdf"), structure)
    kinds = ", ".join(finding.kind for finding in report.violations)
    return end, log, kinds or "clean", f"{1e3 * slip:.2g} mm"


def bearable(log: WalkLog) -> str:
    """The largest gravity along y in which every posture of a walk can be held still: at each, the linear
    programme of wrenches within the rating, torques within their limits, and a base in balance.
    """
    robot, rating = wbc.robots.with_masses(wbc.robots.walker()).robot, wbc.robots.hold_rating()
    model, limits = robot.model.copy(), robot.limits.effort[6:]
    model.gravity.linear = np.array([0.0, -1.0, 0.0])
    data, box = model.createData(), [rating.force] * 3 + [rating.torque] * 2
    least = {2: (np.inf, 0.0), 3: (np.inf, 0.0)}
    for k in range(0, len(log.t), STRIDE):
        q = np.concatenate([log.pose_body_in_structure[k], log.q[k]])
        weight = pin.computeGeneralizedGravity(model, data, q)
        hands = [hand for hand, state in zip(HANDS, log.hand_state[k], strict=True) if state == CLOSED]
        rows = [pin.computeFrameJacobian(model, data, q, model.getFrameId(hand), pin.LOCAL)[:5] for hand in hands]
        push = np.vstack(rows).T
        torque = np.hstack([-push[6:], weight[6:, None]])
        found = linprog(
            np.append(np.zeros(push.shape[1]), -1.0),
            A_ub=np.vstack([torque, -torque]),
            b_ub=np.tile(limits, 2),
            A_eq=np.hstack([push[:6], -weight[:6, None]]),
            b_eq=np.zeros(6),
            bounds=[(-most, most) for most in box * len(hands)] + [(0.0, None)],
        )
        least[len(hands)] = min(least[len(hands)], (float(found.x[-1]), float(log.t[k])))
    (two, when), (three, _) = least[2], least[3]
    return (
        f"Standing still, motors and holds bear gravity of up to {two:.2f} m/s^2 in every posture of this walk "
        f"(two hands hold, at {when:.1f} s), and of {three:.1f} m/s^2 where three hands hold."
    )
