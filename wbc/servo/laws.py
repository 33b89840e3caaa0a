"""What is sent to a servo: the reference, what the servo's response asks for in advance, and feedback of the error."""

from __future__ import annotations

import numpy as np

from wbc.servo.response import Response
from wbc.simulation import CommandKind
from wbc.validation import Array

#: Time constant in which an error is made up for, of positions, velocities and torques: so many delays,
PER_DELAY = {CommandKind.POSITION: 2.5, CommandKind.VELOCITY: 1.5, CommandKind.TORQUE: 1.0}
#: at least so many periods,
PER_PERIOD = 10.0
#: and where the response is still to be found, at least so much [s]
UNTOLD = {CommandKind.POSITION: 0.05, CommandKind.VELOCITY: 0.02, CommandKind.TORQUE: 0.05}
#: A velocity servo's error takes so many times its lag longer
PER_LAG = 2.0


class Feedback:
    """Corrections d that make an error e = r (-) q vanish in about 1/w, by what q does with them:

        position   T dq/dt + q = r + T dr/dt + d     d = T w e + w z
        velocity   T dv/dt + v = dr/dt + T a + d     d = w' e + w'^2/4 z,   1/w' = 1/w + 2 T
        torque     dv/dt = a + d                     d = 2 w de/dt + w^2 e + w^3/3 z

    with z = int e dt. Of velocities and torques e and de/dt are those at t + D, when d takes hold: corrections that
    were sent within the last D are accounted for. Of positions the loop is w/s exp(-D s) without that, because the zero
    of d cancels the lag. A velocity servo gets no de/dt: joints that move more lightly together than one by one would
    answer it by more than itself.

    Args:
        kind: of servo. dt: period [s]. lag: T, nv numbers. late: D in periods. w: [1/s].
    """

    def __init__(self, kind: CommandKind, dt: float, lag: Array, late: int, w: float) -> None:
        self._w = w
        wide, slow = np.ones_like(lag), 1.0 / (1.0 / w + PER_LAG * lag)
        #: Of de/dt, e and z
        self._gains = {
            CommandKind.POSITION: (0.0 * lag, w * lag, w * wide),
            CommandKind.VELOCITY: (0.0 * lag, slow, 0.25 * slow * slow),
            CommandKind.TORQUE: (2.0 * w * wide, w * w * wide, w**3 / 3.0 * wide),
        }[kind]
        # Periods from the sending of each correction to t + D, the oldest first
        left = np.arange(late, 0.0, -1.0)[:, None]
        if kind is CommandKind.TORQUE:
            self._stay, self._reach = wide, late * dt * wide
            self._slows, self._moves = dt * (wide + 0.0 * left), dt * dt * (left - 0.5) * wide
        else:
            decay = np.exp(-dt / np.maximum(lag, 1e-3 * dt))
            self._stay = decay**late
            self._reach, self._slows = lag * (1.0 - self._stay), (1.0 - decay) * decay ** (left - 1.0)
            self._moves = dt - lag * self._slows
        self._predicted = kind
        self._predicts = late > 0 and kind is not CommandKind.POSITION

    def acceleration(self, rate: Array, most: float) -> Array:
        """w de/dt of positions, which the compliance to forces of motion answers to; nothing else."""
        if self._predicted is not CommandKind.POSITION:
            return np.zeros_like(rate)
        return np.asarray(self._w * np.clip(rate, -most * self._w, most * self._w))

    def correction(self, error: Array, rate: Array, total: Array, sent: Array, most: float) -> Array:
        """d, from e up to ``most``, de/dt up to w most, z, and what was sent within the last D, the oldest first."""
        error, rate = np.clip(error, -most, most), np.clip(rate, -most * self._w, most * self._w)
        if self._predicts:
            error = error + self._reach * rate - (self._moves * sent).sum(axis=0)
            rate = self._stay * rate - (self._slows * sent).sum(axis=0)
        on_rate, on_error, on_total = self._gains
        return np.asarray(on_rate * rate + on_error * error + on_total * total)


def quickness(kind: CommandKind, dt: float, response: Response, told: bool) -> float:
    """w [1/s]: 1 over the largest of the times that the period, the delay and ignorance ask for.

    A delay that is told too long costs accuracy; what is missing of it, times w, must stay below 1.
    """
    late = PER_DELAY[kind] * response.delay + response.doubt
    return 1.0 / max(PER_PERIOD * dt, late, 0.0 if told else UNTOLD[kind])
