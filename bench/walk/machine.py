"""The walker of all parts: what it plans and carries out, measured and judged by the external checker."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking import Structure, cylinder
from wbc.walking.body_path import BodyPath
from wbc.walking.checker import check_walk
from wbc.walking.log.log import WalkLog
from wbc.walking.log.ticks import TickColumns
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import Tick, Walk
from wbc.walking.planner.plan import HoldLost, NoPlanError, Plan
from wbc.walking.planner.planner import plan_walk
from wbc.walking.report.figures import RAMP, body_speed
from wbc.walking.run.mode import compiled_stack, keep
from wbc.walking.run.recording import WalkRecorder

Record = dict[str, Any]

INCH = 0.0254
#: A walk keeps its speed if its mean is this part of the command
KEPT = 0.98


@dataclass(frozen=True)
class Job:
    """One thing to measure: ``name`` in its part, and what gives the record."""

    name: str
    run: Callable[[], Record]


class Machine:
    """What all parts share: the robot and its compiled stack, each made when first asked for.

    Attributes:
        loading: processor time of :meth:`load` [s]; None: nothing was loaded.
    """

    loading: float | None = None

    def __init__(self, walker: Walker, stack: WalkStack | None = None, collisions: bool = False) -> None:
        self.walker, self.collisions = walker, collisions
        if stack is not None:
            self.stack = stack

    @cached_property
    def structure(self) -> Structure:
        """The published cylinder, rigid."""
        return cylinder(rigid=True)

    @cached_property
    def stack(self) -> WalkStack:
        """Compiled for the cylinder."""
        return compiled_stack(self.walker, self.structure, collisions=self.collisions)

    def load(self) -> None:
        """What belongs to the robot and the cylinder and not to a walk, once."""
        if self.loading is None:
            cpu = time.process_time()
            assert self.stack is not None
            keep()
            self.loading = time.process_time() - cpu

    def planned(self, structure: Structure, path: BodyPath, **asked: Any) -> tuple[Plan | None, Record]:
        """A plan, None where it is refused, and what is to be said of it."""
        self.load()
        cpu = time.process_time()
        try:
            plan = plan_walk(self.walker, structure, path, **asked)
        except NoPlanError as error:
            spent = time.process_time() - cpu
            return None, {
                "planned": False,
                "reason": str(error),
                "separating": list(error.separating),
                "plan_s": spent,
            }
        return plan, {
            "planned": True,
            "regrasps": len(plan.regrasps),
            "delay_s": plan.delay,
            "path_s": plan.path.duration,
            "detour": plan.path is not path,
            "plan_s": time.process_time() - cpu,
        }

    def walk(self, structure: Structure, path: BodyPath, **asked: Any) -> Record:
        """Plan and carry out; why not, if it cannot."""
        plan, record = self.planned(structure, path, **asked)
        return record if plan is None else record | self.carry_out(structure, plan, record["plan_s"])

    def carry_out(self, structure: Structure, plan: Plan, planned: float, seed: int = 0) -> Record:
        """A planned walk, and what the checker finds.

        Args:
            planned: processor time of the plan [s].
        """
        stack, cpu = self.stack, time.process_time()
        walk = Walk(self.walker, structure, plan, stack=stack)
        recorder, spends = WalkRecorder(walk, seed), list[float]()

        def on_tick(tick: Tick) -> None:
            recorder.tick(tick)
            spends.append(time.process_time())

        try:
            end, reason = walk.run(on_tick), ""
        except (NoPlanError, HoldLost) as error:
            end, reason = "refused", str(error)
        log, ticks = recorder.log()
        spent = time.process_time() - cpu
        if end == "late":
            reason = f"not there after {walk.time:.0f} s"
        limit = self.walker.robot.limits.velocity[6:]
        return {
            "end": end,
            "arrived": end == "arrived",
            "reason": reason,
            "walk_s": walk.time,
            **speeds(log, plan),
            **costs(ticks, np.diff(spends)),
            "rate": float((np.abs(log.v) / limit).max()),
            "real_time": walk.time / spent,
            "real_time_planned": walk.time / (spent + planned),
            "violations": self.violations(log, structure),
        }

    def violations(self, log: WalkLog, structure: Structure) -> list[str]:
        """What the external checker finds."""
        with TemporaryDirectory() as folder:
            report = check_walk(log, self.walker.urdf(Path(folder) / "robot.urdf"), structure)
        return [f"{f.kind}: {f.worst:.4g} at {f.time:.2f} s, {f.where}" for f in report.violations]


def speeds(log: WalkLog, plan: Plan) -> Record:
    """Means of the body's speed [m/s] and turn rate [rad/s] between the ramps, those of the path, and the way's [m/s]:
    from the first place straight to the last one in the time of all.
    """
    time_, speed, turning = body_speed(log)
    full = (time_ >= log.t[0] + RAMP) & (time_ <= log.t[-1] - RAMP)
    poses, duration = plan.path.poses, plan.path.duration
    way = float(np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).sum())
    cosine = (np.einsum("nij,nij->n", poses[1:, :3, :3], poses[:-1, :3, :3]) - 1.0) / 2.0
    turn = float(np.arccos(np.clip(cosine, -1.0, 1.0)).sum())
    mean, turned = (float(v[full].mean()) if full.any() else 0.0 for v in (speed, turning))
    straight = float(np.linalg.norm(poses[-1, :3, 3] - poses[0, :3, 3]))
    return {
        "speed": mean,
        "asked_speed": way / duration,
        "turn_rate": turned,
        "asked_turn_rate": turn / duration,
        "progress": straight / float(log.t[-1]),
    }


def costs(ticks: TickColumns, loop: Array) -> Record:
    """Errors, and times of the controller's ticks by the clock and of the whole loop [s of processor time]."""
    return {
        "body_mm": 1e3 * float(ticks.body_error.max()),
        "slip_mm": 1e3 * float(ticks.slip.max()),
        "unsolved": int((~ticks.solved).sum()),
        "tick_us": 1e6 * float(np.median(ticks.cost)),
        "tick_p99_us": 1e6 * float(np.percentile(ticks.cost, 99)),
        "loop_us": 1e6 * float(np.median(loop)),
        "loop_p99_us": 1e6 * float(np.percentile(loop, 99)),
    }
