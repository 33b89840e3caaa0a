"""Walks along the published courses, and what they cost."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np

from wbc.robots import Walker
from wbc.walking import Structure, cylinder
from wbc.walking.body_path import BodyPath, grid_path
from wbc.walking.plan import NoPlanError, Plan
from wbc.walking.planner import plan_walk
from wbc.walking.walk import Tick, Walk
from wbc.walking.walk_stack import WalkStack

Record = dict[str, Any]

INCH = 0.0254
#: E1a to E1d of the source with their reverses, and the other diagonal: from and to in (T, A)
COURSES: dict[str, tuple[tuple[float, float], tuple[float, float]]] = {
    "+A": ((13, 6), (13, 18)),
    "-A": ((13, 18), (13, 6)),
    "+T": ((6, 12), (19, 12)),
    "-T": ((19, 12), (6, 12)),
    "+T +A": ((6, 6), (14.37, 18)),
    "-T -A": ((14.37, 18), (6, 6)),
    "+T -A": ((6, 18), (14.37, 6)),
    "-T +A": ((14.37, 6), (6, 18)),
}
#: Speeds between which the highest is looked for, and how closely [in/s]
SLOWEST, FASTEST, CLOSE = 3.0, 12.0, 0.1
#: A walk keeps its speed if its mean is this part of the command after ramps of half a second
KEPT, RAMPS = 0.98, 0.5


@dataclass
class Machine:
    """What all walks share: the robot, and its compiled stack."""

    walker: Walker
    stack: WalkStack

    def walk(self, structure: Structure, path: BodyPath, **asked: Any) -> Record:
        """Plan and carry out; why not, if it cannot."""
        begin, cpu = time.perf_counter(), time.process_time()
        try:
            plan = plan_walk(self.walker, structure, path, **asked)
        except NoPlanError as error:
            return {"arrived": False, "reason": str(error), "plan_s": time.perf_counter() - begin}
        planned = time.process_time() - cpu
        return {"plan_s": time.perf_counter() - begin, **self.carry_out(structure, plan, planned)}

    def carry_out(self, structure: Structure, plan: Plan, planned: float) -> Record:
        """A planned walk."""
        walk, ticks = Walk(self.walker, structure, plan, stack=self.stack), list[Tick]()
        cpu = time.process_time()
        end = walk.run(ticks.append)
        spent = time.process_time() - cpu
        costs = np.array([tick.cost for tick in ticks])
        limit = self.walker.robot.limits.velocity[6:]
        return {
            "arrived": end == "arrived",
            "reason": "" if end == "arrived" else end,
            "regrasps": len(plan.regrasps),
            "delay_s": plan.delay,
            "path_s": plan.path.duration,
            "walk_s": walk.time,
            "kept": plan.path.duration / max(walk.time - RAMPS, 1e-9),
            "body_mm": 1e3 * max(tick.body_error for tick in ticks),
            "slip_mm": 1e3 * max(tick.slip for tick in ticks),
            "rate": float(max(np.abs(tick.v[6:] / limit).max() for tick in ticks)),
            "unsolved": sum(tick.status != "solved" for tick in ticks),
            "tick_us": 1e6 * float(np.median(costs)),
            "tick_p99_us": 1e6 * float(np.percentile(costs, 99)),
            "real_time": walk.time / (spent + planned),
        }


def machine(walker: Walker, collisions: bool) -> Machine:
    """The stack is compiled once."""
    return Machine(walker, WalkStack(walker, cylinder(rigid=True), collisions=collisions))


def courses(it: Machine, speeds: tuple[float, ...] = (3.0, 4.0, 6.0)) -> Iterator[Record]:
    """All courses at some speeds [in/s]."""
    structure = cylinder(rigid=True)
    for speed in speeds:
        for name, points in COURSES.items():
            yield {"course": name, "speed": speed, **it.walk(structure, grid_path(points, speed * INCH))}


def highest(it: Machine) -> Iterator[Record]:
    """For each course the highest speed that is kept, by bisection, and what stops a faster walk."""
    structure = cylinder(rigid=True)
    for name, points in COURSES.items():
        low, high, why, best = 0.0, FASTEST, "", {}
        asked = SLOWEST
        while high - low > CLOSE + 1e-9:
            found = it.walk(structure, grid_path(points, asked * INCH))
            if found["arrived"] and found["kept"] >= KEPT:
                low, best = asked, found
            else:
                high, why = asked, found["reason"] or f"{found.get('kept', 0.0):.3f} of the speed is kept"
            asked = round((low + high) / 2, 2) if low else high / 2
        yield {"course": name, "speed": low, "above": why, **best}


def spins(it: Machine, rates: tuple[float, ...] = (0.05, 0.15)) -> Iterator[Record]:
    """Three turns on the spot over (13, 12)."""
    structure = cylinder(rigid=True)
    for rate in rates:
        turns = [(13.0, 12.0, k * pi / 2) for k in range(13)]
        yield {"turn": rate, **it.walk(structure, grid_path(turns, 1.0, rate))}
