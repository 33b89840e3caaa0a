"""What drives can do that move several joints together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.robot import Robot
from wbc.robot.transmission import Transmission
from wbc.symbolic.tracer import Tracer
from wbc.tasks._limits import checked_limits
from wbc.tasks._selection import joint_dofs
from wbc.tasks.base import Command, Constraint, Input, Row, Rows, SacrificeOrder, Torques, Values


@dataclass(frozen=True)
class DriveTorqueLimits(Constraint):
    """Torques of drives that move joints by a constant matrix, rates dd/dt = C dq/dt: a differential wrist, a belt that
    keeps a link parallel, a tendon over two joints:

        -scale T <= C'^-1 tau <= scale T      [N m, N]

    with the torques tau of the joints as in ``TorqueLimits``; by virtual work tau = C' tau_d. They never give way. Only
    a stack that commands torques can have them. ``transmission.inverse.T @ step.torque[...]`` is what the drives are to
    give.

    Attributes:
        transmission: joints and drives.
        torque: first value of the input, one number or one a drive.

    Inputs:
        scale: shrinks the limits, from 0 to 1.
        torque: T, one number a drive [N m, N].

    What it cannot do: know the inertia of the drives' rotors. ``TorqueLimits`` of the same joints are limits of their
    own; in a tick that has no answer those of the drives count. Speeds of drives are limited by a ``Limit`` on a
    ``JointCoupling``.

    Example:
        >>> import wbc
        >>> from wbc.robot.transmission import Transmission
        >>> wrist = Transmission(
        ...     ("panda_joint6", "panda_joint7"),
        ...     {
        ...         "left": {"panda_joint6": 1.0, "panda_joint7": 1.0},
        ...         "right": {"panda_joint6": 1.0, "panda_joint7": -1.0},
        ...     },
        ... )
        >>> stack = wbc.Stack(wbc.robots.load("panda"), dt=0.001)
        >>> stack.add(wbc.tasks.DriveTorqueLimits(wrist, torque=5.0), name="wrist")
        >>> stack.add(wbc.tasks.Posture())

    Raises:
        ShapeError, NotFiniteError, BoundsError: on construction. UnknownNameError: no such joint. RangeError: a joint
            that follows another, or one of several degrees of freedom, in :meth:`validate`.
    """

    order: ClassVar[SacrificeOrder] = SacrificeOrder.ACTUATOR
    stands_in_world: ClassVar[bool] = False

    transmission: Transmission
    torque: float | tuple[float, ...]

    def __post_init__(self) -> None:
        validation.instance("DriveTorqueLimits.transmission", self.transmission, Transmission, "a Transmission")
        count = len(self.transmission.drives)
        validation.real_array("DriveTorqueLimits.torque", self.torque, finite=False)
        object.__setattr__(self, "torque", checked_limits("DriveTorqueLimits.torque", 0.0, self.torque, count)[1])

    def validate(self, robot: Robot) -> None:
        field, followers = "DriveTorqueLimits.transmission", {c.follower for c in robot.couplings}
        dofs = joint_dofs(robot, field, self.transmission.joints)
        if len(dofs) != len(self.transmission.joints):
            raise RangeError(field, self.transmission.joints, "expected joints of one degree of freedom each")
        for name, i in zip(self.transmission.joints, self.dofs(robot), strict=True):
            if i in followers:
                raise RangeError(field, name, "this joint follows another: its leader has the motor")
            if i in robot.unactuated:
                raise RangeError(field, name, "no motor drives this joint")

    def refusal(self, robot: Robot, command: Command) -> str:
        return "" if command == "torque" else 'limits torques: compile with command="torque"'

    def dofs(self, robot: Robot) -> tuple[int, ...]:
        """Degrees of freedom of the joints, in their order."""
        model = robot.model
        return tuple(int(model.idx_vs[model.getJointId(name)]) for name in self.transmission.joints)

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        count = len(self.transmission.drives)
        most = np.broadcast_to(np.array(self.torque, dtype=float), count).copy()
        return (
            Input("scale", default=1.0, low=0.0, high=1.0),
            Input("torque", unit="N m, N", size=count, default=most, low=0.0, infinite=np.inf, each=True),
        )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        most = np.broadcast_to(np.array(self.torque, dtype=float), len(self.transmission.drives))
        sizes = np.where(np.isfinite(most), np.maximum(most, 1e-3), 1.0)
        drives = zip(self.transmission.drives, sizes, strict=True)
        return tuple(Row(name, "N m", float(size)) for name, size in drives)

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows | None:
        return None

    def torque_rows(self, robot: Robot, inputs: Values, dt: ca.SX) -> Torques:
        most = inputs["scale"] * inputs["torque"]
        return Torques(self.dofs(robot), -most, most, self.transmission.inverse.T)
