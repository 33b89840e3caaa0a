"""Episodes: a random start, random wishes, some ticks in open loop, every step judged."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np
import pinocchio as pin

from tests.soak.judge import Judge, Outside
from tests.soak.levels import with_levels
from tests.soak.machines import configuration, machine
from tests.soak.stacks import DT, provoke, random_stack
from wbc.api import Controller
from wbc.controller import Step
from wbc.validation import Array

#: Ticks from one start on
LENGTH = 20

#: (controller, q, v of the last command, tick, rng) -> what reaches the controller: q, v measured or None, dt or None
Plant = Callable[[Controller, Array, Array, int, np.random.Generator], tuple[Array, Array | None, float | None]]


def plain(
    controller: Controller, q: Array, v: Array, tick: int, rng: np.random.Generator
) -> tuple[Array, Array | None, float | None]:
    """The commands are followed; dt varies now and then."""
    return q, None, DT * float(rng.uniform(0.25, 2.0)) if rng.random() < 0.2 else None


def label(step: Step) -> str:
    """How a step ended, with the link of the chain."""
    return f"{step.status} by {step.answered_by}" if step.answered_by else str(step.status)


def episode(controller: Controller, judge: Judge, rng: np.random.Generator, plant: Plant = plain) -> Counter[str]:
    """Counts of how steps ended, and of what was wrong (``wrong: ...``, ``raised: ...``)."""
    robot, counts = controller.stack.robot, Counter[str]()
    outside, watch = bool(rng.random() < 0.3), Outside(robot)
    q = configuration(robot, rng, outside)
    v = robot.limits.velocity * rng.uniform(-1.2, 1.2, robot.nv) * (rng.random() < 0.5)
    controller.reset(q, v)
    provoke(controller, rng)
    watch.begin(q)
    for tick in range(LENGTH):
        given, measured, dt = plant(controller, q, v, tick, rng)
        before = v if measured is None else measured
        try:
            step = controller.step(given, measured, dt)
        except Exception as error:  # noqa: BLE001 - a soak counts whatever escapes
            counts[f"raised: {type(error).__name__}"] += 1
            return counts
        seconds = DT if dt is None else dt
        counts[label(step)] += 1
        counts.update(f"gave way: {kind}" for kind in judge.gave_way(step))
        wrong = judge.step(step, before, seconds)
        v = step.v
        q = pin.integrate(robot.model, q, v * seconds)
        if plant is plain and not wrong:
            wrong = watch.look(q)
        if wrong:
            counts[f"wrong: {wrong}"] += 1
    return counts


def stack(seed: int, k: int, backend: str, ticks: int, levels: bool = False) -> list[tuple[str, Counter[str]]]:
    """A random stack, with random strict levels if asked for, with ``ticks`` ticks: its description and its counts."""
    rng = np.random.default_rng([seed, backend == "native", k, *([1] if levels else [])])
    chosen = random_stack(machine(rng), rng)
    if levels:
        chosen = with_levels(chosen, rng)
    controller = chosen.compile(backend=backend)
    judge, counts, done = Judge(controller), Counter[str](), 0
    while done < ticks:
        counts += episode(controller, judge, rng)
        done += LENGTH
    counts.update({"loose bound": judge.loose, "compared": judge.compared})
    items = " ".join(f"{e.name}:{e.level}" if levels else e.name for e in controller.stack.entries)
    return [(f"{backend} {seed}/{k}: {controller.stack.robot.nv} dof, {items}", counts)]
