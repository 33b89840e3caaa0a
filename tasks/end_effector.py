"""A frame follows a pose, a position or an orientation."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.quick_dataclasses import dataclass
from wbc.robot import Robot
from wbc.symbolic.kinematics import WORLD
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Input, Row, Task, Values
from wbc.tasks.frames import (
    REFERENCE,
    checked_weights,
    frame_pose,
    into_axes,
    point_rows,
    resolve_axes,
)

KINDS = ("pose", "position", "orientation")


@dataclass(frozen=True)
class EndEffector(Task):
    """A frame (R, p) follows a target (R_t, p_t) given in a reference frame b, the world or another moving frame:

        e = [ R_a' (p - p_d)                      p_d = p_b + R_b p_t         [m]
              R_a' R_d log3(R_d' R) ]             R_d = R_b R_t               [rad]

    The rows are components along the axes of a frame a. Position and rotation are decoupled (R^3 x SO(3)): where
    nothing limits it the position moves on a straight line and the rotation about one axis, both decaying like
    exp(-gain t), as seen from axes a. A hand that follows the other hand takes it as ``relative_to``; ``axes="frame"``
    with weights (1, 1, 1, 1, 1, 0) leaves the turn about the tool's z axis free.

    Attributes:
        frame: name of the frame that moves.
        kind: which rows: ``pose`` (6), ``position`` (3) or ``orientation`` (3).
        relative_to: frame b that the target is given in; ``"world"``, a frame of the robot or a moving frame.
        axes: frame a along whose axes rows and weights are counted: ``"reference"`` (those of b), ``"frame"`` (its
            own), ``"world"`` or a frame's name.
        weights: one number >= 0 a row, None: 1 each.

    Inputs:
        target: ``pose`` kind: ``pin.SE3``, 4x4 matrix or (position, quaternion x, y, z, w) in the reference [m];
            ``position``: 3 numbers [m]; ``orientation``: 3x3 matrix or quaternion x, y, z, w.
            Default: where the frame is at the first step.
        feedforward: rate of the target in the axes of the reference: twist (linear; angular) [m/s, rad/s], its linear
            part alone or its angular part alone. Default 0.

    What it cannot do: plan: a target that jumps is a velocity that jumps, which limits bound and nothing smooths.

    Example:
        >>> import wbc
        >>> robot = wbc.robots.load("panda")
        >>> stack = wbc.Stack(robot, dt=0.005)
        >>> stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
        >>> stack.add(wbc.tasks.EndEffector("panda_hand_tcp", axes="frame", weights=(0, 0, 0, 1, 1, 0)), name="upright")
        >>> controller = stack.compile(backend="vm")
        >>> controller["hand"].target = [0.5, 0.0, 0.4, 1.0, 0.0, 0.0, 0.0]      # position, quaternion x, y, z, w

    Raises:
        UnknownNameError, ShapeError, NotFiniteError, RangeError: on construction or in :meth:`validate`.
    """

    frame_fields: ClassVar[tuple[str, ...]] = ("frame", "relative_to")

    frame: str
    kind: Literal["pose", "position", "orientation"] = "pose"
    relative_to: str = WORLD
    axes: str = REFERENCE
    weights: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        validation.one_of("EndEffector.kind", self.kind, KINDS)
        count = 6 if self.kind == "pose" else 3
        object.__setattr__(self, "weights", checked_weights("EndEffector.weights", self.weights, count))

    def validate(self, robot: Robot) -> None:
        super().validate(robot)
        resolve_axes(robot, "EndEffector.axes", self.axes, self.frame, self.relative_to)

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        if self.kind == "pose":
            return (
                Input("target", "pose", unit="m", rate="feedforward"),
                Input("feedforward", unit="m/s, rad/s", size=6, default=np.zeros(6)),
            )
        if self.kind == "position":
            return (
                Input("target", unit="m", size=3, rate="feedforward"),
                Input("feedforward", unit="m/s", size=3, default=np.zeros(3)),
            )
        return (
            Input("target", "rotation", rate="feedforward"),
            Input("feedforward", unit="rad/s", size=3, default=np.zeros(3)),
        )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        turning = tuple(Row(f"r{label}", "rad") for label in "xyz")
        return {"pose": point_rows() + turning, "position": point_rows(), "orientation": turning}[self.kind]

    def initial(self, robot: Robot, q: NDArray[np.float64]) -> dict[str, Any]:
        pose = frame_pose(robot, self.relative_to, q).actInv(frame_pose(robot, self.frame, q))
        return {"target": {"pose": pose, "position": pose.translation, "orientation": pose.rotation}[self.kind]}

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        axes = resolve_axes(robot, "EndEffector.axes", self.axes, self.frame, self.relative_to)
        target = inputs["target"]
        if self.kind == "position":
            return self._position_error(kin, axes, target)
        if self.kind == "orientation":
            return self._rotation_error(kin, axes, target)
        return ca.vertcat(
            self._position_error(kin, axes, target.position), self._rotation_error(kin, axes, target.rotation)
        )

    def _position_error(self, kin: Tracer, axes: str, target: ca.SX) -> ca.SX:
        base = kin.pose(self.relative_to)
        if axes == self.relative_to:
            return base.inverse_point(kin.position(self.frame)) - target
        return into_axes(kin, kin.position(self.frame) - base.point(target), axes)

    def _rotation_error(self, kin: Tracer, axes: str, target: ca.SX) -> ca.SX:
        phi = kin.rotation_error(self.frame, self.relative_to, target)
        if axes == self.relative_to:
            return phi
        if axes == self.frame:
            # phi is its own image under R_b' R R_t', so R' R_b phi = R_t' phi, which needs no kinematics
            return target.T @ phi
        return into_axes(kin, kin.rotation(self.relative_to) @ phi, axes)
