"""Friction of joints and gears."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.robot import Robot
from wbc.symbolic.kinematics import Kinematics
from wbc.tasks._limits import checked_limits
from wbc.tasks._load import Load
from wbc.tasks.base import Input, Values


@dataclass(frozen=True)
class JointFriction(Load):
    """Motors overcome the friction of their joints, viscous and of Coulomb:

        M a + h = tau + J'w - viscous v - coulomb tanh(v / slow)        [N m; N for sliding joints]

    with the measured velocity v. Without it a joint that is commanded by torque lags by what its gear takes. Only a
    stack that commands torques can have it.

    Attributes:
        viscous: first value of the input, one number or one a motor; None: ``damping`` of the description.
        coulomb: the same; None: ``friction`` of the description.
        slow: first value of the input.

    Inputs:
        viscous: one number a joint of ``robot.dof_names`` that has a motor [N m s/rad, N s/m].
        coulomb: the same [N m, N].
        slow: speed up to which friction grows with speed, as tanh does [rad/s, m/s].

    What it cannot do: overcome stiction: the first move has an error of ``coulomb``. Friction that depends on load or
    temperature is not in it.

    Example:
        >>> import wbc
        >>> stack = wbc.Stack(wbc.robots.load("panda"), dt=0.002).add(wbc.tasks.Posture())
        >>> stack.add(wbc.tasks.JointFriction(viscous=0.1, coulomb=0.5)).add(wbc.tasks.TorqueLimits())

    Raises:
        ShapeError, NotFiniteError, RangeError, BoundsError: on construction or in :meth:`validate`.
    """

    initial_only: ClassVar[tuple[str, ...]] = ("viscous", "coulomb", "slow")

    viscous: float | tuple[float, ...] | None = None
    coulomb: float | tuple[float, ...] | None = None
    slow: float = 0.01

    def __post_init__(self) -> None:
        for name in ("viscous", "coulomb"):
            value: Any = getattr(self, name)
            if value is not None:
                validation.real_array(f"JointFriction.{name}", value)
                object.__setattr__(self, name, checked_limits(f"JointFriction.{name}", 0.0, value)[1])
        validation.own_scalars(self, "slow", low=0.0, open_low=True)

    def validate(self, robot: Robot) -> None:
        count = len(self.dofs(robot))
        for name in ("viscous", "coulomb"):
            value = getattr(self, name)
            if isinstance(value, tuple):
                validation.real_array(f"JointFriction.{name}", value, (count,))

    def dofs(self, robot: Robot) -> list[int]:
        """Degrees of freedom that motors drive."""
        followers = {c.follower for c in robot.couplings}
        return [i for i in range(6 if robot.base == "floating" else 0, robot.nv) if i not in followers]

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        known = {"viscous": robot.model.damping, "coulomb": robot.model.friction}
        dofs, units = self.dofs(robot), {"viscous": "N m s/rad, N s/m", "coulomb": "N m, N"}
        out = []
        for name, unit in units.items():
            value = getattr(self, name)
            given: NDArray[np.float64] = np.array(known[name])[dofs] if value is None else np.array(value, dtype=float)
            start = np.broadcast_to(given, len(dofs)).copy()
            out.append(Input(name, unit=unit, size=len(dofs), default=start, low=0.0, each=True))
        return (*out, Input("slow", unit="rad/s, m/s", default=self.slow, low=1e-6))

    def load(self, robot: Robot, kin: Kinematics, inputs: Values) -> ca.SX:
        dofs, total = self.dofs(robot), ca.SX(robot.nv, 1)
        v = kin.v[dofs]
        total[dofs] = -inputs["viscous"] * v - inputs["coulomb"] * ca.tanh(v / inputs["slow"])
        return total
