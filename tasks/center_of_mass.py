"""The centre of mass follows a position."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc.errors import RangeError
from wbc.multibody import algebra
from wbc.quick_dataclasses import dataclass
from wbc.robot import Robot
from wbc.symbolic.kinematics import WORLD
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Input, Row, Task, Values
from wbc.tasks.frames import checked_weights, into_axes, point_rows, resolve_axes


@dataclass(frozen=True)
class CenterOfMass(Task):
    """The centre of mass c of the whole robot follows a position in the world:

        e = R_a' (c - target),   c = sum_i m_i c_i / sum_i m_i             [m]

    The rows are components along the axes of a frame a. Links welded to the world have no part in c.

    Attributes:
        axes: frame a along whose axes rows and weights are counted: ``"world"`` or a frame's name.
        weights: three numbers >= 0, None: 1 each.

    Inputs:
        target: 3 numbers in the world [m]. Default: where the centre of mass is at the first step.
        feedforward: velocity of the target in the world [m/s]. Default 0.

    What it cannot do: balance: it knows no support polygon, contact force or momentum. A payload that the description
    lacks is not seen. For a target relative to a foot write an ``Expression``.

    Example:
        >>> import wbc
        >>> stack = wbc.Stack(wbc.robots.load("talos"), dt=0.002)
        >>> stack.add(wbc.tasks.Hold("left_sole_link"), name="left foot")
        >>> stack.add(wbc.tasks.Hold("right_sole_link"), name="right foot")
        >>> stack.add(wbc.tasks.CenterOfMass(weights=(1, 1, 0)), name="balance")

    Raises:
        UnknownNameError, ShapeError, NotFiniteError, RangeError: on construction or in :meth:`validate`; a
            robot without mass is a RangeError.
    """

    axes: str = WORLD
    weights: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "weights", checked_weights("CenterOfMass.weights", self.weights, 3))

    def validate(self, robot: Robot) -> None:
        resolve_axes(robot, "CenterOfMass.axes", self.axes, None)
        mass = sum(float(inertia.mass) for inertia in list(robot.tree.inertias)[1:])
        if mass <= 0.0:
            raise RangeError("CenterOfMass", mass, f"the moving links of {robot.name!r} have no mass [kg]")

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return (
            Input("target", unit="m", size=3, rate="feedforward"),
            Input("feedforward", unit="m/s", size=3, default=np.zeros(3)),
        )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return point_rows()

    def initial(self, robot: Robot, q: NDArray[np.float64]) -> dict[str, Any]:
        tree = robot.tree
        return {"target": np.array(algebra(tree).centerOfMass(tree, tree.createData(), q))}

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        axes = resolve_axes(robot, "CenterOfMass.axes", self.axes, None)
        return into_axes(kin, kin.center_of_mass() - inputs["target"], axes)
