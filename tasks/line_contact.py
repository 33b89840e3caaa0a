"""An edge that lies on a surface: toes, the rim of a gripper, a blade."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from wbc.robot import Robot
from wbc.symbolic.tracer import Tracer
from wbc.tasks._contact import Cone, Contact, Pressing, checked_positive, force_row
from wbc.tasks._pointing import shortest_turn
from wbc.tasks.base import Row, Rows, Values


@dataclass(frozen=True)
class LineContact(Pressing, Contact):
    """A segment along the x axis of a frame, of length 2 X about its origin, does not move, but the frame may turn
    about it; z is the normal of the surface, out of it and towards the robot:

        J_lin v = -gain (p - p_target)                                                           [m/s]
        (J_ang v)_y,z = -gain (theta n)_y,z         in the axes of the frame                     [rad/s]

    theta n is the shortest turn of the x axis from that of the target. The wrench (f_x, f_y, f_z, m_y, m_z), in the
    axes of the frame and about its origin, is that of forces at both ends within friction pyramids:

        least <= f_z <= most,   |f_x| <= mu f_z,   |m_y| <= X f_z                                [N; N m]
        |X f_y + m_z| <= mu (X f_z - m_y),   |X f_y - m_z| <= mu (X f_z + m_y)                   [N m]

    mu = friction / sqrt(2), so that the pyramids are within Coulomb's cones.

    Attributes:
        half_length: X [m].
        others: as in :class:`wbc.tasks.SurfaceContact`.

    Inputs:
        others: as in :class:`wbc.tasks.SurfaceContact`.

    What it cannot do: follow the surface: where the frame turns about the edge its cone turns with it. It does not know
    whether the surface is there.

    Example:
        >>> import wbc
        >>> stack = wbc.Stack(wbc.robots.load("talos"), dt=0.002)
        >>> stack.add(wbc.tasks.SurfaceContact("left_sole_link", half_lengths=(0.1, 0.06)), name="left foot")
        >>> stack.add(wbc.tasks.LineContact("right_sole_link", half_length=0.1), name="right edge")
        >>> stack.add(wbc.tasks.CenterOfMass()).add(wbc.tasks.Posture())

    Raises:
        UnknownNameError, ShapeError, NotFiniteError, RangeError: on construction or in :meth:`validate`.
    """

    axes: ClassVar[tuple[int, ...]] = (0, 1, 2, 4, 5)

    half_length: float
    friction: float = 0.5
    least: float = 0.0
    most: float = math.inf

    def __post_init__(self) -> None:
        object.__setattr__(self, "half_length", checked_positive("LineContact.half_length", self.half_length, "m"))
        super().__post_init__()

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return (*(Row(axis, "m/s") for axis in "xyz"), Row("ry", "rad/s"), Row("rz", "rad/s"))

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows:
        pose, jacobian = kin.pose(self.frame), kin.frame_jacobian(self.frame)
        wanted = -inputs["gain"] * self.residual(robot, kin, inputs)
        matrix = ca.vertcat(jacobian[:3, :], (pose.rotation.T @ jacobian[3:, :])[1:, :])
        return Rows(matrix, wanted, wanted)

    def residual(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        pose, target = kin.pose(self.frame), inputs["target"]
        # y, z, x in place of x, y, z: the turn is that of the third axis
        seen = (pose.rotation.T @ target.rotation[:, 0])[[1, 2, 0]]
        return ca.vertcat(pose.position - target.position, shortest_turn(seen))

    def still(self, inputs: Values, rotation: ca.SX, twist: ca.SX) -> ca.SX:
        """The rate of R'w is R' dw/dt, so both are taken alike."""
        return ca.vertcat(twist[:3], (rotation.T @ twist[3:])[1:])

    def cone_rows(self, robot: Robot) -> tuple[Row, ...]:
        plain = [force_row(robot, name) for name in ("normal", "friction +x", "friction -x")]
        moments = ["pressure -", "pressure +", *[f"end {k}" for k in range(1, 5)]]
        return (*plain, *[force_row(robot, name, "N m") for name in moments])

    def cone(self, inputs: Values) -> Cone:
        mu, X = inputs["friction"] / math.sqrt(2.0), self.half_length
        rows = [ca.horzcat(0, 0, 1, 0, 0)]
        rows += [ca.horzcat(-s, 0, mu, 0, 0) for s in (1, -1)]
        rows += [ca.horzcat(0, 0, X, -s, 0) for s in (1, -1)]
        for end in (1, -1):
            # the end at end X bears f_y + end m_z / X and f_z - end m_y / X, times 2
            rows += [ca.horzcat(0, -s * X, mu * X, -end * mu, -s * end) for s in (1, -1)]
        lower = ca.vertcat(inputs["least"], ca.SX.zeros(8))
        return Cone(ca.sparsify(ca.SX(ca.vertcat(*rows))), lower, ca.vertcat(inputs["most"], ca.SX.inf(8)))
