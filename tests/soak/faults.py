"""Ticks under faults: a solver that may not search, a library that is lost, clocks that jump, states that lie."""

from __future__ import annotations

import contextlib
from collections import Counter
from pathlib import Path

import numpy as np

from tests.soak.episodes import Plant, episode
from tests.soak.judge import Judge
from tests.soak.machines import machine
from tests.soak.stacks import DT, random_stack
from wbc.api import Controller
from wbc.errors import RangeError
from wbc.qp.solvers import daqp
from wbc.validation import Array

Given = tuple[Array, Array | None, float | None]
#: Names of runs with their counts
Found = list[tuple[str, Counter[str]]]


class Stale:
    """The state is measured once and repeated, whatever the robot does."""

    def __call__(self, controller: Controller, q: Array, v: Array, tick: int, rng: np.random.Generator) -> Given:
        if tick % 8 == 0:
            self.q = q
        return self.q, None, None


class Frozen:
    """One joint does not move; with odd ticks its measured velocity says so."""

    def __call__(self, controller: Controller, q: Array, v: Array, tick: int, rng: np.random.Generator) -> Given:
        robot = controller.stack.robot
        if tick == 0:
            self.at = int(rng.choice(np.flatnonzero(robot.position_index >= 0)))
            self.value = q[robot.position_index[self.at]]
        lying = q.copy()
        lying[robot.position_index[self.at]] = self.value
        measured = v.copy()
        measured[self.at] = 0.0
        return lying, measured if tick % 2 else None, None


def jumping_clock(controller: Controller, q: Array, v: Array, tick: int, rng: np.random.Generator) -> Given:
    """Steps of no time, negative and long ones are refused and change nothing; others vary as far as they may."""
    for bad in (0.0, -DT, 100.0 * DT):
        with contextlib.suppress(RangeError):
            controller.step(q, dt=bad)
            raise AssertionError(f"dt = {bad} s was taken")
    return q, None, DT * float(rng.choice([0.25, 2.0]))


def one_iteration(seed: int, k: int, backend: str, solver: str = "daqp") -> Found:
    """DAQP may take one iteration: within a compiled tick, or where a tick that another solver answers calls it."""
    rng = np.random.default_rng([seed, 11, k])
    before = daqp.SETTINGS["iter_limit"]
    if solver != "daqp":
        daqp.SETTINGS["iter_limit"] = 1
    try:
        controller = random_stack(machine(rng), rng).compile(backend=backend, solver=solver)
        if solver == "daqp":
            controller.iteration_cap = 1
        return [(f"one iteration, {backend} {solver} {seed}/{k}", episode(controller, Judge(controller), rng))]
    finally:
        daqp.SETTINGS["iter_limit"] = before


def plants(seed: int, k: int, backend: str) -> Found:
    """What the state and the clock can do, on one stack."""
    rng = np.random.default_rng([seed, 12, k])
    controller = random_stack(machine(rng), rng).compile(backend=backend)
    judge = Judge(controller)
    kinds: dict[str, Plant] = {"stale state": Stale(), "frozen joint": Frozen(), "clock jumps": jumping_clock}
    return [(f"{name}, {backend} {seed}/{k}", episode(controller, judge, rng, kinds[name])) for name in kinds]


def delete(library: Path) -> None:
    """Remove the file."""
    library.unlink()


def corrupt(library: Path) -> None:
    """Truncate the file in place and fill it with noise."""
    with library.open("r+b") as file:
        file.truncate(0)
        file.write(np.random.default_rng(0).bytes(4096))
