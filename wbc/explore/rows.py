"""A stack's goals and margins as functions of the configuration: values and derivatives."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

from wbc import validation
from wbc.errors import RangeError, UnknownNameError
from wbc.stack.declaration import Declaration, Entry
from wbc.symbolic import Kinematics, Tracer
from wbc.tasks import Fixed, Mechanism
from wbc.tasks import inputs as run_time
from wbc.tasks.base import Constraint, Task
from wbc.validation import Array

#: A goal is met to this [m or rad], after so many Newton steps at most, none longer than this
MET, ITERATIONS, STRIDE = 1e-10, 30, 0.5
#: A singular value is zero below this share of the largest
RANK = 1e-7


class StackRows:
    """e(q) of the goals of a stack and h(q) of its margins, exact derivatives along the tangent space.

    Args:
        stack: tasks and constraints. goals: names of tasks; None: those of the first level with an error of their own.
        values: item -> input -> value; targets that are not given are where ``q`` has them.

    Raises:
        UnknownNameError: no such task. RangeError: no goal, or rows that are measured and not expressed.
    """

    def __init__(
        self, stack: Declaration, q: Any, goals: Iterable[str] | None, values: Mapping[str, Mapping[str, Any]]
    ) -> None:
        self.stack, self.robot = stack, stack.robot
        model = self.robot.model
        q = self.robot.configuration("q", q)
        names = [entry.name for entry in stack.tasks]
        first = min((entry.level for entry in stack.tasks), default=0)
        if goals is None:
            chosen = [e for e in stack.tasks if e.level == first and _states_an_error(e.item)]
        else:
            for name in goals:
                validation.one_of("goals", name, names)
            chosen = [stack[name] for name in goals]
        if not chosen:
            raise RangeError("goals", names, "expected a task with an error at the first level")
        for name in values:
            if name not in stack:
                raise UnknownNameError("values", name, [e.name for e in stack.entries])
        self.goals = tuple(entry.name for entry in chosen)
        self._tasks = [_Item(self.robot, e, "error", q, values.get(e.name, {})) for e in chosen]
        self._margins = []
        self._held = _held_rows(self.robot)
        for entry in stack.constraints:
            item: Any = entry.item
            if isinstance(item, Fixed):
                still = [k for joint in item.joints for k in range(self.robot.nv)[self.robot.dofs(joint)]]
                self._held = np.vstack((self._held, np.eye(self.robot.nv)[still]))
            elif getattr(item, "equality", False) and not isinstance(item, Mechanism):
                raise RangeError("stack", entry.name, "what holds exactly cannot be explored, but for Fixed joints")
            if item.sensed_rows(self.robot):
                raise RangeError("stack", entry.name, "its distances are measured, and cannot be explored")
            if type(item).margins is not Constraint.margins:
                self._margins.append(_Item(self.robot, entry, "margins", q, values.get(entry.name, {})))
        limits = self.robot.limits
        self._bounded = np.flatnonzero(self.robot.position_index >= 0)
        self._index = self.robot.position_index[self._bounded]
        self._low, self._high = limits.position_lower[self._bounded], limits.position_upper[self._bounded]
        self._model = model

    def aim(self, name: str, value: Any) -> None:
        """Sets the target of a goal."""
        self._tasks[self.goals.index(name)].put("target", value)

    def errors(self, q: Array) -> tuple[Array, Array]:
        """e [rows] and its Jacobian [rows, nv] of all goals, then of joints that are coupled, locked or fixed."""
        parts = [task(q) for task in self._tasks]
        none = np.zeros(len(self._held))
        return np.concatenate([*(e for e, _ in parts), none]), np.vstack([*(J for _, J in parts), self._held])

    def rates(self, q: Array) -> Array:
        """What the goals ask of their rows in a tick: -gain e."""
        return np.concatenate([-task.gain * task(q)[0] for task in self._tasks])

    def task_rates(self, rates: Any) -> Array:
        """Rates of the goals, and none of the other rows.

        Raises:
            ShapeError, NotFiniteError: not one number a row of the goals.
        """
        count = sum(len(task.labels) for task in self._tasks)
        return np.concatenate((validation.ordinary_array("rates", rates, (count,)), np.zeros(len(self._held))))

    def margins(self, q: Array) -> tuple[Array, Array]:
        """h [rows] and its Jacobian [rows, nv] of all margins."""
        parts = [margin(q) for margin in self._margins]
        none = np.zeros(0), np.zeros((0, self.robot.nv))
        return none if not parts else (np.concatenate([h for h, _ in parts]), np.vstack([J for _, J in parts]))

    def broken(self, q: Array, tolerance: float = 1e-9) -> str:
        """The first limit or margin that does not hold, empty if all do."""
        at = q[self._index]
        for side, off in (("upper", at - self._high), ("lower", self._low - at)):
            if len(off) and off.max() > tolerance:
                return f"{self.robot.dof_names[self._bounded[int(np.argmax(off))]]} {side}"
        for margin in self._margins:
            h = margin(q)[0]
            if h.min(initial=1.0) < -tolerance:
                return f"{margin.name}/{margin.labels[int(np.argmin(h))]}"
        return ""

    def room(self, q: Array) -> float:
        """Distance from the nearest position limit, as a share of half the range; 1 in the middle of all."""
        width = self._high - self._low
        some = np.isfinite(width) & (width > 0.0)
        at = q[self._index][some]
        share = 2.0 * np.minimum(at - self._low[some], self._high[some] - at) / width[some]
        return float(share.min(initial=1.0))

    def correct(self, q: Array) -> Array | None:
        """The configuration near q that meets the goals, by Newton's least steps; None if there is none."""
        for _ in range(ITERATIONS):
            e, J = self.errors(q)
            if np.abs(e).max() < MET:
                return q
            step = -np.linalg.pinv(J, rcond=RANK) @ e
            longest = float(np.abs(step).max())
            q = self.moved(q, step * min(1.0, STRIDE / max(longest, 1e-300)))
        return None

    def self_motions(self, q: Array) -> Array:
        """Orthonormal directions that move no goal [k, nv]."""
        _, sigma, v = np.linalg.svd(self.errors(q)[1])
        rank = int((sigma > RANK * max(sigma[0], 1e-300)).sum())
        return np.asarray(v[rank:])

    def moved(self, q: Array, step: Array) -> Array:
        """q (+) step."""
        return np.asarray(pin.integrate(self._model, q, step))

    def between(self, a: Array, b: Array) -> Array:
        """Tangent from a to b [nv]."""
        return np.asarray(pin.difference(self._model, a, b))

    def random(self, rng: np.random.Generator) -> Array:
        """A configuration within the limits; turns without limits anywhere, lengths without limits within a metre."""
        low, high = np.full(self.robot.nv, -np.pi), np.full(self.robot.nv, np.pi)
        low[self._bounded], high[self._bounded] = np.maximum(self._low, -np.pi), np.minimum(self._high, np.pi)
        zero = pin.neutral(self._model)
        return self.moved(zero, rng.uniform(low, high))


class _Item:
    """One item's expression, compiled for CasADi's virtual machine, with its inputs."""

    def __init__(self, robot: Any, entry: Entry, method: str, q: Array, values: Mapping[str, Any]) -> None:
        item: Any = entry.item
        expression = getattr(item, method)
        self.name, self.robot, self.item = entry.name, robot, item
        declared = item.inputs(robot)
        tracer, symbols = Tracer(Kinematics(robot.model)), run_time.symbols(robot, declared)
        rows = ca.densify(expression(robot, tracer, symbols.values))
        outputs = [tracer.expand(rows), tracer.expand(ca.densify(tracer.jacobian(rows)))]
        self._function = ca.Function("rows", [tracer.q, symbols.vector], outputs, {"cse": True})
        self._declared = {d.name: d for d in declared}
        self.labels = [row.label for row in item.rows(robot)]
        gain = getattr(item, "gain", None)
        self.gain = getattr(item, "default_gain", 0.0) if gain is None else float(gain)
        starts = {d.name: d.default for d in declared} | item.initial(robot, q) | dict(values)
        missing = [name for name in self._declared if starts.get(name) is None]
        if missing:
            raise RangeError(f"{entry.name}.{missing[0]}", None, "this value is needed")
        self._numbers: dict[str, Array] = {}
        for name, value in starts.items():
            self.put(name, value)

    def put(self, name: str, value: Any) -> None:
        """Sets an input.

        Raises:
            UnknownNameError, ShapeError, NotFiniteError, RotationError: no such input, or no value of it.
        """
        validation.one_of(self.name, name, self._declared)
        field = f"{self.name}.{name}"
        self._numbers[name] = np.atleast_1d(run_time.flat(self.robot, field, self._declared[name], value))
        self._vector = np.concatenate([np.zeros(0), *(self._numbers.get(n, np.zeros(0)) for n in self._declared)])

    def __call__(self, q: Array) -> tuple[Array, Array]:
        value, J = self._function(q, self._vector)
        return np.asarray(value.full())[:, 0], np.asarray(J.full())


def _held_rows(robot: Any) -> Array:
    """Rows of v that the mechanism keeps at zero: couplings, and what the base cannot drive."""
    rows = np.zeros((len(robot.couplings) + len(robot.locked_dofs), robot.nv))
    for k, one in enumerate(robot.couplings):
        rows[k, one.follower], rows[k, one.leader] = 1.0, -one.ratio
    for k, dof in enumerate(robot.locked_dofs, len(robot.couplings)):
        rows[k, dof] = 1.0
    return rows


def _states_an_error(item: Any) -> bool:
    return isinstance(item, Task) and type(item).error is not Task.error
