"""Walks under torques: in two simulators, in three gravities, with faults on board; and what the checker says."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import pinocchio as pin

import wbc
from bench.sheet import Sheet
from tests.simulation.machines import HANDS
from wbc.errors import WbcError
from wbc.robots import Walker
from wbc.simulation import Encoders, GripKind, GrippingMujocoPlant, Motors, PinocchioPlant
from wbc.walking import Structure, cylinder
from wbc.walking.body_path import grid_path
from wbc.walking.checker import check_walk
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import Tick, Walk
from wbc.walking.planner.plan import HoldLost
from wbc.walking.planner.planner import plan_walk
from wbc.walking.run.recording import WalkRecorder
from wbc.walking.torque.faults import Fault, delay_of
from wbc.walking.torque.loop import TorqueLoop
from wbc.walking.torque.stack import TorqueStack
from wbc.walking.torque.tested import Tested

MOON, EARTH = (0.0, -1.62, 0.0), (0.0, -9.81, 0.0)


def parts() -> dict[str, Sheet | str]:
    """A row for each trial."""
    return {"walks": torques()}


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
    Trial("MuJoCo, no gravity", "mujoco"),
    Trial("Pinocchio, on the Moon", gravity=MOON),
    Trial("MuJoCo, on the Moon", "mujoco", MOON),
    Trial("Pinocchio, on Earth", gravity=EARTH),
    Trial("20 kg on the body that the loop does not know", payload=20.0),
    Trial("friction that it does not know, 2 N m and 2 N m s", motors=Motors(coulomb=2.0, viscous=2.0)),
    Trial("encoders with noise, 1e-6 rad and 1e-4 rad/s", encoders=Encoders(position=1e-6, velocity=1e-4)),
    Trial("encoders with noise, 1e-5 rad and 1e-3 rad/s", encoders=Encoders(position=1e-5, velocity=1e-3)),
    Trial("20 ms of delay, known", faults=("delay 0.02",)),
    Trial("the same, MuJoCo", "mujoco", faults=("delay 0.02",)),
    Trial("a grip slips by 1 mm", faults=("slip arm2 0.001 at 2",)),
    Trial("a grip slips by 5 mm", faults=("slip arm2 0.005 at 2",)),
    Trial("a hold breaks off, three hold", faults=("break arm1 at 0.5",)),
    Trial("a hold breaks off, two hold", faults=("break arm1 at 3",)),
    Trial("a joint goes limp in the air", faults=("limp arm3_joint2 at 4",)),
)


def torques() -> Sheet:
    """A row for each trial."""
    bare, structure = wbc.robots.walker(), cylinder(rigid=True)
    plan, walking = (
        plan_walk(bare, structure, grid_path([(13, 9), (13, 14)], 0.1016)),
        WalkStack(bare, structure, collisions=False),
    )
    rows, stacks = [], dict[tuple[float, float, float], TorqueStack]()
    for trial in TRIALS:
        heavy = wbc.robots.with_masses(bare, trial.gravity)
        stack = stacks.setdefault(trial.gravity, TorqueStack(heavy, [GripKind.AXIS]))
        faults = tuple(map(Fault.read, trial.faults))
        motors = replace(trial.motors, delay=delay_of(faults))
        payloads = {"body": pin.Inertia.FromSphere(trial.payload, 0.2)} if trial.payload else None
        plant: Tested
        if trial.plant == "mujoco":
            plant = GrippingMujocoPlant(heavy.robot, HANDS, motors=motors)
        else:
            plant = PinocchioPlant(heavy.robot, integrator="midpoint", motors=motors, encoders=trial.encoders,
                                   payloads=payloads)  # fmt: skip
        loop = TorqueLoop(stack, plant, delay=motors.delay, faults=faults)
        end, walk, kinds, slip = _walked(Walk(bare, structure, plan, stack=walking, plant=loop), bare, structure)
        watch = loop.watch
        rows.append((trial.name, f"{end} after {walk.time:.1f} s", slip, f"{1e3 * watch.drift:.2g} mm",
                     f"{watch.force:.0f} N, {watch.moment:.0f} N m", f"{watch.given[0]:.0f} N s", kinds))  # fmt: skip
    columns = ("walk", "end", "hold slip", "grip off its hold", "largest grip", "momentum given", "external checker")
    return Sheet("", columns, rows)


def _walked(walk: Walk, machine: Walker, structure: Structure) -> tuple[str, Walk, str, str]:
    """How it ended, and what the checker says of its log."""
    recorder, slip = WalkRecorder(walk), 0.0

    def keep(tick: Tick) -> None:
        nonlocal slip
        recorder.tick(tick)
        slip = max(slip, tick.slip)

    try:
        end = walk.run(keep)
    except HoldLost:
        end = "hold lost"
    except WbcError as error:
        end = type(error).__name__
    with TemporaryDirectory() as folder:
        report = check_walk(recorder.log()[0], machine.urdf(Path(folder) / "robot.urdf"), structure)
    kinds = ", ".join(finding.kind for finding in report.violations)
    return end, walk, kinds or "clean", f"{1e3 * slip:.2g} mm"
