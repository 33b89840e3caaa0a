"""A point of an intermediate body follows a position."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.robot import Robot
from wbc.symbolic import rotations as rot
from wbc.symbolic.kinematics import WORLD
from wbc.symbolic.tracer import Tracer
from wbc.tasks._stereographic import triple
from wbc.tasks.base import Input, Row, Task, Values
from wbc.tasks.frames import (
    checked_weights,
    frame_pose,
    into_axes,
    point_rows,
    resolve_axes,
)


@dataclass(frozen=True)
class Elbow(Task):
    """A point fixed in a frame (R, p) of any body follows a position in the world:

        e = R_a' (p + R offset - target)                                   [m]

    The rows are components along the axes of a frame a.

    Attributes:
        frame: frame of the body.
        offset: the point in that frame [m].
        axes: frame a along whose axes rows and weights are counted: ``"world"``, ``"frame"`` (its own) or a name.
        weights: three numbers >= 0, None: 1 each.

    Inputs:
        target: 3 numbers in the world [m]. Default: where the point is at the first step.
        feedforward: velocity of the target in the world [m/s]. Default 0.

    What it cannot do: command the swivel angle of an arm (``PitchPlane`` does): while the hand is held, only the part
    of e along the elbow's curve can be served.

    Example:
        >>> import wbc
        >>> stack = wbc.Stack(wbc.robots.load("panda"), dt=0.005)
        >>> stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
        >>> stack.add(wbc.tasks.Elbow("panda_link4", offset=(0, 0, 0.05), weights=(0, 0, 1)), name="elbow", weight=1e-2)

    Raises:
        UnknownNameError, ShapeError, NotFiniteError, RangeError: on construction or in :meth:`validate`.
    """

    frame_fields: ClassVar[tuple[str, ...]] = ("frame",)

    frame: str
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    axes: str = WORLD
    weights: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        offset = validation.real_array("Elbow.offset", self.offset, (3,))
        object.__setattr__(self, "offset", triple(offset))
        object.__setattr__(self, "weights", checked_weights("Elbow.weights", self.weights, 3))

    def validate(self, robot: Robot) -> None:
        super().validate(robot)
        resolve_axes(robot, "Elbow.axes", self.axes, self.frame)

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return (
            Input("target", unit="m", size=3, rate="feedforward"),
            Input("feedforward", unit="m/s", size=3, default=np.zeros(3)),
        )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return point_rows()

    def initial(self, robot: Robot, q: NDArray[np.float64]) -> dict[str, Any]:
        return {"target": frame_pose(robot, self.frame, q).act(np.array(self.offset))}

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        axes = resolve_axes(robot, "Elbow.axes", self.axes, self.frame)
        if axes != self.frame:
            point = kin.pose(self.frame).point(rot.constant(self.offset))
            return into_axes(kin, point - inputs["target"], axes)
        # R' (p + R offset - target) without turning the offset forth and back
        return rot.constant(self.offset) - kin.pose(self.frame).inverse_point(inputs["target"])
