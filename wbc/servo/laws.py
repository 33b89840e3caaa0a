"""What is sent to a servo: the reference, what the servo's response asks for in advance, and feedback of the error."""

from __future__ import annotations

import numpy as np

from wbc.servo.response import Response
from wbc.simulation import CommandKind
from wbc.validation import Array

#: Time constant in which an error is made up for, of positions, velocities and torques: so many delays,
PER_DELAY = {CommandKind.POSITION: 2.5, CommandKind.VELOCITY: 2.5, CommandKind.TORQUE: 1.0}
#: and what the delay may be longer so many times,
PER_DOUBT = {CommandKind.POSITION: 1.0, CommandKind.VELOCITY: 1.0, CommandKind.TORQUE: 2.0}
#: at least so many periods,
PER_PERIOD = 10.0
#: and where the response is still to be found, at least so much [s]
UNTOLD = {CommandKind.POSITION: 0.05, CommandKind.VELOCITY: 0.02, CommandKind.TORQUE: 0.05}


class Feedback:
    """Corrections that make an error e = r (-) q vanish in about 1/w, by what q does with them: d is added to what a
    servo is sent, b to the acceleration a that its lag and its compliance are asked for in advance.

        position   C M d2q/dt2 + T dq/dt + q = r + T dr/dt + C M (a + b) + d     d = T w e + w z            b = w de/dt
        velocity   (C M + T) dv/dt + v = dr/dt + (C M + T) (a + b) + d           d = w e + w^2/4 z          b = dd/dt
        torque     dv/dt = a + d                                    d = 2 w de/dt + w^2 e + w^3/3 z         b = 0

    with z = int e dt. Of torques e and de/dt are those at t + D, when d takes hold: corrections that were sent within
    the last D are accounted for. Of positions the loop is w/s exp(-D s) without that, of velocities
    (w/s + w^2/(4 s^2)) exp(-D s), because the zeros of d and b cancel the servo's response; M is the whole inertia, so
    that joints that move more lightly together than one by one are not answered by more than they need.

    Args:
        kind: of servo. dt: period [s]. lag: T, nv numbers. late: D in periods. w: [1/s].
    """

    def __init__(self, kind: CommandKind, dt: float, lag: Array, late: int, w: float) -> None:
        self._w, wide = w, np.ones_like(lag)
        #: Of de/dt, e and z in d,
        gains: dict[CommandKind, tuple[float, Array | float, float]] = {
            CommandKind.POSITION: (0.0, w * lag, w),
            CommandKind.VELOCITY: (0.0, w, 0.25 * w * w),
            CommandKind.TORQUE: (2.0 * w, w * w, w**3 / 3.0),
        }
        #: and of de/dt and e in b
        pushes = {
            CommandKind.POSITION: (w, 0.0),
            CommandKind.VELOCITY: (w, 0.25 * w * w),
            CommandKind.TORQUE: (0.0, 0.0),
        }
        self._gains, self._pushes = gains[kind], pushes[kind]
        # Periods from the sending of each correction to t + D, the oldest first
        left = np.arange(late, 0.0, -1.0)[:, None]
        self._reach, self._slows, self._moves = late * dt, dt * wide, dt * dt * (left - 0.5) * wide
        self._predicts = late > 0 and kind is CommandKind.TORQUE

    def within(self, error: Array, low: Array, high: Array, most: float) -> Array:
        """e, as far as making up for it by w e asks for a speed from ``low`` to ``high``, and up to ``most``."""
        return np.asarray(np.clip(error, np.maximum(low / self._w, -most), np.minimum(high / self._w, most)))

    def correction(self, error: Array, rate: Array, total: Array, sent: Array, most: float) -> tuple[Array, Array]:
        """d and b, from e, de/dt up to w most, z, and the d of the last D, the oldest first."""
        rate = np.clip(rate, -most * self._w, most * self._w)
        if self._predicts:
            error = error + self._reach * rate - (self._moves * sent).sum(axis=0)
            rate = rate - (self._slows * sent).sum(axis=0)
        on_rate, on_error, on_total = self._gains
        b = self._pushes[0] * rate + self._pushes[1] * error
        return np.asarray(on_rate * rate + on_error * error + on_total * total), b


def quickness(kind: CommandKind, dt: float, response: Response, told: bool) -> float:
    """w [1/s]: 1 over the largest of the times that the period, the delay and ignorance ask for.

    A delay that is told too long costs accuracy; what is missing of it, times w, must stay below 1, and of torques
    below 0.66, where the loop of triple poles begins to swing.
    """
    late = PER_DELAY[kind] * response.delay + PER_DOUBT[kind] * response.doubt
    return 1.0 / max(PER_PERIOD * dt, late, 0.0 if told else UNTOLD[kind])
