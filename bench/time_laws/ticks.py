"""The online filter beside a raw ``Ruckig.update``, tick by tick in the same process."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import ruckig

from wbc.trajectory import online
from wbc.validation import Array

Record = dict[str, Any]

DOF, DT = 7, 0.004
#: Ticks of a record
BLOCK = 250
#: Ticks from one target to the next
COURSES = {"a target every tick": 1, "a target every 50 ticks": 50}


class _Raw:
    """ruckig as its own examples use it, with its state as arrays."""

    def __init__(self, velocity: Array, acceleration: Array, jerk: Array) -> None:
        self.ruckig: Any = ruckig.Ruckig(DOF, DT)
        self.asked: Any = ruckig.InputParameter(DOF)
        self.answer: Any = ruckig.OutputParameter(DOF)
        self.asked.max_velocity, self.asked.max_acceleration, self.asked.max_jerk = velocity, acceleration, jerk
        self.asked.target_position = np.zeros(DOF)

    def tick(self, target: Array | None) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration one tick later."""
        if target is not None:
            self.asked.target_position = target
        self.ruckig.update(self.asked, self.answer)
        answer = self.answer
        state = np.array(answer.new_position), np.array(answer.new_velocity), np.array(answer.new_acceleration)
        answer.pass_to_input(self.asked)
        return state


def blocks(rng: np.random.Generator, count: int) -> Iterator[Record]:
    """Durations of single ticks [us], raw and ours in alternating blocks on the same targets."""
    sizes = rng.uniform(0.5, 2.0, DOF), rng.uniform(2.0, 10.0, DOF), rng.uniform(20.0, 150.0, DOF)
    for course, every in COURSES.items():
        theirs = _Raw(*sizes)
        names = ("velocity", "acceleration", "jerk")
        ours = online(DOF, DT, **dict(zip(names, sizes, strict=True)), lower=-1.0, upper=1.0)
        goal = np.zeros(DOF)
        for _ in range(count):
            targets: list[Array | None] = []
            for k in range(BLOCK):
                if k % every == 0:
                    step = 0.05 if every == 1 else 1.0
                    goal = np.clip(goal + step * rng.normal(size=DOF), -0.95, 0.95)
                targets.append(goal if k % every == 0 else None)
            spent: dict[str, list[float]] = {"raw": [], "ours": []}
            for target in targets:
                begin = time.perf_counter_ns()
                theirs.tick(target)
                spent["raw"].append((time.perf_counter_ns() - begin) / 1e3)
            for target in targets:
                begin = time.perf_counter_ns()
                if target is not None:
                    ours.target(target)
                ours.step()
                spent["ours"].append((time.perf_counter_ns() - begin) / 1e3)
            yield {"course": course, **spent}
