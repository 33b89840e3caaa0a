"""A point of a frame stays in a box."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca

from wbc import validation
from wbc.robot import Robot
from wbc.symbolic.kinematics import WORLD
from wbc.symbolic.tracer import Tracer
from wbc.tasks._limits import checked_limits, limit_inputs, limit_margins, limit_rows
from wbc.tasks._stereographic import Triple
from wbc.tasks.base import Constraint, Input, Row, Values
from wbc.tasks.frames import point_in, point_rows


@dataclass(frozen=True)
class WorkspaceBox(Constraint):
    """A point x of a frame (R, p) stays in a box, as seen from a reference frame b:

        h = (x - lower, upper - x) >= 0,    x = R_b' (p + R offset - p_b)      [m]

    An infinite bound costs a row and never binds; equal bounds are an equality.

    Attributes:
        frame: name of the frame that carries the point.
        lower, upper: first values of the inputs; one number serves all three axes. None: no rows of this bound.
        relative_to: reference frame b, ``"world"``, a frame of the robot or a moving frame; the box is fixed to it.
        offset: the point in ``frame`` [m].

    Inputs:
        lower, upper: three numbers each in the axes of the reference [m]; -inf in ``lower`` and inf in ``upper`` are no
            limit. lower > upper is refused; ``controller["box"].set(lower=..., upper=...)`` moves both.
        lower_rate, upper_rate: velocities of the walls [m/s]. Default 0.

    What it cannot do: guard the body around the point (``Obstacle`` does), or have walls in other directions than the
    axes of the reference (``WorkspacePolyhedron`` has).

    Example:
        >>> import wbc
        >>> robot = wbc.robots.load("panda")
        >>> stack = wbc.Stack(robot, dt=0.005)
        >>> stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
        >>> cell = wbc.tasks.WorkspaceBox("panda_hand_tcp", lower=(0.2, -0.4, 0.05), upper=(0.7, 0.4, float("inf")))
        >>> stack.add(cell, name="cell")
        >>> stack.add(wbc.tasks.JointLimits())
        >>> controller = stack.compile(backend="vm")
        >>> controller["cell"].set(lower=(0.3, -0.2, 0.1), upper=(0.6, 0.2, 0.8))

    Raises:
        BoundsError: lower > upper. UnknownNameError, ShapeError, NotFiniteError: a bad field.
        RangeError: no joint moves the frame against the reference.
    """

    frame_fields: ClassVar[tuple[str, ...]] = ("frame", "relative_to")

    initial_only: ClassVar[tuple[str, ...]] = ("lower", "upper")

    frame: str
    lower: float | Triple | None = None
    upper: float | Triple | None = None
    relative_to: str = WORLD
    offset: Triple = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        lower, upper = checked_limits("WorkspaceBox", self.lower, self.upper, 3)
        object.__setattr__(self, "lower", lower)
        object.__setattr__(self, "upper", upper)
        offset = validation.real_array("WorkspaceBox.offset", self.offset, (3,))
        object.__setattr__(self, "offset", tuple(offset.tolist()))

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return limit_inputs(self.lower, self.upper, ("m",) * 3)

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return limit_rows(self.lower, self.upper, point_rows())

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return limit_margins(point_in(kin, self.frame, self.offset, self.relative_to), inputs)

    def declaration(self, robot: Robot) -> dict[str, Any]:
        """Which bounds there are, not their first values."""
        return super().declaration(robot) | {"sides": [self.lower is not None, self.upper is not None]}
