"""Lower and upper limits of what a task is about."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import DuplicateNameError, ShapeError
from wbc.robot import Robot
from wbc.symbolic.kinematics import Kinematics
from wbc.symbolic.tracer import Tracer
from wbc.tasks import inputs as run_time
from wbc.tasks._limits import LimitValues, checked_limits, limit_inputs, limit_margins, limit_rows
from wbc.tasks._selection import selection
from wbc.tasks.base import Constraint, Input, Row, Task, Values


@dataclass(frozen=True)
class Limit(Constraint):
    """Rows of a task's error e(q, inputs) stay between two numbers, in place of going to zero:

        h = (e - lower, upper - e) >= 0                                     [the unit of each row]

    e is exactly the error that the task declares, with the task's inputs: with a target of zero it is the quantity
    itself, with the default target its change since the first step. Rows: ``label.lower`` of each selected row, then
    ``label.upper``. Where the task fades a row by a factor f because its error is singular, the margins fade, too:

        h = (f (e - lower) + (1 - f) c,  f (upper - e) + (1 - f) c),

    c = (upper - lower) / 2, or 1 where there is no other limit. At f = 0 the limit is off, and ``Step.faded`` says so.
    Gain and weights of the task have no effect.

    Attributes:
        task: any task whose rows are the derivative of its error; also one of your own, or an ``Expression``.
        lower, upper: first values of the inputs; one number serves all rows. None: no rows of this limit.
        only: labels of the task's rows that are limited, in this order; None: all.

    Inputs:
        those of the task, and
        lower, upper: one number a selected row; -inf in ``lower`` and inf in ``upper`` are no limit. lower > upper is
            refused; ``controller["..."].set(lower=..., upper=...)`` moves both.
        lower_rate, upper_rate: their rates [unit/s]. Default 0.

    What it cannot do: limit a velocity: tasks with a Jacobian of their own are refused. An error that wraps jumps by a
    turn opposite to its target: give both bounds, away from there. Three rows of a position are a box, not a length.

    Example:
        >>> import wbc
        >>> from wbc.tasks import CenterOfMass, Elbow, Limit
        >>> robot = wbc.robots.load("panda")
        >>> stack = wbc.Stack(robot, dt=0.005)
        >>> stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
        >>> stack.add(Limit(CenterOfMass(), lower=-0.05, upper=0.05, only=("x", "y")), name="balance")
        >>> stack.add(Limit(Elbow("panda_link4"), lower=0.3, only="z"), name="elbow up")
        >>> stack.add(wbc.tasks.JointLimits())
        >>> controller = stack.compile(backend="vm")
        >>> controller["elbow up"].target = (0.0, 0.0, 0.0)        # the height itself, not its change

    Raises:
        ShapeError: no task, a task on velocities, or numbers that do not fit its rows. BoundsError: lower > upper.
        UnknownNameError: no such row. DuplicateNameError: an input of the task has the name of one of these.
        WbcError: what the task says of its own fields.
    """

    initial_only: ClassVar[tuple[str, ...]] = ("lower", "upper")

    task: Task
    lower: LimitValues = None
    upper: LimitValues = None
    only: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.task, Task):
            raise ShapeError("Limit.task", self.task, "expected a task")
        lower, upper = checked_limits("Limit", self.lower, self.upper)
        object.__setattr__(self, "lower", lower)
        object.__setattr__(self, "upper", upper)
        if self.only is not None:
            object.__setattr__(self, "only", selection("Limit.only", self.only))

    def validate(self, robot: Robot) -> None:
        self.task.validate(robot)
        symbols = run_time.symbols(robot, self.task.inputs(robot))
        if self.task.jacobian(robot, Tracer(Kinematics(robot.tree)), symbols.values) is not None:
            raise ShapeError("Limit.task", self.task, "its rows are velocities: it has no error that can be limited")
        labels = [row.label for row in self.task.rows(robot)]
        for label in self.only or ():
            validation.one_of("Limit.only", label, labels)
        count = len(self.only or labels)
        for name in ("lower", "upper"):
            value = getattr(self, name)
            if isinstance(value, tuple) and len(value) != count:
                raise ShapeError(f"Limit.{name}", value, f"expected one number, or {count}: one a row")
        own = [d.name for d in limit_inputs(self.lower, self.upper, ("",) * count)]
        for declared in self.task.inputs(robot):
            if declared.name in own:
                raise DuplicateNameError("Limit.task", declared.name, "an input of the task has the name of a limit's")

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        units = [row.unit for row in self._selected(robot)]
        return (*self.task.inputs(robot), *limit_inputs(self.lower, self.upper, units))

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return limit_rows(self.lower, self.upper, self._selected(robot))

    def initial(self, robot: Robot, q: NDArray[np.float64]) -> dict[str, Any]:
        return self.task.initial(robot, q)

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        factor = self.task.row_factor(robot, kin, inputs)
        error = self._pick(robot, self.task.error(robot, kin, inputs))
        return limit_margins(error, inputs, None if factor is None else self._pick(robot, factor))

    def row_factor(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX | None:
        factor = self.task.row_factor(robot, kin, inputs)
        if factor is None:
            return None
        sides = (self.lower is not None) + (self.upper is not None)
        return ca.vertcat(*[self._pick(robot, factor)] * sides)

    def declaration(self, robot: Robot) -> dict[str, Any]:
        return super().declaration(robot) | {"sides": [self.lower is not None, self.upper is not None]}

    def _numbers(self, robot: Robot) -> list[int]:
        labels = [row.label for row in self.task.rows(robot)]
        return list(range(len(labels))) if self.only is None else [labels.index(label) for label in self.only]

    def _selected(self, robot: Robot) -> tuple[Row, ...]:
        rows = self.task.rows(robot)
        return tuple(rows[k] for k in self._numbers(robot))

    def _pick(self, robot: Robot, column: ca.SX) -> ca.SX:
        return ca.densify(ca.SX(column))[self._numbers(robot)]
