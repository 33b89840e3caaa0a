"""Joints from noisy encoders, by what the loop of torques has decided that they do."""

from __future__ import annotations

import numpy as np

from wbc.multibody import pin
from wbc.simulation import Encoders, PlantState
from wbc.validation import Array

#: Accelerations that are not the decided ones, one standard deviation [rad/s^2]
UNKNOWN = 1.0
#: Steps of the Riccati equation: the gain is there long before
STEPS = 2000


class JointFilter:
    """A Kalman filter with constant gain for each joint, of (q, v) read with noise, and the acceleration a decided:

        q- = q + v dt + a dt^2 / 2,    v- = v + a dt,    (q, v) = (q-, v-) + K ((q, v)_read - (q-, v-))

    K is that of the Riccati equation for accelerations that are off by :data:`UNKNOWN`. A base is taken as it is read.

    Args:
        model: of the robot. base: velocities of its base. encoders: their noise. dt: [s].
    """

    def __init__(self, model: pin.Model, base: int, encoders: Encoders, dt: float) -> None:
        self._model, self._base, self._dt = model, base, dt
        step = np.array([0.5 * dt * dt, dt])
        unknown = UNKNOWN**2 * np.outer(step, step)
        sizes = np.hypot(encoders.position, encoders.resolution / np.sqrt(12.0)), encoders.velocity
        noise, forward = np.diag(np.square(sizes)), np.array([[1.0, dt], [0.0, 1.0]])
        spread = noise + unknown
        for _ in range(STEPS):
            before = forward @ spread @ forward.T + unknown
            gain = np.linalg.solve(before + noise, before).T
            spread = (np.eye(2) - gain) @ before
        self.gain = gain

    def begin(self, state: PlantState) -> PlantState:
        """What is read is all that is known."""
        self._state = state
        return state

    def struck(self, read: PlantState) -> PlantState:
        """A hand has closed, which changes velocities at once, and no positions."""
        return self.begin(PlantState(self._state.q, read.v, read.time, read.valid))

    def see(self, read: PlantState, a: Array) -> PlantState:
        """A period on, with what is read at its end and the accelerations that were decided for it ``[nv]``."""
        last, dt, base = self._state, self._dt, self._base
        moved = last.v * dt + (0.5 * dt * dt) * a
        q, v = pin.integrate(self._model, last.q, moved), last.v + dt * a
        off = np.array([pin.difference(self._model, q, read.q), read.v - v])
        add = self.gain @ off
        add[:, :base] = off[:, :base]
        self._state = PlantState(pin.integrate(self._model, q, add[0]), v + add[1], read.time, read.valid)
        return self._state
