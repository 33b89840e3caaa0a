"""Two hands that carry one object: the pose of one as seen from the other, about a point of the object."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.symbolic import rotations as rot
from wbc.symbolic.kinematics import Pose
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Input, Row, Task, Values
from wbc.tasks.frames import checked_weights, frame_pose, into_axes, point_rows, require_motion, weights_of_rows

if TYPE_CHECKING:
    from wbc.robot import Robot

KINDS = ("pose", "position", "orientation")
MIDWAY = "midway"


@dataclass(frozen=True)
class RelativePose(Task):
    """Frame b keeps a pose (R_t, p_t) as seen from frame a, measured at a point ``at`` of the object between them:

        e = [ R_x' (c_b - c_a)         c_a = p_a + R_a at                      [m]
              R_x' R_a phi ]           c_b = p_b + R_b R_t' (at - p_t)         [m]
                                       phi = log3(R_a' R_b R_t')               [rad]

    c_a and c_b are one point of the object as either hand holds it: they are the same point when the grasp is as
    wanted. R_x are the axes of the rows, by default midway between the object as a holds it and as b holds it,
    R_x = R_a exp(phi / 2). In these axes neither hand is preferred: with frames exchanged and target and point written
    from the other hand, e becomes -R_t' e. Translation of the point and rotation about it are decoupled: the position
    row turns nothing, and the rotation rows leave the point where it is.

    ``kind="position"`` is a ball joint at the point, with the hands free to turn about it; ``"orientation"`` lets the
    hands slide against each other without turning.

    Inputs:
        target: pose of b as seen from a; for every kind, since the point needs it. Default: the present one.
        feedforward: twist of the target (linear; angular) in the axes of a [m/s, rad/s]. Default 0.
        at: the point, 3 numbers in a's frame [m]. Default: ``at`` of the constructor; without it the middle between
            both frames at the first step.

    Example:
        >>> RelativePose("left_gripper", "right_gripper", at=(0.0, -0.2, 0.0))     # where the cup stands on the tray

    What it cannot do: it is a task, with a weight; it knows no forces, so it does not squeeze. It says nothing about
    where the object goes: see the page for two tasks that move it. At a relative rotation error of exactly pi the
    direction of turning is ambiguous, and midway axes jump there.

    Attributes:
        frame_a, frame_b: names of the two frames.
        kind: which rows: ``pose`` (6), ``position`` (3) or ``orientation`` (3).
        at: first value of the input, or None.
        axes: ``"midway"``, ``"world"`` or a frame's name: along which axes rows and weights are counted.
        weights: one number >= 0 a row, None: 1 each.

    Raises:
        UnknownNameError, ShapeError, NotFiniteError: on construction or in :meth:`validate`.
        RangeError: no joint moves the two frames against each other, or a negative weight.
    """

    stands_in_world: ClassVar[bool] = False

    initial_only: ClassVar[tuple[str, ...]] = ("gain", "at")

    frame_a: str
    frame_b: str
    kind: Literal["pose", "position", "orientation"] = "pose"
    at: tuple[float, float, float] | None = None
    axes: str = MIDWAY
    weights: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        validation.one_of("RelativePose.kind", self.kind, KINDS)
        object.__setattr__(self, "weights", checked_weights("RelativePose.weights", self.weights, self._count))
        if self.at is not None:
            point = validation.real_array("RelativePose.at", self.at, (3,))
            object.__setattr__(self, "at", tuple(float(x) for x in point))

    @property
    def _count(self) -> int:
        return 6 if self.kind == "pose" else 3

    def validate(self, robot: Robot) -> None:
        """Check frames and axes, see :meth:`Item.validate`."""
        robot.check_frame("RelativePose.frame_a", self.frame_a)
        robot.check_frame("RelativePose.frame_b", self.frame_b)
        require_motion(robot, "RelativePose.frame_b", self.frame_b, self.frame_a)
        validation.one_of("RelativePose.axes", self.axes, (MIDWAY, *robot.frame_names))

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        """``target``, ``feedforward`` and ``at``, see the class."""
        return (
            Input("target", "pose", unit="m", rate="feedforward"),
            Input("feedforward", unit="m/s, rad/s", size=6, default=np.zeros(6)),
            Input("at", unit="m", size=3, default=self.at),
        )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        """x, y, z [m] and rx, ry, rz [rad], or one of the two."""
        turning = tuple(Row(f"r{label}", "rad") for label in "xyz")
        return {"pose": point_rows() + turning, "position": point_rows(), "orientation": turning}[self.kind]

    def row_weights(self, robot: Robot) -> NDArray[np.float64]:
        """The declared weights."""
        return weights_of_rows(self.weights, self._count)

    def initial(self, robot: Robot, q: NDArray[np.float64]) -> dict[str, Any]:
        """The target where the frames are at ``q``, and the point in the middle between them."""
        pose = frame_pose(robot, self.frame_a, q).actInv(frame_pose(robot, self.frame_b, q))
        return {"target": pose, "at": pose.translation / 2 if self.at is None else np.array(self.at)}

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        """The formula of the class."""
        target: Pose = inputs["target"]
        parts: list[ca.SX] = []
        if self.kind != "position" or self.axes == MIDWAY:
            phi = kin.rotation_error(self.frame_b, self.frame_a, target.rotation)
        if self.kind != "orientation":
            a, b, at = kin.pose(self.frame_a), kin.pose(self.frame_b), inputs["at"]
            seen = b.point(target.inverse_point(at))
            if self.axes == MIDWAY:
                half = rot.from_quaternion(rot.exp3(phi / 2))
                parts.append(half.T @ (a.inverse_point(seen) - at))
            elif self.axes == self.frame_a:
                parts.append(a.inverse_point(seen) - at)
            else:
                parts.append(into_axes(kin, seen - a.point(at), self.axes))
        if self.kind != "position":
            # phi is the axis of its own rotation, so it has the same components in a's axes and midway
            own = self.axes in (MIDWAY, self.frame_a)
            parts.append(phi if own else into_axes(kin, kin.rotation(self.frame_a) @ phi, self.axes))
        return ca.vertcat(*parts)
