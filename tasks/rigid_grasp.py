"""A gripper that has closed on something that does not move."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from wbc.robot import Robot
from wbc.tasks._contact import WRENCH_LABELS, WRENCH_UNITS, Cone, Contact, force_row
from wbc.tasks._limits import checked_limits
from wbc.tasks.base import Input, Row, Values

#: What a gripper bears: one number for all axes, three, or none
Rating = float | tuple[float, ...] | None


@dataclass(frozen=True)
class RigidGrasp(Contact):
    """A gripper holds on: its frame does not move, J v = -gain e as for ``Hold`` with ``kind="pose"``. Its wrench
    w = (f; m), in the axes of the frame and about its origin, keeps within a box:

        -force <= f <= force  [N],      -torque <= m <= torque  [N m]

    For accelerations it holds as J a + (dJ/dt) v = -rate (J v + gain e) - gain J v; for torques w is a variable of the
    optimisation. docs/torque.md.

    Attributes:
        frame: name of the frame.
        force: first value of the input: one number for all axes or three; None: no limit.
        torque: the same.

    Inputs:
        target: pose in the world [m, rad]. Default: the pose at the first step.
        gain: how fast drift decays [1/s]. Default 10.
        force: what the gripper bears along each axis [N].
        torque: what it bears about each axis [N m].

    What it cannot do: have a rating that couples forces and torques: give a box inside of it. ``enabled = False``
    opens it at once: raise the weight of the task ``"<grasp> force"`` before, so that the load has gone.

    Example:
        >>> import wbc
        >>> stack = wbc.Stack(wbc.robots.load("talos"), dt=0.002)
        >>> hand = wbc.tasks.RigidGrasp("gripper_left_base_link", force=200.0, torque=(20.0, 20.0, 10.0))
        >>> stack.add(hand, name="hand")
        >>> stack.add(wbc.tasks.Posture())

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
        out = []
        for name, unit in (("force", "N"), ("torque", "N m")):
            value = getattr(self, name)
            if value is not None:
                start = np.broadcast_to(np.array(value, dtype=np.float64), 3).copy()
                out.append(Input(name, unit=unit, size=3, default=start, low=0.0, infinite=np.inf, each=True))
        return tuple(out)

    def cone_rows(self, robot: Robot) -> tuple[Row, ...]:
        return tuple(force_row(robot, WRENCH_LABELS[k], WRENCH_UNITS[k]) for k in self._limited)

    def cone(self, inputs: Values) -> Cone:
        most = ca.vertcat(*[inputs[i.name] for i in self.limits()])
        return Cone(ca.SX.eye(6)[self._limited, :], -most, most)

    @property
    def _limited(self) -> list[int]:
        return [*range(3)] * (self.force is not None) + [*range(3, 6)] * (self.torque is not None)
