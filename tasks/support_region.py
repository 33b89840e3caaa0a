"""The centre of mass stays where the contacts can hold the robot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

from wbc import validation
from wbc.robot import Robot
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Constraint, Input, Row, Values
from wbc.tasks.center_of_mass import CenterOfMass

#: Distance of a plane that is none [m]
FAR = 1e3


@dataclass(frozen=True)
class SupportRegion(Constraint):
    """The centre of mass c stays on the allowed side of planes along gravity, the edges of the region over which its
    contacts can hold the robot at rest:

        h_i = offset_i - n_i' c >= 0        [m]

    ``wbc.support.region`` computes planes for the contacts of a stack, with their friction and, if wished, the torque
    limits, in some milliseconds, beside the ticks (docs/torque.md). In a stack that commands accelerations or torques
    the rows keep dh/dt + rate h at or above 0: with ``rate`` = omega of the pendulum, n_i'(c + (dc/dt) / omega) <=
    offset_i, so the capture point stays within as well.

    Attributes:
        planes: how many at most, 3 or more.

    Inputs:
        normals: unit vectors n_i in the world, outwards, one after the other; zero: no plane.
        offsets: how far each plane is from the origin of the world along its normal [m].

    What it cannot do: update itself: the region is that of the contacts when it was computed, and with torque limits
    that of the configuration. It is about rest. Planes that leave no point between them make rows give way.

    Example:
        >>> import wbc
        >>> from wbc.support import region
        >>> robot = wbc.robots.load("talos")
        >>> stack = wbc.Stack(robot, dt=0.002)
        >>> for side in ("left", "right"):
        ...     foot = wbc.tasks.SurfaceContact(f"{side}_sole_link", half_lengths=(0.1, 0.06))
        ...     stack.add(foot, name=f"{side} foot")
        >>> stack.add(wbc.tasks.TorqueLimits()).add(wbc.tasks.Posture())
        >>> stack.add(wbc.tasks.SupportRegion(planes=12), name="balance")
        >>> controller = stack.compile(command="torque", backend="vm")
        >>> controller.reset(robot.neutral)
        >>> controller["balance"].set(**region(controller, robot.neutral).planes(12, inset=0.01))
        >>> controller["balance"].rate = 3.5              # omega: the capture point stays within as well

    Raises:
        RangeError: fewer planes; in :meth:`validate`: a robot without mass.
    """

    stands_in_world: ClassVar[bool] = False

    planes: int = 12

    def __post_init__(self) -> None:
        object.__setattr__(self, "planes", validation.integer("SupportRegion.planes", self.planes, 3))

    def validate(self, robot: Robot) -> None:
        CenterOfMass().validate(robot)

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return (
            Input("normals", size=3 * self.planes, default=np.zeros(3 * self.planes)),
            Input("offsets", unit="m", size=self.planes, default=np.full(self.planes, FAR)),
        )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return tuple(Row(f"edge {k}", "m") for k in range(1, self.planes + 1))

    def margins(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        normals = ca.reshape(inputs["normals"], 3, self.planes)
        return ca.SX(inputs["offsets"] - normals.T @ kin.center_of_mass())
