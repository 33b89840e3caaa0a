"""The momentum of the robot follows a momentum."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import RangeError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.symbolic.dynamics import Centroidal, Dynamics
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Input, Row, Task, Values
from wbc.tasks.frames import checked_weights

MOMENTUM_KINDS = ("both", "linear", "angular")

#: A centroidal inertia below this part of m L^2 is that of a point mass and no scale for angular rows.
SMALLEST_INERTIA = 1e-6


@dataclass(frozen=True)
class Momentum(Task):
    """The momentum of the whole robot, in world axes, angular about its centre of mass, follows a momentum:

        A(q) v = target + gain lag                                         [kg m/s; kg m^2/s]

    A is the centroidal momentum matrix (Orin, Goswami and Lee, Autonomous Robots 35, 2013). Angular momentum is the
    derivative of no function of q, so the rows have no error of their own: ``lag`` states by how much the time
    integral of the momentum is behind, and is worked off at ``gain``; the reported error is -lag. A linear row is
    weighed by 1 / (m L)^2 and an angular one by 1 / I^2, with m the mass of all moving links, L the robot's
    characteristic length and I the mean principal inertia about the centre of mass at ``robot.neutral``.

    Attributes:
        kind: which rows: ``both`` (6), ``linear`` (3) or ``angular`` (3).
        weights: one number >= 0 a row, multiplies the weights above; None: 1 each.

    Inputs:
        target: momentum, linear [kg m/s] and angular [kg m^2/s], or the part that ``kind`` says. Default 0.
        lag: what its time integral lacks [kg m; kg m^2]. Default 0.

    What it cannot do: change physics: a robot that floats freely keeps its momentum. The centre of mass drifts
    (``CenterOfMass`` holds it). Rotors of motors (armature) and payloads that the description lacks are not seen.

    Example:
        >>> import wbc
        >>> robot = wbc.robots.load("talos")
        >>> stack = wbc.Stack(robot, dt=0.002)
        >>> stack.add(wbc.tasks.Hold("left_sole_link"), name="left foot")
        >>> stack.add(wbc.tasks.EndEffector("gripper_left_base_link"), name="hand")
        >>> stack.add(wbc.tasks.Momentum("angular"), name="calm", weight=0.1)

    Raises:
        UnknownNameError, ShapeError, NotFiniteError, RangeError: on construction or in :meth:`validate`; a
            robot without mass is a RangeError.
    """

    stands_in_world: ClassVar[bool] = False

    kind: Literal["both", "linear", "angular"] = "both"
    weights: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        validation.one_of("Momentum.kind", self.kind, MOMENTUM_KINDS)
        object.__setattr__(self, "weights", checked_weights("Momentum.weights", self.weights, self._count))

    @property
    def _count(self) -> int:
        return 6 if self.kind == "both" else 3

    @property
    def _rows(self) -> slice:
        return {"both": slice(0, 6), "linear": slice(0, 3), "angular": slice(3, 6)}[self.kind]

    def validate(self, robot: Robot) -> None:
        mass = _inertia(robot).mass
        if mass <= 0.0:
            raise RangeError("Momentum", mass, f"the moving links of {robot.name!r} have no mass [kg]")

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        first = {"both": "kg m, kg m^2", "linear": "kg m", "angular": "kg m^2"}[self.kind]
        rate = {"both": "kg m/s, kg m^2/s", "linear": "kg m/s", "angular": "kg m^2/s"}[self.kind]
        return (
            Input("lag", unit=first, size=self._count, default=np.zeros(self._count), rate="target"),
            Input("target", unit=rate, size=self._count, default=np.zeros(self._count)),
        )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        every = [Row(label, "kg m") for label in "xyz"] + [Row(f"r{label}", "kg m^2") for label in "xyz"]
        return tuple(every[self._rows])

    def row_weights(self, robot: Robot) -> NDArray[np.float64]:
        total, length = _inertia(robot), robot.characteristic_length
        # About the centre of mass, unlike the matrix that Inertia itself is in the world
        mean = max(float(np.trace(total.inertia)) / 3, SMALLEST_INERTIA * total.mass * length**2)
        scales = np.repeat([total.mass * length, mean], 3)[self._rows]
        weights: NDArray[np.float64] = super().row_weights(robot) / scales**2
        return weights

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return ca.SX(-inputs["lag"])

    def jacobian(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return Centroidal(Dynamics(kin.kinematics)).matrix[self._rows, :]


def _inertia(robot: Robot) -> pin.Inertia:
    """Mass, centre and inertia about it of all moving links as one body in the world, at ``robot.neutral``."""
    data, total = robot.model.createData(), pin.Inertia.Zero()
    pin.forwardKinematics(robot.model, data, robot.neutral)
    for j in range(1, robot.model.njoints):
        if robot.model.inertias[j].mass > 0.0:
            total = total + data.oMi[j].act(robot.model.inertias[j])
    return total
