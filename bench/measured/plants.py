"""Plants: what a step costs and keeps, how soft grips are in MuJoCo, and a walk on servos that lag."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np

import wbc
from bench.sheet import Sheet, us
from tests.simulation.lagging import LaggingPlant
from tests.simulation.machines import HANDS, held, off, velocity
from wbc.simulation import GripKind, GrippingMujocoPlant, PinocchioPlant
from wbc.simulation.dynamics import Integrator
from wbc.walking import cylinder
from wbc.walking.body_path import grid_path
from wbc.walking.checker import check_walk
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import Tick, Walk
from wbc.walking.planner.planner import plan_walk
from wbc.walking.run.recording import WalkRecorder

COLUMNS = ("lag, ms", "delay, ms", "noise, rad", "end", "slip of held hands", "body off", "external checker")
#: Lag [s], delay [ms] and noise [rad]
SERVOS = ((0.001, 0, 0.0), (0.01, 0, 0.0), (0.02, 5, 0.0), (0.02, 5, 1e-5), (0.02, 5, 1e-4), (0.03, 10, 0.0),
          (0.05, 10, 0.0))  # fmt: skip
#: Steps whose cost is measured at once, and how often; the quickest counts
STEPS, TURNS = 200, 30
#: Sizes of velocities [rad/s, m/s]: as fast as the walker's joints may go, and as it walks
FAST, WALKING = 0.8, 0.2


def parts() -> dict[str, Sheet | str]:
    """All tables of the page."""
    return {"steps": steps(), "soft": soft(), "servos": servos()}


def steps() -> Sheet:
    """For each number of grips and integrator: cost, and what 10 s of free swinging at 1 ms lose."""
    robot, rows = wbc.robots.with_masses(wbc.robots.walker()).robot, []
    for grips in range(4):
        for integrator in ("rk4", "midpoint"):
            plant = _plant(integrator)
            held(plant, grips)
            least = np.inf
            for _ in range(TURNS):
                begin = perf_counter()
                for _ in range(STEPS):
                    plant.advance(0.001)
                least = min(least, (perf_counter() - begin) / STEPS)
            lost = []
            for size in (FAST, WALKING):
                plant.reset(robot.neutral, 0.0, v=velocity(robot, size))
                held(plant, grips)
                momentum, energy, worst = plant.momentum, plant.energy, 0.0
                for _ in range(100):
                    plant.advance(0.1)
                    worst = max(worst, off(plant) if grips else 0.0)
                kept = np.linalg.norm(plant.momentum - momentum) / np.linalg.norm(momentum)
                lost.append((abs(plant.energy / energy - 1.0), kept, worst))
            cells = [f"{energy:.1e}" for energy, _, _ in lost]
            cells += ["" if grips else f"{kept:.1e}" for _, kept, _ in lost[:1]]
            cells += [f"{drift:.1e}" if grips else "" for _, _, drift in lost]
            rows.append((f"{grips}, {integrator}", us(1e6 * least), *cells))
    columns = ("grips, integrator", "step, us", "energy lost, fast", "walking", "momentum lost, fast",
               "drift of grips, fast, m", "walking, m")  # fmt: skip
    return Sheet("", columns, rows)


def _plant(integrator: Integrator) -> PinocchioPlant:
    return PinocchioPlant(wbc.robots.with_masses(wbc.robots.walker()).robot, integrator=integrator)


def soft() -> Sheet:
    """How far a gripped hand of the free walker gives way in MuJoCo when its body is pulled with 50 N."""
    robot, rows = wbc.robots.with_masses(wbc.robots.walker()).robot, []
    for constant in (0.002, 0.004, 0.02):
        plant = GrippingMujocoPlant(robot, HANDS, time_constant=constant)
        plant.reset(robot.neutral, 0.0)
        plant.grasp(HANDS[0], robot.pose(robot.neutral, HANDS[0]), GripKind.POSE)
        plant.data.xfrc_applied[1, 0] = 50.0
        worst = 0.0
        for _ in range(20):
            plant.advance(0.1)
            gap = robot.pose(plant.read().q, HANDS[0]).translation - plant.grips[HANDS[0]].pose.translation
            worst = max(worst, float(np.linalg.norm(gap)))
        rows.append((f"{1e3 * constant:g}", f"{1e3 * worst:.2g} mm"))
    return Sheet("", ("time constant, ms", "hand off its hold"), rows)


def servos() -> Sheet:
    """A row for each servo."""
    machine, structure = wbc.robots.walker(), cylinder(rigid=True)
    stack = WalkStack(machine, structure, collisions=False)
    plan, rows = plan_walk(machine, structure, grid_path([(13, 9), (13, 14)], 0.1016)), []
    for lag, delay, noise in SERVOS:
        walk = Walk(machine, structure, plan, stack=stack, plant=LaggingPlant(machine.robot, lag, delay, noise))
        recorder, worst = WalkRecorder(walk), [0.0, 0.0]

        def keep(tick: Tick, recorder: WalkRecorder = recorder, worst: list[float] = worst) -> None:
            recorder.tick(tick)
            worst[:] = max(worst[0], tick.slip), max(worst[1], tick.body_error)

        end = walk.run(keep)
        with TemporaryDirectory() as folder:
            report = check_walk(recorder.log()[0], machine.urdf(Path(folder) / "robot.urdf"), structure)
        kinds = ", ".join(finding.kind for finding in report.violations)
        slip, off = (f"{1e3 * length:.2g} mm" for length in worst)
        rows.append((f"{1e3 * lag:.0f}", str(delay), f"{noise:g}", f"{end} after {walk.time:.1f} s", slip, off,
                     kinds or "clean"))  # fmt: skip
    return Sheet("", COLUMNS, rows)
