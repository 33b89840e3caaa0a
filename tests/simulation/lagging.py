"""A robot with servos: what it is commanded it does late, slowly, and its sensors are not exact."""

from __future__ import annotations

from collections import deque

import numpy as np
import pinocchio as pin

from wbc.robot import Robot
from wbc.simulation import Command, CommandKind, PlantState


class LaggingPlant:
    """dv/dt = (u(t - delay) - v) / lag, integrated exactly for a command that holds; q is read with noise.

    Args:
        lag: [s]. delay: whole time steps. noise: standard deviation of what is read of each coordinate [m, rad].
    """

    commands = (CommandKind.VELOCITY,)

    def __init__(self, robot: Robot, lag: float, delay: int, noise: float, time_step: float = 0.001) -> None:
        self.robot, self.nq, self.nv, self.time_step = robot, robot.nq, robot.nv, time_step
        self._part, self._delay, self._noise = -np.expm1(-time_step / lag), delay, noise

    def reset(self, q: np.ndarray, time: float) -> None:
        self.q, self.v, self.time = q.copy(), np.zeros(self.nv), time
        self._queue = deque([np.zeros(self.nv)] * (self._delay + 1))
        self._random = np.random.default_rng(0)
        self._read = PlantState(self.q, self.v, time)

    def apply(self, command: Command) -> None:
        self._last = command.values.copy()

    def advance(self, dt: float) -> None:
        for _ in range(round(dt / self.time_step)):
            self._queue.append(self._last)
            self.v = self.v + self._part * (self._queue.popleft() - self.v)
            self.q = pin.integrate(self.robot.model, self.q, self.v * self.time_step)
        self.time += dt
        noise = self._noise * self._random.standard_normal(self.nv)
        self._read = PlantState(pin.integrate(self.robot.model, self.q, noise), self.v, self.time)

    def read(self) -> PlantState:
        return self._read
