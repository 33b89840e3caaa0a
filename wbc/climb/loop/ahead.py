"""Where torques that take hold late will find the robot."""

from __future__ import annotations

import math

import numpy as np

from wbc import validation
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.validation import Array

#: Of a delay in periods, what is rounding
ROUNDING = 1e-6


class StateAhead:
    """The state after a known delay d: what is read, and the accelerations that were decided since and hold for h_k,

        v' = v + sum h_k a_k,   q' = q (+) (d v + sum h_k (l_k + h_k / 2) a_k)

    each with what is left after it, l_k. They hold for a period each, the oldest one for what is left of the delay.

    Args:
        robot: what moves. delay: [s]. dt: period [s].
    """

    def __init__(self, robot: Robot, delay: float, dt: float) -> None:
        self._delay = validation.scalar("delay", delay, low=0.0, unit="s")
        count = math.ceil(self._delay / dt - ROUNDING)
        self._model, self._decided = robot.model, np.zeros((count, robot.nv))
        left = np.arange(count - 1, -1, -1) * dt
        self._holds = np.minimum(dt, self._delay - left)
        self._lasts = self._holds * (left + 0.5 * self._holds)

    def met(self, q: Array, v: Array) -> tuple[Array, Array]:
        """(q', v') of a reading (q, v)."""
        if not len(self._decided):
            return q, v
        moved = self._delay * v + self._lasts @ self._decided
        return pin.integrate(self._model, q, moved), v + self._holds @ self._decided

    def decided(self, a: Array) -> None:
        """The acceleration of this tick."""
        if len(self._decided):
            self._decided[:-1] = self._decided[1:]
            self._decided[-1] = a
