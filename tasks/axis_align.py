"""An axis of a frame aligns with a direction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc.robot import Robot
from wbc.symbolic import rotations as rot
from wbc.symbolic.kinematics import WORLD
from wbc.symbolic.tracer import Tracer
from wbc.tasks._pointing import checked_around, checked_axis, row_axes, shortest_turn
from wbc.tasks._stereographic import Triple
from wbc.tasks.base import Input, Row, Task, Values
from wbc.tasks.frames import frame_pose


@dataclass(frozen=True)
class AxisAlign(Task):
    """An axis a, fixed in a frame R, aligns with a direction d given in a reference frame b; the turn about a is free.

        e = F' R' theta n                 theta = angle from d to a, n = d x a / |d x a|           [rad]

    theta n is the shortest turn that takes d to a; F = (b1, b2) are two unit vectors of the frame perpendicular to a.
    The rows are those of the angular velocity across a,

        F' R' (w - w_b - d x dd/dt) = -gain e,

    with w_b that of the reference. Hence theta falls exactly like exp(-gain t) and a moves, as seen from b, on the
    great circle to d, whatever the spin about a does. From theta = pi (to within 1e-9 rad) it turns about ``around``.

    Attributes:
        frame: name of the frame that the axis is fixed in.
        axis: the direction a in that frame, of any length.
        relative_to: frame b that the target is given in; ``"world"``, a frame of the robot or a moving frame.
        around: b1, a direction in the frame; its part along the axis is dropped. None: the coordinate axis of the frame
            that follows the one nearest to ``axis`` (x, y for a z axis).

    Inputs:
        target: d, 3 numbers of any length but 0 in the axes of the reference, kept as a unit vector. Default: where a
            points at the first step.
        feedforward: dd/dt, rate of the unit vector [1/s]; its part along d has no effect. Default 0.

    What it cannot do: choose the turn about the axis, or tell a line's two directions apart: give the nearer one as
    target. A ``Limit`` cannot have it; ``AxisCone`` limits the angle.

    Example:
        >>> import wbc
        >>> robot = wbc.robots.load("panda")
        >>> stack = wbc.Stack(robot, dt=0.005)
        >>> stack.add(wbc.tasks.EndEffector("panda_hand_tcp", kind="position"), name="place")
        >>> stack.add(wbc.tasks.AxisAlign("panda_hand_tcp", axis=(0, 0, 1)), name="down")
        >>> controller = stack.compile(backend="vm")
        >>> controller["down"].target = (0, 0, -1)

    Raises:
        UnknownNameError, ShapeError, NotFiniteError, RangeError: on construction or in :meth:`validate`.
    """

    frame_fields: ClassVar[tuple[str, ...]] = ("frame", "relative_to")

    frame: str
    axis: Triple = (0.0, 0.0, 1.0)
    relative_to: str = WORLD
    around: Triple | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "axis", checked_axis("AxisAlign.axis", self.axis))
        object.__setattr__(self, "around", checked_around("AxisAlign.around", self.around, self.axis))

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return (
            Input("target", unit="1", size=3, rate="feedforward", direction=True),
            Input("feedforward", unit="1/s", size=3, default=np.zeros(3)),
        )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return (Row("r1", "rad"), Row("r2", "rad"))

    def initial(self, robot: Robot, q: NDArray[np.float64]) -> dict[str, Any]:
        turn = frame_pose(robot, self.relative_to, q).rotation.T @ frame_pose(robot, self.frame, q).rotation
        return {"target": turn @ np.array(self.axis)}

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        rotation, target = kin.rotation(self.frame), inputs["target"]
        if self.relative_to != WORLD:
            rotation = kin.rotation(self.relative_to).T @ rotation
        axes = rotation @ rot.constant(row_axes(self.axis, self.around))
        here, direction = kin.held(axes), kin.held(target)
        swept = here[:, :2].T @ ca.cross(direction, target)
        turn = shortest_turn(here.T @ direction)
        return turn + kin.across(self.frame, self.relative_to, axes, turn) - swept

    def jacobian(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return kin.jacobian(self.error(robot, kin, inputs))
