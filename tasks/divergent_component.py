"""The divergent component of motion, and with it the capture point, follows a position."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.robot import Robot
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Command, Input, Row, Task, Values
from wbc.tasks.center_of_mass import CenterOfMass
from wbc.tasks.frames import checked_weights, point_rows


@dataclass(frozen=True)
class DivergentComponent(Task):
    """The divergent component of motion xi of the centre of mass c follows a position in the world,

        xi = c + (dc/dt) / omega,   d xi/dt = feedforward - gain (xi - target),   omega = sqrt(g / height)     [m, m/s]

    (Takenaka, Matsumoto and Yoshiike, IROS 2009; Englsberger, Ott and Albu-Schaeffer, IEEE T-RO 31(2), 2015). c itself
    converges to xi, so only xi has to be kept over the feet; its projection on level ground is the capture point. The
    rows ask for the acceleration

        d2c/dt2 = omega (feedforward - gain (xi - target) - dc/dt),

    and the error that a step reports is e = c - target. Only a stack that commands accelerations or torques can have
    it (docs/torque.md): for velocities a row of ``CenterOfMass`` with gain omega puts xi on its target at once.

    Attributes:
        omega: first value of the input: sqrt(g / height), for 0.8 m on earth 3.5/s.
        weights: three numbers >= 0, by default x and y alike and the height free.

    Inputs:
        target: 3 numbers in the world [m]. Default: where the centre of mass is at the first step.
        feedforward: velocity of the target [m/s]. Default 0.
        gain: how fast xi reaches its target [1/s].
        omega: of the pendulum [1/s].

    What it cannot do: guarantee balance: friction cones decide whether the contacts can make the acceleration. A robot
    that rises or sinks quickly needs another omega in every tick.

    Example:
        >>> import wbc
        >>> stack = wbc.Stack(wbc.robots.load("talos"), dt=0.002)
        >>> stack.add(wbc.tasks.DivergentComponent(omega=3.5), name="capture point")
        >>> stack.add(wbc.tasks.Posture(), name="posture", weight=1e-2)

    Raises:
        ShapeError, NotFiniteError, RangeError: on construction; a robot without mass in :meth:`validate`.
    """

    initial_only: ClassVar[tuple[str, ...]] = ("omega",)
    default_gain: ClassVar[float] = 3.0

    omega: float
    weights: tuple[float, ...] | None = (1.0, 1.0, 0.0)

    def __post_init__(self) -> None:
        validation.own_scalars(self, "omega", low=0.0, open_low=True, unit="1/s")
        object.__setattr__(self, "weights", checked_weights("DivergentComponent.weights", self.weights, 3))

    def validate(self, robot: Robot) -> None:
        CenterOfMass().validate(robot)

    def refusal(self, robot: Robot, command: Command) -> str:
        return (
            'needs command="acceleration" or "torque"; for velocities use CenterOfMass' if command == "velocity" else ""
        )

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return (
            Input("target", unit="m", size=3),
            Input("feedforward", unit="m/s", size=3, default=np.zeros(3)),
            Input("gain", unit="1/s", default=self.default_gain if self.gain is None else self.gain, low=0.0),
            Input("omega", unit="1/s", default=self.omega, low=1e-6),
        )

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return point_rows()

    def initial(self, robot: Robot, q: NDArray[np.float64]) -> dict[str, Any]:
        return CenterOfMass().initial(robot, q)

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return ca.SX(kin.center_of_mass() - inputs["target"])

    def acceleration(self, inputs: Values, error: ca.SX, rate: ca.SX) -> ca.SX:
        omega, gain = inputs["omega"], inputs["gain"]
        return ca.SX(omega * (inputs["feedforward"] - gain * (error + rate / omega) - rate))
