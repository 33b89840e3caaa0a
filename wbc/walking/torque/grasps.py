"""A grasp of a hold that leaves the hand its roll."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

from wbc.robot import Robot
from wbc.simulation import GripKind
from wbc.symbolic.tracer import Tracer
from wbc.tasks import Hold, RigidGrasp
from wbc.tasks._contact import Cone
from wbc.tasks.base import Row, Rows, Values


@dataclass(frozen=True)
class AxisGrasp(RigidGrasp):
    """A hand that may roll about its z axis: five rows as of ``Hold(kind="axis")``, and a wrench without m_z within the
    box of ``RigidGrasp``.
    """

    axes: ClassVar[tuple[int, ...]] = (0, 1, 2, 3, 4)

    @property
    def _hold(self) -> Hold:
        return Hold(self.frame, kind="axis")

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        """x, y, z of the world and rx, ry of the frame."""
        return self._hold.rows(robot)

    def velocity_rows(self, robot: Robot, kin: Tracer, inputs: Values, dt: ca.SX) -> Rows:
        """Those of the hold."""
        return self._hold.velocity_rows(robot, kin, inputs, dt)

    def still(self, inputs: Values, rotation: ca.SX, twist: ca.SX) -> ca.SX:
        """The rate of R'w is R' dw/dt, so both are taken alike."""
        return ca.vertcat(twist[:3], (rotation.T @ twist[3:])[:2])

    def cone(self, inputs: Values) -> Cone:
        """The box, without m_z."""
        unlimited = ca.SX.inf(3)
        most = ca.vertcat(inputs.get("force", unlimited), inputs.get("torque", unlimited))[self._limited]
        matrix = ca.SX(ca.DM(np.eye(6)[np.ix_(self._limited, self.axes)]))
        return Cone(ca.sparsify(matrix), -most, most)

    @property
    def _limited(self) -> list[int]:
        limited = [*range(3)] * (self.force is not None) + [*range(3, 6)] * (self.torque is not None)
        return [k for k in limited if k in self.axes]


#: By what a hold holds
GRASPS: dict[GripKind, type[RigidGrasp]] = {GripKind.POSE: RigidGrasp, GripKind.AXIS: AxisGrasp}
