"""Two hands that carry one object: the pose of one as seen from the other, about a point of the object."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.robot import Robot
from wbc.symbolic import rotations as rot
from wbc.symbolic.kinematics import Pose
from wbc.symbolic.tracer import Tracer
from wbc.tasks._stereographic import triple
from wbc.tasks.base import Input, Row, Task, Values
from wbc.tasks.frames import checked_weights, frame_pose, into_axes, point_rows

RELATIVE_KINDS = ("pose", "position", "orientation")
MIDWAY = "midway"


@dataclass(frozen=True)
class RelativePose(Task):
    """Frame b keeps a pose (R_t, p_t) as seen from frame a, measured at a point ``at`` of the object between them:

        e = [ R_x' (c_b - c_a)         c_a = p_a + R_a at                      [m]
              R_x' R_a phi ]           c_b = p_b + R_b R_t' (at - p_t)         [m]
                                       phi = log3(R_a' R_b R_t')               [rad]

    c_a and c_b are one point of the object as either hand holds it: they coincide when the grasp is as wanted. R_x are
    the axes of the rows, by default midway, R_x = R_a exp(phi / 2), so that neither hand is preferred. The gap decays
    on a straight line and the rotation about one axis through the point, each without disturbing the other.

    ``kind="position"`` is a ball joint at the point; ``"orientation"`` lets the hands slide without turning. Where the
    object goes is for other tasks, as in the example. For a hand that works on what the other hand holds
    ``EndEffector(b, relative_to=a)`` is cheaper.

    Attributes:
        frame_a, frame_b: names of the two frames.
        at: first value of the input.
        axes: ``"midway"``, ``"world"`` or a frame's name: along which axes rows and weights are counted.
        others: as in :class:`wbc.tasks.EndEffector`.

    Inputs:
        target: pose of b as seen from a; for every kind, since the point needs it. Default: the present one.
        feedforward: twist of the target (linear; angular) in the axes of a [m/s, rad/s]. Default 0.
        at: the point, 3 numbers in a's frame [m]. Default: ``at`` of the constructor; without it the middle between
            both frames at the first step.

    What it cannot do: squeeze: it is a task with a weight and knows no forces. While the target moves, the point
    stands still in a's frame, not in b's.

    Example:
        >>> import numpy as np
        >>> import pinocchio as pin
        >>> import wbc
        >>> robot = wbc.robots.load("talos", shapes="none")
        >>> data = robot.model.createData()
        >>> pin.framesForwardKinematics(robot.model, data, robot.neutral)
        >>> hands = [data.oMf[robot.model.getFrameId(robot.frames[f"{side}_hand"])] for side in ("left", "right")]
        >>> box = pin.SE3(np.eye(3), (hands[0].translation + hands[1].translation) / 2)
        >>> robot = robot.with_frame("box_left", robot.frames["left_hand"], hands[0].actInv(box))
        >>> robot = robot.with_frame("box_right", robot.frames["right_hand"], hands[1].actInv(box))
        >>> stack = wbc.Stack(robot, dt=0.002)
        >>> stack.add(wbc.tasks.RelativePose("box_left", "box_right", at=(0, 0, 0)), name="grasp", weight=100)
        >>> stack.add(wbc.tasks.EndEffector("box_left"), name="left")
        >>> stack.add(wbc.tasks.EndEffector("box_right"), name="right")

    Raises:
        UnknownNameError, ShapeError, NotFiniteError: on construction or in :meth:`validate`.
        RangeError: no joint moves the two frames against each other, or a negative weight.
    """

    frame_fields: ClassVar[tuple[str, ...]] = ("frame_b", "frame_a")

    stands_in_world: ClassVar[bool] = False

    initial_only: ClassVar[tuple[str, ...]] = ("gain", "at")

    frame_a: str
    frame_b: str
    kind: Literal["pose", "position", "orientation"] = "pose"
    at: tuple[float, float, float] | None = None
    axes: str = MIDWAY
    weights: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        validation.one_of("RelativePose.kind", self.kind, RELATIVE_KINDS)
        object.__setattr__(self, "weights", checked_weights("RelativePose.weights", self.weights, self._count))
        if self.at is not None:
            point = validation.real_array("RelativePose.at", self.at, (3,))
            object.__setattr__(self, "at", triple(point))

    @property
    def _count(self) -> int:
        return 6 if self.kind == "pose" else 3

    def validate(self, robot: Robot) -> None:
        super().validate(robot)
        validation.one_of("RelativePose.axes", self.axes, (MIDWAY, *robot.frame_names))

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return (
            Input("target", "pose", unit="m", rate="feedforward"),
            Input("feedforward", unit="m/s, rad/s", size=6, default=np.zeros(6)),
            Input("at", unit="m", size=3, default=self.at),
        )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        turning = tuple(Row(f"r{label}", "rad") for label in "xyz")
        return {"pose": point_rows() + turning, "position": point_rows(), "orientation": turning}[self.kind]

    def initial(self, robot: Robot, q: NDArray[np.float64]) -> dict[str, Any]:
        pose = frame_pose(robot, self.frame_a, q).actInv(frame_pose(robot, self.frame_b, q))
        return {"target": pose, "at": pose.translation / 2 if self.at is None else np.array(self.at)}

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
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
