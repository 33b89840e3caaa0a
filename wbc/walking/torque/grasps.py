"""Grasps of holds that leave the hand its roll, or its tilt as well."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

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
        numbers = ca.vertcat(*[inputs[i.name] for i in self.limits()])
        places = [k for k, axis in enumerate(self._given) if axis in self.axes]
        most = _chosen(places, len(self._given)) @ numbers
        return Cone(_chosen(self._limited, 6)[:, list(self.axes)], -most, most)

    @property
    def _given(self) -> list[int]:
        return [*range(3)] * (self.force is not None) + [*range(3, 6)] * (self.torque is not None)

    @property
    def _limited(self) -> list[int]:
        return [axis for axis in self._given if axis in self.axes]


@dataclass(frozen=True)
class PointGrasp(AxisGrasp):
    """A hand that may turn about its origin: three rows as of ``Hold(kind="position")``, and a force within the box."""

    axes: ClassVar[tuple[int, ...]] = (0, 1, 2)
    part: ClassVar[Literal["", "position"]] = "position"

    @property
    def _hold(self) -> Hold:
        return Hold(self.frame, kind="position")

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        """x, y, z of the world."""
        return self._hold.rows(robot)

    def still(self, inputs: Values, rotation: ca.SX, twist: ca.SX) -> ca.SX:
        """Of the origin alone."""
        return twist[:3]


def _chosen(rows: list[int], count: int) -> ca.SX:
    """Some rows of the unit matrix."""
    return ca.sparsify(ca.SX(ca.DM(np.eye(count)[rows])))


#: By what a hold holds
GRASPS: dict[GripKind, type[RigidGrasp]] = {
    GripKind.POSE: RigidGrasp,
    GripKind.AXIS: AxisGrasp,
    GripKind.POSITION: PointGrasp,
}
