"""An axis through a point of a frame points at a target point."""

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
from wbc.tasks._pointing import checked_around, checked_axis, row_axes, shortest_turn
from wbc.tasks._stereographic import INNER, Triple, fade, square, triple
from wbc.tasks.base import Input, Row, Task, Values
from wbc.tasks.frames import frame_pose


@dataclass(frozen=True)
class LookAt(Task):
    """The axis a through a point c of a frame (a camera) points at a point t given in a reference frame b:

        e = F' R' theta n            theta = angle from d to a, n = d x a / |d x a|                [rad]
                                     d = (t - c) / r, r = |t - c|, c = p + R offset                [m]

    theta n is the shortest turn that takes the line of sight d to the axis, F = (b1, b2) two unit vectors of the frame
    perpendicular to a. theta falls exactly like exp(-gain t); the turn about the axis and the distance r are free:

        F' R' (w - d x dd/dt) = -gain e,         d x dd/dt = d x (dt/dt - dc/dt) / r.

    From theta = pi (to within 1e-9 rad) it turns about ``around``. The weight fades where the target comes to the
    camera: 1 from r = ``width`` L on, 0 below a tenth of that; L is the robot's characteristic length.

    Attributes:
        frame: name of the frame that carries the camera.
        offset: the point c in that frame [m].
        width: distance below which the rows fade, as a part of the robot's characteristic length.
        others: as in :class:`wbc.tasks.AxisAlign`.

    Inputs:
        target: t, 3 numbers in the reference [m]. Default: the point on the axis at L from c, at the first step.
        feedforward: rate of t in the axes of the reference [m/s]. Default 0.

    What it cannot do: see an obstacle in the line of sight, limit the angle (``GazeCone``), or keep a distance
    (``Distance``) or a horizon (a second ``AxisAlign``).

    Example:
        >>> import wbc
        >>> robot = wbc.robots.load("talos")
        >>> stack = wbc.Stack(robot, dt=0.002)
        >>> camera = wbc.tasks.LookAt("rgbd_rgb_optical_frame", axis=(0, 0, 1), relative_to="gripper_left_base_link")
        >>> stack.add(camera, name="watch the hand")
        >>> controller = stack.compile(backend="vm")
        >>> controller["watch the hand"].target = (0, 0, 0)

    Raises:
        UnknownNameError, ShapeError, NotFiniteError, RangeError: on construction or in :meth:`validate`.
    """

    frame_fields: ClassVar[tuple[str, ...]] = ("frame", "relative_to")

    frame: str
    axis: Triple = (0.0, 0.0, 1.0)
    offset: Triple = (0.0, 0.0, 0.0)
    relative_to: str = WORLD
    around: Triple | None = None
    width: float = 0.05

    def __post_init__(self) -> None:
        object.__setattr__(self, "axis", checked_axis("LookAt.axis", self.axis))
        object.__setattr__(self, "around", checked_around("LookAt.around", self.around, self.axis))
        object.__setattr__(self, "offset", triple(validation.real_array("LookAt.offset", self.offset, (3,))))
        validation.own_scalars(self, "width", low=0.0, open_low=True, high=1.0)

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return (
            Input("target", unit="m", size=3, rate="feedforward"),
            Input("feedforward", unit="m/s", size=3, default=np.zeros(3)),
        )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return (Row("r1", "rad"), Row("r2", "rad"))

    def initial(self, robot: Robot, q: NDArray[np.float64]) -> dict[str, Any]:
        ahead = np.array(self.offset) + robot.characteristic_length * np.array(self.axis)
        return {"target": frame_pose(robot, self.relative_to, q).actInv(frame_pose(robot, self.frame, q)).act(ahead)}

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        axes = kin.rotation(self.frame) @ rot.constant(row_axes(self.axis, self.around))
        away = self._away(kin, inputs["target"])
        here, sight = kin.held(axes), kin.held(away)
        # Where the rows are off, r is continued by its value there
        off = INNER * self.width * robot.characteristic_length
        distance = ca.sqrt(ca.fmax(square(sight), off * off))
        direction = here.T @ (sight / distance)
        swept = ca.cross(direction, here.T @ ((away - sight) / distance))
        turn = shortest_turn(direction)
        return turn + kin.across(self.frame, WORLD, axes, turn) - swept[:2]

    def jacobian(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return kin.jacobian(self.error(robot, kin, inputs))

    def row_factor(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        away = self._away(kin, inputs["target"])
        return ca.repmat(fade(square(away), self.width * robot.characteristic_length), 2, 1)

    def _away(self, kin: Tracer, target: ca.SX) -> ca.SX:
        """t - c in the world [m]."""
        return kin.pose(self.relative_to).point(target) - kin.pose(self.frame).point(rot.constant(self.offset))
