"""The robot that does exactly what it is commanded."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from wbc.multibody import pin
from wbc.robot import Robot
from wbc.robot.robot import checked_robot
from wbc.simulation.plant import Command, CommandKind, PlantState, numbers_of
from wbc.validation import Array


class KinematicPlant:
    """A command v is held for dt and integrated on the manifold: q <- q (+) v dt (``pin.integrate``).

    No servo's lag, no delay, no noise: what a controller commands is what happens.

    Args:
        robot: what moves.
    """

    time_step = 0.0
    commands: Collection[CommandKind] = (CommandKind.VELOCITY,)

    def __init__(self, robot: Robot) -> None:
        self._model = checked_robot(robot).model
        self.nq, self.nv = robot.nq, robot.nv
        self.reset(robot.neutral, 0.0)

    def reset(self, q: Array, time: float) -> None:
        self._q, self._v, self._time = np.array(q), np.zeros(self.nv), time

    def read(self) -> PlantState:
        """Exactly where it is; the velocity is the one that brought it there."""
        return PlantState(self._q, self._v, self._time)

    def apply(self, command: Command) -> None:
        self._v = numbers_of(command, self.commands, self.nv)

    def advance(self, dt: float) -> None:
        self._q = pin.integrate(self._model, self._q, self._v * dt)
        self._time += dt
