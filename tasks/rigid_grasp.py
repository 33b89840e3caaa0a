"""A gripper that has closed on something that does not move."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from wbc.robot import Robot
from wbc.tasks._contact import LABELS, UNITS, Cone, Contact, force_row
from wbc.tasks._limits import checked_limits
from wbc.tasks.base import Input, Row, Values

#: What a gripper bears: one number for all axes, three, or none
Rating = float | tuple[float, ...] | None


@dataclass(frozen=True)
class RigidGrasp(Contact):
    """A frame does not move, J v = -gain e as for ``Hold`` with ``kind="pose"``, held by a wrench of six components
    w = (f; m), in the axes of the frame and about its origin, within a box:

        -force <= f <= force  [N],      -torque <= m <= torque  [N m]

    The equality J v = -gain e is that of a stack that commands velocities. For accelerations it holds as
    J a + (dJ/dt) v = -rate (J v + gain e) - gain J v, so that drift decays with both rates, and for torques w
    is a variable of the optimisation. docs/torque.md.

    Inputs:
        target: pose in the world [m, rad]. Default: the pose at the first step.
        gain: how fast drift decays [1/s]. Default 10.
        force: what the gripper bears along each axis [N].
        torque: what it bears about each axis [N m].

    Example:
        >>> RigidGrasp("arm1_hand", force=200.0, torque=40.0)

    What it cannot do: a gripper whose rating couples forces and torques is a box inside of that, or an Expression of
    its own. It does not close or open anything: ``enabled = False`` is a hand that holds nothing, and bears nothing.

    Attributes:
        frame: name of the frame.
        force: first value of the input: one number for all axes or three; None: no limit.
        torque: the same for torques.

    Raises:
        UnknownNameError, ShapeError, NotFiniteError, RangeError: on construction or in :meth:`validate`.
    """

    force: Rating = None
    torque: Rating = None

    def __post_init__(self) -> None:
        for name in ("force", "torque"):
            value = getattr(self, name)
            if value is not None:
                _, checked = checked_limits(f"RigidGrasp.{name}", 0.0, value, 3)
                object.__setattr__(self, name, checked)

    def limits(self) -> tuple[Input, ...]:
        """``force`` and ``torque``, as far as limited."""
        out = []
        for name, unit in (("force", "N"), ("torque", "N m")):
            value = getattr(self, name)
            if value is not None:
                start = np.broadcast_to(np.array(value, dtype=np.float64), 3).copy()
                out.append(Input(name, unit=unit, size=3, default=start, low=0.0, infinite=np.inf))
        return tuple(out)

    def cone_rows(self, robot: Robot) -> tuple[Row, ...]:
        """The limited components."""
        return tuple(force_row(robot, LABELS[k], UNITS[k]) for k in self._limited)

    def cone(self, inputs: Values) -> Cone:
        """The box of the class."""
        most = ca.vertcat(*[inputs[i.name] for i in self.limits()])
        return Cone(ca.SX.eye(6)[self._limited, :], -most, most)

    @property
    def _limited(self) -> list[int]:
        return [*range(3)] * (self.force is not None) + [*range(3, 6)] * (self.torque is not None)
