"""The whole QP of a stack, put together by numpy from the rows of its items, which tests/tasks and tests/constraints
hold to Pinocchio one by one.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.evaluation import numbers
from wbc.api import Stack


class Referee:
    """The QP that a stack should have in any state."""

    def __init__(self, stack: Stack) -> None:
        self.stack = stack
        self.items = {entry.name: numbers(entry.item, stack.robot) for entry in stack.entries}

    def qp(self, q: np.ndarray, v: np.ndarray, dt: float, written: dict[str, dict[str, Any]]) -> tuple[np.ndarray, ...]:
        """H, g, A, lower, upper, task errors and margins."""
        stack, robot, nv = self.stack, self.stack.robot, self.stack.robot.nv
        size = np.where(np.array(robot.dof_units) == "m", stack.length, 1.0)
        H, g = np.diag(stack.damping / size**2), np.zeros(nv)
        errors, matrices, sides, margins = [np.zeros(0)], [np.zeros((0, nv))], [], [np.zeros(0)]
        low, high = np.full(nv, -np.inf), np.full(nv, np.inf)
        rows = {name: item(q, written[name], v, dt) for name, item in self.items.items()}
        for entry in stack.tasks:
            values, item = written[entry.name], entry.item
            e, J, drift = rows[entry.name].values()
            scale = np.array([stack.length if row.unit == "m" else 1.0 for row in item.rows(robot)])
            own = np.ones(len(e)) if getattr(item, "weights", None) is None else np.array(item.weights)
            w = values["weight"] * values["mask"] * values["enabled"] * own / scale**2
            H = H + (J.T * w) @ J
            g = g + (J.T * w) @ (values["gain"] * e + drift)
            errors.append(e)
        for entry in sorted(stack.constraints, key=lambda c: c.item.order):
            if entry.item.form == "bounds":
                on = written[entry.name]["mask"] * written[entry.name]["enabled"] != 0
                one, two = rows[entry.name].values()
                low, high = np.where(on, np.clip(one, low, high), low), np.where(on, np.clip(two, low, high), high)
        for entry in stack.constraints:
            values, item = written[entry.name], entry.item
            on = values["mask"] * values["enabled"] != 0
            if item.form == "margins":
                h, matrix, drift = rows[entry.name].values()
                margins.append(h)
                lower, upper = -values["rate"] * h - drift, np.full(len(h), np.inf)
            elif item.form == "rows":
                matrix, lower, upper = rows[entry.name].values()
            else:
                continue
            matrices.append(matrix * on[:, None])
            sides.append((np.where(on, lower, -np.inf), np.where(on, upper, np.inf)))
        lower = np.concatenate([low, *[s[0] for s in sides]])
        upper = np.concatenate([high, *[s[1] for s in sides]])
        return H, g, np.vstack(matrices), lower, upper, np.concatenate(errors), np.concatenate(margins)
