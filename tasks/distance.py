"""The distance between two points follows a length."""

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
from wbc.tasks._nearest import distance
from wbc.tasks._stereographic import Triple, triple
from wbc.tasks.base import Input, Row, Task, Values
from wbc.tasks.frames import frame_pose


@dataclass(frozen=True)
class Distance(Task):
    """The distance of two points, of a frame (R, p) and of another frame (R_b, p_b) or the world, follows a length:

        e = |p + R offset - (p_b + R_b point)| - target                                            [m]

    Everything else is free: the hand may go anywhere on a sphere round the point. Where the points coincide to within
    1e-10 m they part along the z axis of the other frame.

    Attributes:
        frame: name of the frame of the first point.
        other: frame b of the second point; ``"world"`` or a frame of the robot, which may move.
        offset: the first point in its frame [m].
        point: first value of the input ``point`` [m].

    Inputs:
        target: the distance, >= 0 [m]. Default: what it is at the first step.
        feedforward: rate of the target [m/s]. Default 0.
        point: the point of the other frame [m].
        point_velocity: its rate in the axes of the other frame [m/s]. Default 0.

    What it cannot do: keep two bodies apart (``Obstacle`` does). To bring two points together command a position
    (``EndEffector`` with ``relative_to``): with a target of 0 a tick oversteps in a stack that is not ``calm``.

    Example:
        >>> import wbc
        >>> robot = wbc.robots.load("panda")
        >>> stack = wbc.Stack(robot, dt=0.005)
        >>> stack.add(wbc.tasks.Distance("panda_hand_tcp", point=(0.6, 0.0, 0.4)), name="range")
        >>> stack.add(wbc.tasks.LookAt("panda_hand_tcp"), name="sight")
        >>> controller = stack.compile(backend="vm")
        >>> controller["range"].target = 0.3
        >>> controller["sight"].target = (0.6, 0.0, 0.4)

    Raises:
        UnknownNameError, ShapeError, NotFiniteError, RangeError: on construction or in :meth:`validate`.
    """

    frame_fields: ClassVar[tuple[str, ...]] = ("frame", "other")

    initial_only: ClassVar[tuple[str, ...]] = ("gain", "point")

    frame: str
    other: str = WORLD
    offset: Triple = (0.0, 0.0, 0.0)
    point: Triple = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("offset", "point"):
            given = validation.real_array(f"Distance.{name}", getattr(self, name), (3,))
            object.__setattr__(self, name, triple(given))

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return (
            Input("target", unit="m", rate="feedforward", low=0.0),
            Input("feedforward", unit="m/s", default=0.0),
            Input("point", unit="m", size=3, default=np.array(self.point), rate="point_velocity"),
            Input("point_velocity", unit="m/s", size=3, default=np.zeros(3)),
        )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return (Row("distance", "m"),)

    def initial(self, robot: Robot, q: NDArray[np.float64]) -> dict[str, Any]:
        relative = frame_pose(robot, self.other, q).actInv(frame_pose(robot, self.frame, q))
        return {"target": float(np.linalg.norm(relative.act(np.array(self.offset)) - np.array(self.point)))}

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        here = kin.pose(self.frame).point(rot.constant(self.offset))
        between = kin.pose(self.other).inverse_point(here) - inputs["point"]
        return ca.SX(distance(between) - inputs["target"])
