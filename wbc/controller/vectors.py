"""States with the commands that a controller gives, for others to reproduce."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import pinocchio as pin

from wbc.controller.handle import Handle
from wbc.controller.outcome import STATUSES, Status
from wbc.controller.step import Step
from wbc.controller.tick import Buffers
from wbc.robot import Robot
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Layout, Slot
from wbc.tasks.base import Task
from wbc.validation import Array

#: Ticks from one configuration on before the next is drawn
RUN = 20
#: Answers of other solvers than the native one count where their own bound on the error is below this [rad/s, m/s]
CERTAIN = 1e-10
#: States that are tried for each that is wanted
PATIENCE = 4


class Stepped(Protocol):
    """What is asked for commands: a controller."""

    @property
    def stack(self) -> Declaration: ...
    @property
    def layout(self) -> Layout: ...
    @property
    def tick(self) -> Buffers: ...
    @property
    def backend(self) -> str: ...
    @property
    def solver(self) -> str: ...

    def step(self, q: Array, v: Array) -> Step:
        """One control cycle."""

    def __getitem__(self, name: str) -> Handle: ...


def vectors(controller: Stepped, count: int, seed: int = 0) -> Array:
    """States row by row: q, v measured, the run-time inputs, flag, command.

    Short runs of the controller from random configurations within the joints' ranges, with targets near the hand and
    inputs near those that it has; it keeps the last ones. Where another solver than the native one answers, only states
    that it solved with certainty; there may be fewer than ``count``.
    """
    rng = np.random.default_rng(seed)
    model = controller.stack.robot.model
    rows: list[Array] = []
    start = controller.tick.p.copy()
    for k in range(PATIENCE * count):
        if len(rows) == count:
            break
        if k % RUN == 0:
            q, v = _configuration(controller.stack.robot, rng), 0.05 * rng.normal(size=controller.layout.nv)
            controller.tick.p[:] = start
            _vary(controller, q, rng)
        step = controller.step(q, v)
        first = not step.answered_by  # exported code has no chain
        if first and ((controller.backend == "native" and controller.solver == "daqp") or _certain(step)):
            rows.append(np.concatenate([q, v, controller.tick.p, [STATUSES.index(step.status)], step.v]))
        q, v = pin.integrate(model, q, step.v * controller.stack.dt), step.v.copy()
    width = controller.layout.nq + 2 * controller.layout.nv + controller.layout.parameters + 1
    return np.array(rows).reshape(len(rows), width)


def _certain(step: Step) -> bool:
    return step.status is Status.SOLVED and step.certificate.error_bound < CERTAIN


def _configuration(robot: Robot, rng: np.random.Generator) -> Array:
    """A configuration within the joints' ranges; a free base near its place."""
    q: Array = pin.integrate(robot.model, robot.neutral, 0.3 * rng.uniform(-1.0, 1.0, robot.nv))
    for i, k in enumerate(robot.position_index):
        low, high = robot.limits.position_lower[i], robot.limits.position_upper[i]
        if k >= 0 and np.isfinite(low) and np.isfinite(high):
            q[k] = rng.uniform(0.9 * low + 0.1 * high, 0.1 * low + 0.9 * high)
    return q


def _vary(controller: Stepped, q: Array, rng: np.random.Generator) -> None:
    """Inputs of another moment: what follows the configuration is where q has it, the rest near where it was."""
    for name, block in controller.layout.blocks.items():
        item = block.entry.item
        initial = item.initial(controller.stack.robot, q)
        for slot in block.slots.values():
            if slot.input.default is None and slot.input.name in initial:
                numbers = controller[name].checked(slot.input.name, initial[slot.input.name])
                controller.tick.p[slot.span] = numbers
                if not isinstance(item, Task):
                    continue
            _shake(slot, controller.tick.p[slot.span], rng)


def _shake(slot: Slot, numbers: Array, rng: np.random.Generator) -> None:
    """Other numbers near those, of inputs whose range is not limited."""
    given = slot.input
    if given.sensed:
        return
    if given.kind in ("pose", "rotation"):
        turned = pin.exp3(rng.normal(0.0, 0.2, 3)) @ numbers[:9].reshape(3, 3, order="F")
        numbers[:9] = turned.ravel(order="F")
        numbers[9:] += rng.normal(0.0, 0.1, len(numbers) - 9)
        return
    limited = given.low > -np.inf or given.high < np.inf or given.infinite is not None
    if given.kind == "vector" and not (limited or given.direction or given.below):
        numbers += rng.normal(0.0, 0.05, len(numbers))
