"""What a step of a plant costs and keeps."""

from __future__ import annotations

from time import perf_counter

import numpy as np

import wbc
from bench.sheet import Sheet, us
from tests.simulation.machines import held, off, velocity
from wbc.simulation import PinocchioPlant
from wbc.simulation.dynamics import Integrator

#: Steps whose cost is measured at once, and how often; the quickest counts
STEPS, TURNS = 100, 30
#: Sizes of velocities [rad/s, m/s]: as fast as the walker's joints may go, and as it walks
FAST, WALKING = 0.8, 0.2


def parts() -> dict[str, Sheet | str]:
    """The table."""
    return {"steps": steps()}


def steps() -> Sheet:
    """For each number of grips and integrator: cost, and what 10 s of free swinging at 1 ms lose."""
    robot, rows = wbc.robots.with_masses(wbc.robots.walker()).robot, []
    for grips in (0, 3):
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
