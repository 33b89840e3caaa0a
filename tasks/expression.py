"""The user's own task: any expression of the kinematics, in three lines."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from wbc import validation
from wbc.errors import NotFiniteError, ShapeError, UnknownNameError
from wbc.pickling import by_name_or_value
from wbc.robot import Robot
from wbc.symbolic.evaluation import SingleState
from wbc.symbolic.kinematics import Kinematics
from wbc.symbolic.tracer import Tracer
from wbc.tasks import inputs as run_time
from wbc.tasks.base import Input, Row, Task, Values
from wbc.tasks.frames import checked_weights
from wbc.tasks.units import checked_unit


@dataclass(frozen=True, init=False)
class Expression(Task):
    """Whatever the user writes is to become zero:

        e = function(kin, p)                                  [units]

    ``kin`` is a :class:`wbc.symbolic.Tracer`. It answers with CasADi SX expressions, in the world and in SI units:

        kin.position(frame), kin.position(frame, offset)     a frame's origin, or a point in it (3)
        kin.rotation(frame)                                  rotation matrix (3x3)
        kin.pose(frame)                                      both, with point, inverse_point, times, inverse
        kin.rotation_error(frame, base, target)              rotation vector from a 3x3 target in base to the frame (3)
        kin.manipulability(frame, base, rows, length)        see Manipulability
        kin.center_of_mass()                                 centre of mass (3)
        kin.joint(name), kin.q                               a joint's coordinate; the whole configuration

    ``p`` holds the declared inputs by name: scalars, vectors, 3x3 rotations, poses. The result is a scalar, a column or
    a list of them. The Jacobian is exact, and so is the feed-forward of an input that names the input of its ``rate``.
    Compiled code is cached by the traced formula.

    A pickle of it finds the function by its name again. A lambda or local function has none and is pickled by value,
    for which ``cloudpickle`` must be installed; else pickling raises a ``PicklingError``.

    Attributes:
        function: called as ``function(kin, p)`` each time the task is built; it must give the same each time.
        units: unit of each row, or one for all, of :data:`wbc.tasks.units.UNITS`; rows in ``m`` are divided by the
            characteristic length, those in ``mm`` by 1000 times it, those in ``deg`` by 180 / pi.
        inputs, declared: the run-time inputs, each with a default; ``declared`` when it is read.
        labels: name of each row; None: "value" for one row, else "0", "1", ...
        weights: one number >= 0 a row, None: 1 each.

    Inputs:
        as declared. Each needs a default: nothing else can tell where the function starts from.

    What it cannot do: depend on the velocity. Python branches run once, when the function is traced: for a choice that
    depends on q or on inputs use ``casadi.if_else``, with both branches finite. Where the formula has no derivative (a
    norm at zero) the row has none.

    Example:
        >>> import wbc
        >>> from wbc.tasks import Expression, Input
        >>> stack = wbc.Stack(wbc.robots.load("panda"), dt=0.005)
        >>> stack.add(Expression(
        ...     lambda kin, p: kin.position("panda_hand")[2] - p["height"],
        ...     units="m", inputs=(Input("height", unit="m", default=0.4),)), name="height")
        >>> controller = stack.compile(backend="vm")
        >>> controller["height"].height = 0.5

    Raises:
        WbcError: the function raised. UnknownNameError: a frame, joint, input or unit that does not exist.
        ShapeError: the result is no SX column, has symbols of its own, or does not depend on q.
        NotFiniteError: the result or its Jacobian is not finite at the robot's neutral configuration.
    """

    function: Callable[[Tracer, Values], Any]
    units: tuple[str, ...] | str
    declared: tuple[Input, ...]
    labels: tuple[str, ...] | None
    weights: tuple[float, ...] | None

    def __init__(
        self,
        function: Callable[[Tracer, Values], Any],
        *,
        units: str | Iterable[str],
        inputs: Iterable[Input] = (),
        labels: Iterable[str] | None = None,
        weights: Iterable[float] | None = None,
        gain: float | None = None,
    ) -> None:
        if not callable(function):
            raise ShapeError("Expression.function", function, "expected a function of (kin, p)")
        object.__setattr__(self, "function", function)
        words = (units,) if isinstance(units, str) else _strings("units", units)
        for word in words:
            checked_unit("Expression.units", word)
        object.__setattr__(self, "units", units if isinstance(units, str) else words)
        object.__setattr__(
            self,
            "declared",
            (inputs,) if isinstance(inputs, Input) else validation.items("Expression.inputs", inputs, "inputs"),
        )
        object.__setattr__(self, "labels", None if labels is None else _strings("labels", labels))
        object.__setattr__(self, "weights", checked_weights("Expression.weights", weights))
        object.__setattr__(self, "gain", gain)

    def __getstate__(self) -> dict[str, Any]:
        return super().__getstate__() | {"function": by_name_or_value("Expression.function", self.function)}

    def validate(self, robot: Robot) -> None:
        run_time.check(robot, "Expression.inputs", self.declared)
        for d in self.declared:
            if d.default is None:
                raise ShapeError(f"Expression.inputs.{d.name}", None, "an input of an Expression needs a default")
        trace = self._trace(robot)
        self._check_counts(trace.error.numel())
        jacobian = trace.tracer.jacobian(trace.error)
        if jacobian.nnz() == 0:
            raise ShapeError("Expression.function", trace.error, "the result does not depend on the configuration")
        outputs = [trace.tracer.expand(trace.error), jacobian]
        function = SingleState(ca.Function("check", [trace.tracer.q, trace.symbols.vector], outputs))
        values = [run_time.flat(robot, d.name, d, d.default) for d in self.declared]
        error, matrix = function(robot.neutral, np.concatenate([np.zeros(0), *values]))
        if not np.isfinite(error).all():
            raise NotFiniteError("Expression.function", error.ravel(), "the error at the neutral configuration")
        if not np.isfinite(matrix).all():
            rows = np.flatnonzero(~np.isfinite(matrix).all(axis=1)).tolist()
            reason = "no derivative at the neutral configuration, rows listed"
            raise NotFiniteError("Expression.function", rows, reason)

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return self.declared

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return self._rows(self._trace(robot))

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        given = _Named({d.name: inputs[d.name] for d in self.declared})
        return _column(validation.called("Expression.function", self.function, kin, given))

    def declaration(self, robot: Robot) -> dict[str, Any]:
        trace = self._trace(robot)
        formula, known = trace.tracer.formula(trace.error)
        arguments = [*known.values(), trace.symbols.vector]
        traced = ca.Function("expression", arguments, [formula])
        return {
            "class": f"{type(self).__module__}.{type(self).__qualname__}",
            "rows": [[row.label, row.unit] for row in self._rows(trace)],
            "weights": None if self.weights is None else [w.hex() for w in self.weights],
            "inputs": [[d.name, d.kind, run_time.size(robot, d), d.rate] for d in self.declared],
            "symbols": list(known),
            "function": hashlib.sha256(traced.serialize().encode()).hexdigest(),
        }

    def _rows(self, trace: _Trace) -> tuple[Row, ...]:
        count = trace.error.numel()
        self._check_counts(count)
        units = (self.units,) * count if isinstance(self.units, str) else self.units
        default = ("value",) if count == 1 else tuple(str(k) for k in range(count))
        return tuple(Row(label, unit) for label, unit in zip(self.labels or default, units, strict=True))

    def _trace(self, robot: Robot) -> _Trace:
        tracer = Tracer(Kinematics(robot.tree))
        symbols = run_time.symbols(robot, self.declared)
        error = self.error(robot, tracer, symbols.values)
        formula, known = tracer.formula(error)
        free = {s.element_hash(): s.name() for s in ca.symvar(formula)}
        if any(s.element_hash() in free for s in ca.symvar(tracer.v)):
            raise ShapeError("Expression.function", "kin.v", "an error is a function of the configuration, not of v")
        for s in ca.symvar(ca.vertcat(*known.values(), symbols.vector)):
            free.pop(s.element_hash(), None)
        if free:
            raise ShapeError("Expression.function", list(free.values()), "the result has symbols that are not inputs")
        return _Trace(tracer, symbols, error)

    def _check_counts(self, count: int) -> None:
        if not isinstance(self.units, str) and len(self.units) != count:
            raise ShapeError("Expression.units", self.units, f"the function gives {count} rows")
        if self.labels is not None and len(self.labels) != count:
            raise ShapeError("Expression.labels", self.labels, f"the function gives {count} rows")
        checked_weights("Expression.weights", self.weights, count)


@dataclass(frozen=True, eq=False)
class _Trace:
    tracer: Tracer
    symbols: run_time.Symbols
    error: ca.SX


class _Named(dict[str, Any]):
    """Inputs by name; a wrong name is answered with the right ones."""

    def __missing__(self, name: str) -> Any:
        raise UnknownNameError("Expression input", name, self)


def _strings(field: str, value: Any) -> tuple[str, ...]:
    return validation.strings(f"Expression.{field}", value)


def _column(result: Any) -> ca.SX:
    parts = list(result) if isinstance(result, (list, tuple)) else [result]
    if not parts or not all(isinstance(part, (ca.SX, int, float)) for part in parts):
        raise ShapeError("Expression.function", result, "expected a CasADi SX column, or a list of SX scalars")
    columns = [ca.SX(part) for part in parts]
    if any(c.shape[1] != 1 or c.shape[0] == 0 for c in columns):
        shapes = [c.shape for c in columns]
        raise ShapeError("Expression.function", shapes, "expected a column, not a row, a matrix or nothing")
    return ca.densify(ca.vertcat(*columns))
