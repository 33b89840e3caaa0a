"""What a page and other clients are told: once what there is, and then of every tick what came of it."""

from __future__ import annotations

from typing import Any

import numpy as np

from wbc.api import Controller
from wbc.controller import core_of
from wbc.explain.explanation import Explanation
from wbc.tasks import Posture
from wbc.tasks.base import Task
from wbc.viewer.messages import FORMAT, sent_pose
from wbc.viewer.tick import Tick


def declared(controller: Controller) -> dict[str, Any]:
    """The message ``hello``: robot, joints and items with their values."""
    core, robot = core_of(controller), controller.stack.robot
    joints = []
    for k, (name, unit, place) in enumerate(zip(robot.dof_names, robot.dof_units, robot.position_index, strict=True)):
        low, high = float(robot.limits.position_lower[k]), float(robot.limits.position_upper[k])
        if k in robot.passive:
            # What no motor drives has no slider
            low = high = -np.inf
        # Unbounded joints have two numbers in q, a base up to seven
        joints.append({"name": name, "unit": unit, "place": int(place), "low": low, "high": high})
    items = []
    for name, block in core.layout.blocks.items():
        item = block.entry.item
        inputs = [
            {
                "name": slot.input.name,
                "kind": slot.input.kind,
                "unit": slot.input.unit,
                "size": slot.size,
                "rate": slot.input.rate,
            }
            for slot in block.slots.values()
            if not slot.input.sensed
        ]
        about = {"name": name, "kind": type(item).__name__, "form": block.form, "level": block.entry.level}
        about |= {"hard": block.entry.hard, "inputs": inputs, "rows": [row.label for row in block.rows]}
        if isinstance(item, Posture):
            about["posture"] = True
        items.append(about)
    return {
        "type": "hello",
        "wbc": FORMAT,
        "robot": robot.name,
        "dt": controller.stack.dt,
        "command": core.layout.command,
        "joints": joints,
        "items": items,
    }


def told(controller: Controller, tick: Tick) -> dict[str, Any]:
    """The message ``state`` of a tick."""
    core, step = core_of(controller), tick.step
    binding = step.binding
    bound = {row.item for row in binding}
    residuals, margins = step.residuals, step.margins
    items: dict[str, dict[str, Any]] = {}
    for name, block in core.layout.blocks.items():
        about: dict[str, Any] = {"on": tick.is_on(block)}
        if name in residuals:
            residual = residuals[name]
            about["residual"] = {unit: residual.norm(unit) for unit in dict.fromkeys(residual.units)}
        if name in margins and len(margins[name]):
            least = int(np.argmin(margins[name]))
            about |= {"margin": float(margins[name][least]), "row": block.rows[least].label}
            about["unit"] = block.rows[least].unit
        if name in bound:
            about["binds"] = True
        values: dict[str, Any] = {}
        for slot in block.slots.values():
            declared_input, numbers = slot.input, tick.part("p")[slot.span]
            if declared_input.sensed or declared_input.name not in SHOWN:
                continue
            if declared_input.kind == "pose":
                values[declared_input.name] = sent_pose(numbers)
            else:
                values[declared_input.name] = float(numbers[0]) if slot.size == 1 else numbers
        if isinstance(block.entry.item, Task):
            shares = tick.part("weight")[block.span] / core.row_costs[block.span]
            values["weight"] = float(shares.max(initial=0.0))
        about["values"] = values
        items[name] = about
    return {
        "type": "state",
        "wbc": FORMAT,
        "number": tick.number,
        "t": tick.time,
        "status": str(step.status),
        "answered_by": step.answered_by,
        "q": tick.q,
        "v": step.v,
        "speed": float(np.abs(step.v).max(initial=0.0)),
        "items": items,
        "binding": [str(row) for row in binding],
        "relaxed": [str(slack) for slack in step.relaxed],
        "scales": dict(step.scales),
    }


def sentences(explanation: Explanation) -> list[str]:
    """An explanation for the panel: contradictions first, then what held each task back."""
    text = [f"Without usable numbers: {', '.join(explanation.broken)}."] if explanation.broken else []
    text += [str(conflict) for conflict in explanation.conflicts]
    if explanation.gave_way:
        text.append("What gave way: " + ", ".join(str(give) for give in explanation.gave_way) + ".")
    text += [str(reason) for reason in explanation.reasons]
    return text or ["Nothing is in the way: every task does what it asks for."]


#: Values that a page shows
SHOWN = ("target", "pose", "gain", "rate", "margin", "price")
