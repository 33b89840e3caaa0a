"""Numbers from one item on one robot, without the stack; random run-time inputs, those of later times, and slopes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

from wbc.robot import Robot
from wbc.symbolic.kinematics import Kinematics
from wbc.symbolic.operators import quick_operators
from wbc.symbolic.rotations import rotation_rate
from wbc.symbolic.tracer import Tracer
from wbc.tasks import Constraint, Input, Item, Task, inputs as run_time


@dataclass(frozen=True, eq=False)
class Numbers:
    """Outputs of an item by name: value, jacobian, drift (tasks and margins); matrix, lower, upper; lower, upper."""

    robot: Robot
    item: Item
    function: ca.Function

    @cached_property
    def declared(self) -> tuple[Input, ...]:
        """The inputs, asked for once."""
        return tuple(self.item.inputs(self.robot))

    def flat(self, values: dict[str, Any]) -> np.ndarray:
        """The inputs' values as one vector."""
        parts = [run_time.flat(self.robot, d.name, d, values[d.name]) for d in self.declared]
        return np.concatenate([np.zeros(0), *parts])

    def __call__(
        self, q: np.ndarray, values: dict[str, Any], v: np.ndarray | None = None, dt: float = 0.005
    ) -> dict[str, np.ndarray]:
        """All outputs; columns as vectors."""
        _, run, given, found = self._kept
        for place, value in zip(given, (q, 0.0 if v is None else v, self.flat(values), dt), strict=True):
            place[:] = value
        run()
        arrays = {name: a.reshape(shape, order="F").copy() for name, (a, shape) in found.items()}
        return {name: a if name in ("jacobian", "matrix") else a[:, 0] for name, a in arrays.items()}

    @cached_property
    def _kept(self) -> tuple[Any, Callable[[], None], list[np.ndarray], dict[str, tuple[np.ndarray, tuple[int, int]]]]:
        """The function on kept arrays, which takes a fifth of the time of a call that makes its own."""
        buffer, run = self.function.buffer()
        given = [np.zeros(self.function.nnz_in(k)) for k in range(self.function.n_in())]
        names = self.function.name_out()
        found = {n: (np.zeros(self.function.nnz_out(n)), self.function.size_out(n)) for n in names}
        for k, array in enumerate(given):
            buffer.set_arg(k, memoryview(array))
        for k, (array, _) in enumerate(found.values()):
            buffer.set_res(k, memoryview(array))
        return buffer, run, given, found


def quick(function: ca.Function) -> Callable[..., tuple[np.ndarray, ...]]:
    """A function on kept arrays, in a fifth of the time of a call that makes its own; matrices come out whole."""
    symbols = [ca.SX.sym(f"x{k}", *function.size_in(k)) for k in range(function.n_in())]
    dense = ca.Function("dense", symbols, [ca.densify(ca.SX(o)) for o in function.call(symbols)])
    buffer, run = dense.buffer()
    given = [np.zeros(dense.nnz_in(k)) for k in range(dense.n_in())]
    found = [np.zeros(dense.size_out(k), order="F") for k in range(dense.n_out())]
    for k, array in enumerate(given):
        buffer.set_arg(k, memoryview(array))
    for k, array in enumerate(found):
        buffer.set_res(k, memoryview(array.ravel(order="K")))

    # The buffer, which has the addresses, is kept as long as the function
    def call(*values: np.ndarray | float, kept: object = buffer) -> tuple[np.ndarray, ...]:
        for place, value in zip(given, values, strict=True):
            place[:] = value
        run()
        return tuple(array.copy() for array in found)

    return call


@quick_operators()
def numbers(item: Item, robot: Robot) -> Numbers:
    """Validate an item and make its expressions a function, interpreted."""
    item.validate(robot)
    kinematics, dt = _kinematics(robot), ca.SX.sym("dt")
    tracer = Tracer(kinematics)
    symbols = run_time.symbols(robot, item.inputs(robot))
    outputs: dict[str, ca.SX] = {}
    if isinstance(item, Task) or (isinstance(item, Constraint) and item.form == "margins"):
        value = item.error(robot, tracer, symbols.values) if isinstance(item, Task) else None
        value = item.margins(robot, tracer, symbols.values) if value is None else value
        own = item.jacobian(robot, tracer, symbols.values) if isinstance(item, Task) else None
        slopes = tracer.slope(value) if own is None else own
        parts = tracer.expanded(value, slopes, drift(robot, kinematics, item, symbols, value))
        outputs = dict(zip(("value", "jacobian", "drift"), parts, strict=True))
    elif item.form == "rows":
        rows = item.velocity_rows(robot, tracer, symbols.values, dt)
        names = ("matrix", "lower", "upper")
        outputs = dict(zip(names, tracer.expanded(*(ca.SX(getattr(rows, name)) for name in names)), strict=True))
    else:
        bounds = item.bounds(robot, tracer, symbols.values, dt)
        outputs = dict(zip(("lower", "upper"), tracer.expanded(bounds.lower, bounds.upper), strict=True))
    for name, output in outputs.items():
        assert output.shape[0] == len(item.rows(robot)), name
    arguments = [kinematics.q, kinematics.v, symbols.vector, dt]
    dense = [ca.densify(o) for o in outputs.values()]
    return Numbers(robot, item, ca.Function("item", arguments, dense, ["q", "v", "p", "dt"], list(outputs)))


@lru_cache(maxsize=16)
def _kinematics(robot: Robot) -> Kinematics:
    """Expressions that the items of one robot share."""
    return Kinematics(robot.model)


@dataclass(frozen=True, eq=False)
class Probe:
    """An item's outputs in their order, of run-time values that are named or else the defaults."""

    numbers: Numbers

    def __call__(
        self, q: np.ndarray, v: np.ndarray | None = None, dt: float = 0.005, **values: Any
    ) -> tuple[np.ndarray, ...]:
        """Of a constraint (margins, Jacobian, drift), (matrix, lower, upper) or (lower, upper)."""
        defaults = {d.name: d.default for d in self.numbers.declared}
        assert values.keys() <= defaults.keys(), f"no such inputs: {sorted(values.keys() - defaults.keys())}"
        return tuple(self.numbers(q, defaults | values, v, dt).values())


def probe(item: Item, robot: Robot) -> Probe:
    """An item on a robot, interpreted."""
    return Probe(numbers(item, robot))


def drift(robot: Robot, kinematics: Kinematics, item: Item, symbols: run_time.Symbols, value: ca.SX) -> ca.SX:
    """Partial time derivative through the inputs that have a rate."""
    total = ca.SX(value.numel(), 1)
    for d in item.inputs(robot):
        if d.rate is None:
            continue
        part, speed = symbols.flat[d.name], symbols.flat[d.rate]
        if d.kind == "pose":
            change = ca.vertcat(rotation_rate(ca.reshape(part[:9], 3, 3)) @ speed[3:], speed[:3])
        elif d.kind == "rotation":
            change = rotation_rate(ca.reshape(part, 3, 3)) @ speed
        elif d.kind == "configuration":
            change = kinematics.tangent_map_at(part) @ speed
        else:
            change = speed
        total = total + ca.jacobian(value, part) @ change
    return total


def sample(robot: Robot, declared: Input, rng: np.random.Generator) -> Any:
    """A random value of an input, as the user writes it."""
    turn, place = pin.exp3(rng.uniform(-1.8, 1.8, 3)), rng.uniform(-1.0, 1.0, 3)
    if declared.kind == "pose":
        return pin.SE3(turn, place)
    if declared.kind == "rotation":
        return turn
    if declared.kind == "configuration":
        return pin.integrate(robot.model, robot.neutral, rng.uniform(-1.0, 1.0, robot.nv))
    if declared.direction:
        return place / np.linalg.norm(place)
    count = run_time.size(robot, declared)
    drawn = rng.uniform(max(declared.low, -1.0), min(declared.high, 1.0), count)
    return float(drawn[0]) if declared.kind == "vector" and declared.size == 0 else drawn


def later(robot: Robot, item: Item, values: dict[str, Any], time: float) -> dict[str, Any]:
    """The values after ``time`` at the rates that they hold, moved by Pinocchio and not by our expressions."""
    out = dict(values)
    for d in item.inputs(robot):
        if d.rate is None:
            continue
        value, speed = values[d.name], np.asarray(values[d.rate], dtype=float) * time
        if d.kind == "pose":
            out[d.name] = pin.SE3(pin.exp3(speed[3:]) @ value.rotation, value.translation + speed[:3])
        elif d.kind == "rotation":
            out[d.name] = pin.exp3(speed) @ value
        elif d.kind == "configuration":
            out[d.name] = pin.integrate(robot.model, value, speed)
        else:
            out[d.name] = value + (float(speed) if np.ndim(value) == 0 else speed)
    return out


def slope(value: Callable[[float], np.ndarray], step: float = 1e-4) -> np.ndarray:
    """Derivative at 0, central difference of fourth order."""
    return (value(-2 * step) - 8 * value(-step) + 8 * value(step) - value(2 * step)) / (12 * step)


def random_configuration(robot: Robot, rng: np.random.Generator) -> np.ndarray:
    """A configuration within the position limits; bases within a metre of the origin."""
    spread = np.where(robot.position_index >= 0, 0.0, 1.0)
    q = pin.integrate(robot.model, robot.neutral, spread * rng.uniform(-1.0, 1.0, robot.nv))
    for i, k in enumerate(robot.position_index):
        if k >= 0:
            lower, upper = robot.limits.position_lower[i], robot.limits.position_upper[i]
            q[k] = rng.uniform(max(lower, -3.0), min(upper, 3.0))
    return q
