"""Where torques that take hold late will find the robot."""

from __future__ import annotations

import numpy as np

from wbc import validation
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.validation import Array


class StateAhead:
    """The state after a known delay: what is read, and the accelerations that were decided since,

        v' = v + dt sum a_k,   q' = q (+) (n dt v + dt^2 sum (n - k - 1/2) a_k),   k = 0 ... n - 1, the oldest first

    Args:
        robot: what moves. delay: [s]. dt: period; the delay is rounded to whole ones.
    """

    def __init__(self, robot: Robot, delay: float, dt: float) -> None:
        count = round(validation.scalar("delay", delay, low=0.0, unit="s") / dt)
        self._model, self._dt = robot.model, dt
        self._decided = np.zeros((count, robot.nv))
        self._lasts = (np.arange(count, 0, -1) - 0.5) * dt**2

    def met(self, q: Array, v: Array) -> tuple[Array, Array]:
        """(q', v') of a reading (q, v)."""
        if not len(self._decided):
            return q, v
        moved = len(self._decided) * self._dt * v + self._lasts @ self._decided
        return pin.integrate(self._model, q, moved), v + self._dt * self._decided.sum(axis=0)

    def decided(self, a: Array) -> None:
        """The acceleration of this tick."""
        if len(self._decided):
            self._decided[:-1] = self._decided[1:]
            self._decided[-1] = a
