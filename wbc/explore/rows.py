"""A stack's goals and margins as functions of the configuration: values and derivatives."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import casadi as ca
import numpy as np

from wbc import validation
from wbc.errors import RangeError, UnknownNameError
from wbc.multibody import pin
from wbc.stack.declaration import Declaration, Entry
from wbc.symbolic import Kinematics, Tracer
from wbc.symbolic.evaluation import SingleState
from wbc.tasks import Fixed, Hold, Mechanism, inputs as run_time
from wbc.tasks.base import Constraint, Task
from wbc.validation import Array

#: A goal is met to this [m or rad]
MET = 1e-10
#: Newton steps towards a goal, at most
ITERATIONS = 30
#: Longest Newton step [rad or m]
STRIDE = 0.5
#: A singular value is zero below this share of the largest
RANK = 1e-7


class StackRows:
    """e(q) of the goals of a stack, its holds among them, and h(q) of its margins, measured distances among those.

    Args:
        stack: tasks and constraints. goals: names of tasks; None: those of the first level with an error of their own.
        values: item -> input -> value; targets that are not given are where ``q`` has them.

    Raises:
        UnknownNameError: no such task. RangeError: no goal, or a constraint on rates that states no configuration.
    """

    def __init__(
        self, stack: Declaration, q: Any, goals: Iterable[str] | None, values: Mapping[str, Mapping[str, Any]]
    ) -> None:
        self.stack, self.robot = stack, stack.robot
        q = self.robot.configuration("q", q)
        names = [entry.name for entry in stack.tasks]
        if goals is None:
            first = min((entry.level for entry in stack.tasks), default=0)
            chosen = [e for e in stack.tasks if e.level == first and _states_an_error(e.item)]
        else:
            chosen = [stack[validation.one_of("goals", name, names)] for name in goals]
        if not chosen:
            raise RangeError("goals", names, "expected a task with an error at the first level")
        for name in values:
            if name not in stack:
                raise UnknownNameError("values", name, [e.name for e in stack.entries])
        self.robot.require_tree("the search of a robot's free motions")
        held, margins, still = list[Entry](), list[Entry](), list[int]()
        for entry in stack.constraints:
            item: Any = entry.item
            if isinstance(item, Fixed):
                still += [k for joint in item.joints for k in range(self.robot.nv)[self.robot.dofs(joint)]]
            elif isinstance(item, Hold):
                held.append(entry)
            elif item.equality and not isinstance(item, Mechanism):
                reason = "it holds rates and no configuration, so that there is no set of configurations to explore"
                raise RangeError("stack", entry.name, reason)
            elif type(item).margins is not Constraint.margins:
                margins.append(entry)
        self.goals = tuple(entry.name for entry in chosen)
        self._tasks, self._holds, self._margins = (
            [_CompiledItem(self.robot, e, q, values.get(e.name, {})) for e in some] for some in (chosen, held, margins)
        )
        self._still = np.vstack((_held_rows(self.robot), np.eye(self.robot.nv)[still]))
        limits = self.robot.limits
        self._bounded = np.flatnonzero(self.robot.position_index >= 0)
        self._index = self.robot.position_index[self._bounded]
        self._low, self._high = limits.position_lower[self._bounded], limits.position_upper[self._bounded]

    def aim(self, name: str, value: Any) -> None:
        """Sets the target of a goal."""
        self._tasks[self.goals.index(validation.one_of("targets", name, self.goals))].put("target", value)

    def errors(self, q: Array) -> tuple[Array, Array]:
        """e [rows] and its Jacobian [rows, nv] of goals and holds, then of coupled, locked and fixed joints."""
        parts = [item(q) for item in (*self._tasks, *self._holds)]
        none = np.zeros(len(self._still))
        return np.concatenate([*(p[0] for p in parts), none]), np.vstack([*(p[1] for p in parts), self._still])

    def rates(self, q: Array, wanted: Any = None) -> Array:
        """Of the rows of :meth:`errors`: those of the goals as wanted, by default -gain e as a tick asks; others 0.

        Raises:
            ShapeError, NotFiniteError: not one number a row of the goals.
        """
        own = np.concatenate([-task.gain * task(q)[0] for task in self._tasks])
        if wanted is not None:
            own = validation.ordinary_array("rates", wanted, own.shape)
        return np.concatenate((own, np.zeros(len(self._still) + sum(len(hold.labels) for hold in self._holds))))

    def broken(self, q: Array, tolerance: float = 1e-9) -> str:
        """The first limit or margin that does not hold, empty if all do: ``JOINT upper``, ``ITEM/ROW``."""
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
        return np.asarray(v[int((sigma > RANK * max(sigma[0], 1e-300)).sum()) :])

    def turned(self, q: Array) -> Array:
        """The same place of every joint, by full turns as near as can be to the middle of its limits."""
        out, middle = q.copy(), 0.5 * (self._low + self._high)
        turns = np.isfinite(middle) & (np.array(self.robot.dof_units)[self._bounded] == "rad")
        at = self._index[turns]
        out[at] = middle[turns] + (q[at] - middle[turns] + np.pi) % (2.0 * np.pi) - np.pi
        return out

    def moved(self, q: Array, step: Array) -> Array:
        """q (+) step."""
        return np.asarray(pin.integrate(self.robot.model, q, step))

    def between(self, a: Array, b: Array) -> Array:
        """Tangent from a to b [nv]."""
        return np.asarray(pin.difference(self.robot.model, a, b))

    def random(self, rng: np.random.Generator) -> Array:
        """A configuration within the limits; turns without limits anywhere, lengths without limits within a metre."""
        low, high = np.full(self.robot.nv, -np.pi), np.full(self.robot.nv, np.pi)
        low[self._bounded], high[self._bounded] = np.maximum(self._low, -np.pi), np.minimum(self._high, np.pi)
        return self.moved(pin.neutral(self.robot.model), rng.uniform(low, high))


class _CompiledItem:
    """An item's rows, compiled for CasADi's virtual machine, with its inputs: e and J of a task, h of margins, and of
    a hold, J v = -gain e, both with a gain of 1.
    """

    def __init__(self, robot: Any, entry: Entry, q: Array, values: Mapping[str, Any]) -> None:
        item: Any = entry.item
        self.name, self.robot = entry.name, robot
        declared = list(item.inputs(robot))
        count = item.sensed_rows(robot) if isinstance(item, Constraint) else 0
        declared += run_time.sensed(robot, count) if count else ()
        tracer, symbols = Tracer(Kinematics(robot.model)), run_time.symbols(robot, declared)
        if isinstance(item, Task):
            e = item.error(robot, tracer, symbols.values)
            outputs = [tracer.expand(e), tracer.jacobian(e)]
        elif isinstance(item, Hold):
            held = item.velocity_rows(robot, tracer, symbols.values, ca.SX(1.0))
            outputs = [-tracer.expand(held.upper), tracer.expand(held.matrix)]
        else:
            outputs = [tracer.expand(item.margins(robot, tracer, symbols.values))]
        flat = ca.densify(ca.veccat(*map(ca.densify, outputs)))
        self._rows = SingleState(ca.Function("rows", [tracer.q, symbols.vector], [flat], {"cse": True}))
        self.labels = [row.label for row in item.rows(robot)]
        gain = getattr(item, "gain", None)
        self.gain = getattr(item, "default_gain", 0.0) if gain is None else float(gain)
        ends = np.cumsum([one.numel() for one in symbols.flat.values()])
        self._declared = {d.name: d for d in declared}
        self._numbers = (
            dict(zip(symbols.flat, np.split(self._rows.inputs[1], ends[:-1]), strict=True)) if declared else {}
        )
        starts = {d.name: d.default for d in declared} | item.initial(robot, q) | dict(values)
        if isinstance(item, Hold):
            starts["gain"] = 1.0
        for name, value in starts.items():
            if value is None and name in self._declared:
                raise RangeError(f"{entry.name}.{name}", None, "this value is needed")
            self.put(name, value)
        self._sensor = item.sensor(robot, self._numbers) if count else None

    def put(self, name: str, value: Any) -> None:
        """Sets an input."""
        validation.one_of(self.name, name, self._declared)
        self._numbers[name][:] = run_time.flat(self.robot, f"{self.name}.{name}", self._declared[name], value)

    def __call__(self, q: Array) -> tuple[Array, Array]:
        self._rows.inputs[0][:] = q
        if self._sensor is not None:
            self._sensor.sense(q)
        self._rows.run()
        count, out = len(self.labels), self._rows.output
        return out[:count].copy(), out[count:].reshape(-1, count).T.copy()


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
