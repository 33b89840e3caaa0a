"""A controller as a folder of C, with states and the commands that it gives there, for the C code to reproduce."""

from __future__ import annotations

import os
import pathlib

import numpy as np

from wbc.controller.compiled_stack import CompiledStack, core_of
from wbc.controller.step import Step
from wbc.errors import RangeError
from wbc.export.folder import checked_folder, write
from wbc.export.snapshot import Snapshot
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.stack.layout import Slot
from wbc.tasks.base import Task
from wbc.tick.outcome import STATUSES, Status
from wbc.validation import Array

#: Ticks from one configuration on before the next is drawn
RUN = 20
#: Answers of other solvers than the native one count where their own bound on the error is below this [rad/s, m/s]
CERTAIN = 1e-10
#: States that are tried for each that is wanted
TRIES = 4


#: How far an export's commands may be from those of the tick that it is [rad/s, m/s]: the native tick refines answers
#: whose error it cannot bound by a tenth of that
SAME = 1e-9
#: How far an export's commands may be from those of another solver [rad/s, m/s]
SIMILAR = 1e-6


def export(
    controller: CompiledStack,
    folder: str | os.PathLike[str],
    overwrite: bool,
    solver_source: bool | str | os.PathLike[str],
    states: int,
) -> pathlib.Path:
    """See :meth:`wbc.Controller.export`."""
    from wbc import __version__

    if isinstance(states, bool) or not isinstance(states, int) or not 1 <= states < 2**31:
        raise RangeError("states", states, "expected an integer >= 1")
    checked_folder(folder, overwrite)
    core = core_of(controller)
    core.require_values()
    tick, layout = core.tick, core.layout
    cost = core.row_costs.copy()
    for block in layout.of_form("task"):
        cost[block.span] *= block.entry.item.row_weights(core.stack.robot)
    snapshot = Snapshot(
        core.stack,
        layout,
        tick.q.copy(),
        tick.p.copy(),
        tick.weight.copy(),
        cost,
        tick.enabled.copy(),
        tick.bound_enabled.copy(),
        float(tick.cap[0]),
        __version__,
        vectors(controller.clone(), states),
        f"the {controller.backend} tick with {controller.solver}",
        SAME if controller.solver == "daqp" else SIMILAR,
    )
    return write(snapshot, folder, overwrite, solver_source)


def vectors(controller: CompiledStack, count: int, seed: int = 0) -> Array:
    """States row by row: q, v measured, the run-time inputs, flag, command.

    Short runs of the controller from random configurations within the joints' ranges, with targets near the hand and
    inputs near those that it has; it keeps the last ones. Where another solver than the native one answers, only states
    that it solved with certainty; there may be fewer than ``count``.
    """
    rng = np.random.default_rng(seed)
    core, model = core_of(controller), controller.stack.robot.model
    rows: list[Array] = []
    start = core.tick.p.copy()
    for k in range(TRIES * count):
        if len(rows) == count:
            break
        if k % RUN == 0:
            q, v = _configuration(controller.stack.robot, rng), 0.05 * rng.normal(size=core.layout.nv)
            core.tick.p[:] = start
            _vary(controller, q, rng)
        step = controller.step(q, v)
        first = not step.answered_by  # exported code has no chain
        if first and (controller.solver == "daqp" or _certain(step)):
            rows.append(np.concatenate([q, v, core.tick.p, [STATUSES.index(step.status)], step.command]))
        q, v = pin.integrate(model, q, step.v * controller.stack.dt), step.v.copy()
    width = core.layout.nq + 2 * core.layout.nv + core.layout.parameters + 1
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


def _vary(controller: CompiledStack, q: Array, rng: np.random.Generator) -> None:
    """Inputs of another moment: what follows the configuration is where q has it, the rest near where it was."""
    core = core_of(controller)
    for name, block in core.layout.blocks.items():
        item = block.entry.item
        initial = item.initial(core.seen(name), q)
        for slot in block.slots.values():
            if slot.input.default is None and slot.input.name in initial:
                numbers = controller[name].checked(slot.input.name, initial[slot.input.name])
                core.tick.p[slot.span] = numbers
                if not isinstance(item, Task):
                    continue
            _shake(slot, core.tick.p[slot.span], rng)


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
