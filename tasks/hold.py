"""A frame that must not move: a hand on a hold, a foot on the ground."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.quick_dataclasses import dataclass
from wbc.robot import Robot
from wbc.symbolic import rotations as rot
from wbc.symbolic.tracer import Tracer
from wbc.tasks._pointing import shortest_turn
from wbc.tasks.base import Constraint, Input, Row, Rows, SacrificeOrder, Values
from wbc.tasks.frames import frame_pose

HELD_KINDS = ("pose", "position", "orientation", "axis", "roll")
#: Least square of the part of the x axis across the target's z axis that counts for ``roll``
UPRIGHT = 1e-12


@dataclass(frozen=True)
class Hold(Constraint):
    """A frame does not move (a thing to grasp is a ``wbc.climb.Foothold``), and drift from its target decays like
    exp(-gain t): the equality J v = -gain e, with

        position     J = J_lin (3 x nv), e = p - p_target                             [m/s]
        orientation  J = J_ang (3 x nv), e = log3(R R_target'), |e| <= pi             [rad/s]
        pose         both, in this order (6 x nv)
        axis         J = [J_lin; F'R' J_ang] (5 x nv), e = (p - p_target, F'R' theta n), F = (x, y) of the frame:
                     theta n is the shortest turn of the frame's z axis to the target's; the turn about z is free
        roll         J = [J_lin; de/dq] (4 x nv), e = (p - p_target, atan2(x'Y, x'X)), x of the frame, X and Y of the
                     target: the turn about the target's z axis is held, z itself may tilt by less than pi / 2

    All in world axes at the frame's origin, but for the last rows of ``axis`` and ``roll``. Second-order motion within
    a tick is made up for (docs/reach.md).

    Attributes:
        frame: name of the frame.
        kind: ``"pose"``, ``"position"`` (the frame may turn about its origin), ``"orientation"``, ``"axis"`` (the
            frame may turn about its z axis: a hand round a bar, a pin in its hole) or ``"roll"`` (it may tilt, but not
            turn about the target's z axis; ``AxisCone`` bounds the tilt: a keyed ball).
        gain: initial value of the input [1/s].

    Inputs:
        target: pose in the world [m, rad]; of kind ``position`` 3 numbers [m], or ``orientation`` a 3x3 matrix or a
            quaternion x, y, z, w, will do. Default: the pose at the first step.
        gain: how fast drift decays [1/s], to stay below 1/dt; 0 leaves it as it is.

    What it cannot do: hold what the robot cannot do: six rows on an arm with fewer free joints, or in a singular pose,
    may contradict. A frame that moves stops as fast as ``JointLimits`` lets it. There are no contact forces, friction
    or slip.

    Example:
        >>> import wbc
        >>> stack = wbc.Stack(wbc.robots.load("talos"), dt=0.002)
        >>> stack.add(wbc.tasks.Hold("left_sole_link"), name="left foot")
        >>> stack.add(wbc.tasks.Hold("right_sole_link", "position"), name="right foot")
    """

    frame_fields: ClassVar[tuple[str, ...]] = ("frame",)

    order: ClassVar[SacrificeOrder] = SacrificeOrder.HOLD
    equality: ClassVar[bool] = True
    initial_only: ClassVar[tuple[str, ...]] = ("gain",)

    frame: str
    kind: Literal["pose", "position", "orientation", "axis", "roll"] = "pose"
    gain: float = 10.0

    def __post_init__(self) -> None:
        validation.one_of("Hold.kind", self.kind, HELD_KINDS)
        validation.own_scalars(self, "gain", low=0.0, unit="1/s")

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        part = self.kind if self.kind in ("position", "orientation") else ""
        target = Input("target", "pose", unit="m, rad", part=part)
        return (target, Input("gain", unit="1/s", default=self.gain, low=0.0))

    def initial(self, robot: Robot, q: NDArray[np.float64]) -> dict[str, Any]:
        return {"target": frame_pose(robot, self.frame, q)}

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        position = tuple(Row(axis, "m/s") for axis in ("x", "y", "z"))
        orientation = tuple(Row(axis, "rad/s") for axis in ("rx", "ry", "rz"))
        rows = {"pose": position + orientation, "position": position, "orientation": orientation}
        rows["roll"] = (*position, Row("roll", "rad/s"))
        return rows.get(self.kind, position + orientation[:2])

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows:
        pose, target = kin.pose(self.frame), inputs["target"]
        jacobian = kin.frame_jacobian(self.frame)
        matrix = []
        if self.kind != "orientation":
            matrix.append(jacobian[:3, :])
        if self.kind == "axis":
            matrix.append((pose.rotation.T @ jacobian[3:, :])[:2, :])
        elif self.kind == "roll":
            x, frame = pose.rotation[:, 0], target.rotation
            along, across = ca.dot(x, frame[:, 0]), ca.dot(x, frame[:, 1])
            # d atan2(b, a) = (a db - b da) / (a^2 + b^2), with dx = w x x; x along the target's z axis has no roll
            turn = along * ca.cross(x, frame[:, 1]) - across * ca.cross(x, frame[:, 0])
            matrix.append((turn.T @ jacobian[3:, :]) / ca.fmax(along * along + across * across, UPRIGHT))
        elif self.kind != "position":
            matrix.append(jacobian[3:, :])
        wanted = -inputs["gain"] * self._error(kin, inputs)
        return Rows(ca.vertcat(*matrix), wanted, wanted)

    def residual(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX | None:
        return self._error(kin, inputs)

    def _error(self, kin: Tracer, inputs: Values) -> ca.SX:
        pose, target = kin.pose(self.frame), inputs["target"]
        drift = [] if self.kind == "orientation" else [pose.position - target.position]
        if self.kind == "axis":
            # As seen from the frame, its z axis turns away from where the target's is
            drift.append(shortest_turn(pose.rotation.T @ target.rotation[:, 2]))
        elif self.kind == "roll":
            x, frame = pose.rotation[:, 0], target.rotation
            drift.append(ca.atan2(ca.dot(x, frame[:, 1]), ca.dot(x, frame[:, 0])))
        elif self.kind != "position":
            drift.append(rot.log3(pose.rotation @ target.rotation.T))
        return ca.SX(ca.vertcat(*drift))
