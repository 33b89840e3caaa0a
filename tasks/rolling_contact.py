"""A wheel that rolls on the ground, and the force that it takes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import RangeError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.symbolic.kinematics import frame_index
from wbc.symbolic.tracer import Tracer
from wbc.tasks._contact import Cone, Contact, Pressing, checked_positive, force_row
from wbc.tasks._stereographic import triple
from wbc.tasks.base import Row, Rows, Values
from wbc.tasks.frames import frame_pose
from wbc.tasks.rolling import FLAT

#: An axis, of length 1, and a centre [m] may be off by this
NEAR = 1e-6


@dataclass(frozen=True)
class RollingContact(Pressing, Contact):
    """A thin wheel, of which a frame has its origin in the centre, rolls on the ground without slip: the point of the
    wheel at c does not move,

        t'u = 0,   s'u = 0,   n'u = -gain n'(c - o),      u = J_lin v + J_ang v x (c - p)              [m/s]

    as in ``Rolling``: n is the normal of the ground and o its origin; a the axis of the wheel and p its centre; d is
    the direction in the plane of the wheel closest to n; c = p - radius d the point of contact, t = a x d where it
    rolls to, s = n x t sideways. The ground's force on the robot at c is

        f_x t + f_y s + f_z n,     least <= f_z <= most,   |f_x|, |f_y| <= mu f_z                        [N]

    with mu = friction / sqrt(2), so that the pyramid is within Coulomb's cone: at most 29 % of a tangential force is
    left out. ``step.forces`` has (f_x, f_y, f_z).

    Attributes:
        frame: name of a frame of the wheel with its origin in the centre.
        radius: from the centre to the ground [m].
        axis: axis of the wheel in the axes of the frame, about which it rolls forwards.
        others: as in :class:`wbc.tasks.SurfaceContact`.

    Inputs:
        target: pose of the ground in the world, of which the plane counts: its origin, and z out of the ground [m,
            rad]. Default: level ground under the wheel at the first step.
        gain: how fast a distance from the ground decays [1/s]. Default 10.
        others: as in :class:`wbc.tasks.SurfaceContact`.

    What it cannot do: have rollers (``Rolling`` has their motion), rolling resistance, or the torque by which a wide
    wheel resists turning on the spot. A wheel that lies flat has no rolling direction; its rows fade.

    Example:
        >>> import wbc
        >>> stack = wbc.Stack(wbc.robots.load("tiago", base="floating", lock=()), dt=0.002)
        >>> stack.add(wbc.tasks.RollingContact("wheel_left_link", radius=0.0985, axis=(0, 0, 1)), name="left wheel")
        >>> stack.add(wbc.tasks.Posture(), name="posture", weight=1e-2)

    Raises:
        UnknownNameError, ShapeError, NotFiniteError, RangeError: on construction or in :meth:`validate`: a frame that
            its joint does not turn about ``axis`` through its origin.
    """

    axes: ClassVar[tuple[int, ...]] = (0, 1, 2)

    radius: float
    axis: tuple[float, float, float] = (0.0, 1.0, 0.0)
    friction: float = 0.5
    least: float = 0.0
    most: float = math.inf

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", checked_positive("RollingContact.radius", self.radius, "m"))
        axis = validation.unit_vector(
            "RollingContact.axis", validation.real_array("RollingContact.axis", self.axis, (3,))
        )
        object.__setattr__(self, "axis", triple(axis))
        super().__post_init__()

    def validate(self, robot: Robot) -> None:
        super().validate(robot)
        joint = robot.model.frames[frame_index(robot.model, self.frame)].parentJoint
        column = _screw(robot, self.frame)
        off = math.inf if column is None else np.abs(column - np.array([0.0, 0.0, 0.0, *self.axis])).max()
        if off > NEAR:
            found = "" if column is None else f"; it turns with (linear; angular) {np.round(column, 6).tolist()}"
            name = str(robot.model.names[joint])
            reason = f"joint {name!r} does not turn {self.frame!r} about this axis through its origin{found}"
            raise RangeError("RollingContact.axis", self.axis, reason)

    def initial(self, robot: Robot, q: NDArray[np.float64]) -> dict[str, Any]:
        pose = frame_pose(robot, self.frame, q)
        axis = pose.rotation @ np.array(self.axis)
        down = np.array([0.0, 0.0, 1.0]) - axis * axis[2]
        pose.translation = pose.translation - self.radius * down / np.sqrt(down @ down + FLAT**2)
        pose.rotation = np.eye(3)
        return {"target": pose}

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return tuple(Row(name, "m/s") for name in ("rolling", "sideways", "contact"))

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows:
        pose, jacobian = kin.pose(self.frame), kin.frame_jacobian(self.frame)
        arm, directions = self._contact(inputs, pose.rotation)
        wanted = -inputs["gain"] * self.residual(robot, kin, inputs)
        point = jacobian[:3, :] - ca.skew(arm) @ jacobian[3:, :]
        return Rows(directions.T @ point, wanted, wanted)

    def residual(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        pose, target = kin.pose(self.frame), inputs["target"]
        point = pose.position + self._contact(inputs, pose.rotation)[0]
        return ca.SX(ca.vertcat(0, 0, ca.dot(target.rotation[:, 2], point - target.position)))

    def still(self, inputs: Values, rotation: ca.SX, twist: ca.SX) -> ca.SX | None:
        """None: the point of contact wanders over the wheel."""
        return None

    def unit_wrenches(self, inputs: Values, rotation: ca.SX, twist: ca.SX) -> ca.SX:
        arm, directions = self._contact(inputs, rotation)
        return ca.vertcat(rotation.T @ directions, rotation.T @ (ca.skew(arm) @ directions)).T

    def _contact(self, inputs: Values, rotation: ca.SX) -> tuple[ca.SX, ca.SX]:
        """c - p, and 3 x 3 with the columns t, s and n."""
        normal, axis = inputs["target"].rotation[:, 2], rotation @ ca.SX(ca.DM(self.axis))
        upright = normal - axis * ca.dot(axis, normal)
        upright = upright / ca.sqrt(ca.dot(upright, upright) + FLAT**2)
        forwards = ca.cross(axis, upright)
        return -self.radius * upright, ca.horzcat(forwards, ca.cross(normal, forwards), normal)

    def cone_rows(self, robot: Robot) -> tuple[Row, ...]:
        return tuple(
            force_row(robot, name) for name in ("normal", *[f"friction {s}" for s in ("+x", "-x", "+y", "-y")])
        )

    def cone(self, inputs: Values) -> Cone:
        mu = inputs["friction"] / math.sqrt(2.0)
        rows = [
            ca.horzcat(0, 0, 1),
            *[ca.horzcat(-s, 0, mu) for s in (1, -1)],
            *[ca.horzcat(0, -s, mu) for s in (1, -1)],
        ]
        lower = ca.vertcat(inputs["least"], ca.SX.zeros(4))
        return Cone(ca.sparsify(ca.SX(ca.vertcat(*rows))), lower, ca.vertcat(inputs["most"], ca.SX.inf(4)))


def _screw(robot: Robot, frame: str) -> NDArray[np.float64] | None:
    """Linear and angular velocity of a frame in its own axes by its joint alone; None: the joint has several."""
    model = robot.model
    index = frame_index(model, frame)
    joint = model.frames[index].parentJoint
    if model.nvs[joint] != 1:
        return None
    jacobian = pin.computeFrameJacobian(model, model.createData(), robot.neutral, index, pin.LOCAL)
    return np.array(jacobian[:, model.idx_vs[joint]])
