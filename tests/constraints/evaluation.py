"""Numbers from one constraint on one robot, without the stack: rows, their derivative, bounds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

from wbc.robot import Robot
from wbc.symbolic.kinematics import Kinematics, Pose
from wbc.symbolic.rotations import rotation_rate
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Constraint, Input

SIZES = {"pose": 12, "rotation": 9}


def flat_pose(value: Any) -> np.ndarray:
    """A pose as it stands in the buffer: rotation by columns, then position."""
    return np.concatenate([value.rotation.ravel(order="F"), value.translation])


@dataclass(frozen=True, eq=False)
class Probe:
    """A constraint's expressions as numeric functions of (q, v, inputs, dt)."""

    robot: Robot
    inputs: tuple[Input, ...]
    function: ca.Function

    def __call__(
        self, q: np.ndarray, v: np.ndarray | None = None, dt: float = 0.005, **values: Any
    ) -> tuple[np.ndarray, ...]:
        """Outputs as arrays: (h, J, dh/dt), (A, lower, upper) or (lower, upper)."""
        p = np.concatenate([np.zeros(0), *[self._numbers(i, values.pop(i.name, i.default), q) for i in self.inputs]])
        assert not values, f"no such inputs: {sorted(values)}"
        outputs = self.function(q, np.zeros(self.robot.nv) if v is None else v, p, dt)
        arrays = [np.array(out) for out in outputs]
        return tuple(a[:, 0] if f else a for a, f in zip(arrays, self._columns(), strict=True))

    def _columns(self) -> list[bool]:
        matrices = {"J", "A"}
        return [name not in matrices for name in self.function.name_out()]

    def _numbers(self, declared: Input, value: Any, q: np.ndarray) -> np.ndarray:
        if declared.kind == "pose":
            return flat_pose(value)
        return np.atleast_1d(np.asarray(value, dtype=float)).ravel()


def probe(item: Constraint, robot: Robot) -> Probe:
    """Compile an item on a robot (virtual machine, no C)."""
    item.validate(robot)
    kinematics = Kinematics(robot.model)
    tracer = Tracer(kinematics)
    declared = item.inputs(robot)
    symbols: list[ca.SX] = []
    values: dict[str, Any] = {}
    for i in declared:
        symbol = ca.SX.sym(i.name, SIZES.get(i.kind, max(1, i.size)))
        symbols.append(symbol)
        values[i.name] = Pose(ca.reshape(symbol[:9], 3, 3), symbol[9:]) if i.kind == "pose" else symbol
    dt = ca.SX.sym("dt")
    by_name = dict(zip([i.name for i in declared], symbols, strict=True))
    if item.form == "margins":
        h = item.margins(robot, tracer, values)
        drift = ca.SX(h.numel(), 1)
        for i in declared:
            if i.rate is not None:
                assert i.kind == "pose"
                symbol, twist = by_name[i.name], by_name[i.rate]
                speed = ca.vertcat(rotation_rate(ca.reshape(symbol[:9], 3, 3)) @ twist[3:], twist[:3])
                drift += ca.jacobian(h, symbol) @ speed
        outputs, names = [tracer.expand(h), tracer.jacobian(h), tracer.expand(drift)], ["h", "J", "ht"]
    elif item.form == "rows":
        rows = item.velocity_rows(robot, tracer, values, dt)
        outputs, names = [rows.matrix, rows.lower, rows.upper], ["A", "lower", "upper"]
        outputs = [tracer.expand(ca.SX(o)) for o in outputs]
    else:
        bounds = item.bounds(robot, tracer, values, dt)
        outputs, names = [tracer.expand(bounds.lower), tracer.expand(bounds.upper)], ["lower", "upper"]
    assert [o.shape[0] for o in outputs] == [len(item.rows(robot))] * len(outputs)
    arguments = [kinematics.q, kinematics.v, ca.vertcat(ca.SX(0, 1), *symbols), dt]
    function = ca.Function("item", arguments, [ca.densify(o) for o in outputs], ["q", "v", "p", "dt"], names)
    return Probe(robot, declared, function)


def random_configuration(robot: Robot, rng: np.random.Generator) -> np.ndarray:
    """A configuration within the position limits; bases within a metre of the origin."""
    spread = np.where(robot.position_index >= 0, 0.0, 1.0)
    q = pin.integrate(robot.model, robot.neutral, spread * rng.uniform(-1.0, 1.0, robot.nv))
    for i, k in enumerate(robot.position_index):
        if k >= 0:
            lower, upper = robot.limits.position_lower[i], robot.limits.position_upper[i]
            q[k] = rng.uniform(max(lower, -3.0), min(upper, 3.0))
    return q


def numeric_jacobian(robot: Robot, q: np.ndarray, value: Any, step: float = 1e-4) -> np.ndarray:
    """Derivative along the tangent space by a central difference of fourth order, rows x nv."""
    columns = []
    for direction in np.eye(robot.nv):
        at = [value(pin.integrate(robot.model, q, k * step * direction)) for k in (-2, -1, 1, 2)]
        columns.append((at[0] - 8 * at[1] + 8 * at[2] - at[3]) / (12 * step))
    return np.column_stack(columns)
