"""Every task and constraint of the registry is switched on and off, and masked row by row, in the middle of a motion.

Whatever is asked for, no number is NaN, no tick brakes and the actuators keep their limits; a violated margin that is
switched on recovers.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.closed_loop.machines import anywhere, near
from tests.evaluation import numbers, sample
from tests.items import ITEMS, SWITCHED
from tests.models import placement
from tests.repeats import covering
from tests.tasks.robots import FRAMES, robot
from wbc.api import Controller
from wbc.controller import Step, core_of
from wbc.robot import Robot
from wbc.tasks import Constraint, EndEffector, Item, JointLimits, Posture

DT = 0.01
ROBOTS = ("panda", "talos")

#: Violations that are switched on [m, rad], and how far from there the configurations are that have none
SHALLOW, DEEP, REACH = 0.01, 0.2, 0.6

TRIALS = 2


@dataclass(frozen=True, eq=False)
class Motion:
    """One stack with an item of every class, and the state of the robot that it moves."""

    machine: Robot
    controller: Controller

    def only(self, *names: str) -> None:
        for entry in self.controller.stack.entries:
            self.controller[entry.name].enabled = entry.name in ("actuators", *names)

    def draw(self, name: str, rng: np.random.Generator, *, moving: bool) -> dict[str, Any]:
        """Random run-time values, in order where one is not to exceed another; what moves stands still if asked to."""
        item = self.controller.stack[name].item
        declared = {d.name: d for d in item.inputs(self.machine)}
        values = {key: sample(self.machine, d, rng) for key, d in declared.items()}
        for d in declared.values():
            if d.rate is not None:
                values[d.rate] = np.multiply(values[d.rate], 0.1 if moving else 0.0)
            if d.below is not None:
                pair = np.array([values[d.name], values[d.below]])
                values[d.name], values[d.below] = pair.min(axis=0), pair.max(axis=0) + 0.1
        return values

    def begin(self, q: np.ndarray, goal: np.ndarray) -> None:
        """At rest at q, with the hand and every joint pulled to where they are at a goal."""
        self.controller.reset(q)
        tip = placement(self.machine, FRAMES[self.machine.name].tip, goal)
        self.controller["reach"].target, self.controller["rest"].target = tip.translation, goal

    def tick(self, q: np.ndarray) -> tuple[np.ndarray, Step]:
        """One step, which must be finite and within what the actuators can do, and the configuration after it."""
        limits, before = self.machine.limits, self.controller.last_command
        step = self.controller.step(q)
        assert step.status != "braked"
        assert np.isfinite(step.v).all()
        assert (np.abs(step.v) <= limits.velocity + 1e-9).all()
        assert (np.abs(step.v - before) <= limits.acceleration * DT + 1e-9).all()
        after = pin.integrate(self.machine.model, q, step.v * DT)
        at = self.machine.position_index
        held = np.flatnonzero(at >= 0)
        assert (after[at[held]] >= limits.position_lower[held] - 1e-9).all()
        assert (after[at[held]] <= limits.position_upper[held] + 1e-9).all()
        return after, step


def simplest(name: str, machine: Robot) -> Item:
    """The declaration of a class that has the fewest rows: random values leave it feasible most often."""
    return min((item for item, _ in ITEMS[name](machine)), key=lambda item: len(item.rows(machine)))


@cache
def motion(name: str) -> Motion:
    bare = replace(robot(name), couplings=(), locked_dofs=())
    speeds = np.where(np.isfinite(bare.limits.velocity), bare.limits.velocity, 1.0)
    machine = bare.with_limits(velocity=speeds, acceleration=10.0)
    stack = wbc.Stack(machine, DT)
    for key in SWITCHED:
        stack.add(simplest(key, machine), name=key)
    stack.add(EndEffector(FRAMES[name].tip, kind="position", gain=3.0), name="reach")
    stack.add(Posture(gain=3.0), name="rest", weight=1e-2)
    stack.add(JointLimits(), name="actuators")
    return Motion(machine, stack.compile())


def scene(where: str, name: str) -> tuple[Motion, np.random.Generator]:
    return motion(where), np.random.default_rng(zlib.crc32(f"{name} {where}".encode()))


@pytest.mark.parametrize(("name", "where"), covering(SWITCHED, ROBOTS))
def test_switched_while_moving(name: str, where: str) -> None:
    """Random values, which may ask for the impossible, come and go as a whole and row by row."""
    moving, rng = scene(where, name)
    handle, rows = moving.controller[name], len(core_of(moving.controller).layout.blocks[name].rows)
    statuses = []
    q = anywhere(moving.machine, rng)
    moving.begin(q, near(moving.machine, rng, q, 0.8))
    handle.set(**moving.draw(name, rng, moving=True))
    handle.mask = 1.0
    moving.only("reach", "rest")
    for k in range(28):
        if k in (6, 14, 20):
            handle.enabled = not handle.enabled
        if 8 <= k < 14:
            handle.mask = (rng.random(rows) < 0.5).astype(float)
        if k == 24:
            handle.set(**moving.draw(name, rng, moving=True))
        q, step = moving.tick(q)
        statuses.append(step.status)
    handle.mask = 1.0
    assert set(statuses[:6]) == {"solved"}


MARGINS = [
    name
    for name in SWITCHED
    if isinstance(item := simplest(name, robot("panda")), Constraint) and item.form == "margins"
]


@pytest.mark.parametrize(("name", "where"), covering(MARGINS, ROBOTS))
def test_violated_margin_recovers(name: str, where: str) -> None:
    """A margin that is violated, and is not a little way off, is switched on in the middle of a motion."""
    moving, rng = scene(where, name)
    own = numbers(moving.controller.stack[name].item, moving.machine)
    found = drawn = 0
    while found < TRIALS:
        drawn += 1
        assert drawn < 10000, found
        start = anywhere(moving.machine, rng, 0.7)
        fine, values = near(moving.machine, rng, start, REACH), moving.draw(name, rng, moving=False)
        worst = [float(own(q, values)["value"].min()) for q in (start, fine)]
        if not (-DEEP < worst[0] < -SHALLOW and worst[1] > SHALLOW):
            continue
        found += 1
        moving.controller[name].set(**values)
        moving.only("rest")
        moving.begin(start, near(moving.machine, rng, start, 0.1))
        q, depths = start, []
        for k in range(50):
            if k == 5:
                moving.controller[name].enabled = True
            q, step = moving.tick(q)
            depths.append(float(step.margins[name].min()))
        assert depths[-1] > 0.1 * depths[5], (found, depths)
