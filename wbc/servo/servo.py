"""A reference between the tick and the servos of a robot: kept, integrated, and followed with feedback from measurement."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
import pinocchio as pin

from wbc import validation
from wbc.controller import Controller, Step
from wbc.errors import BoundsError
from wbc.servo.model import Response
from wbc.simulation import Command, CommandKind
from wbc.validation import Array

#: Time constant in which an error is made up for: at least so many periods,
QUICKEST = 10.0
#: so many times the delay, which positions see through the servo's own loop and the others through what is still to come,
PER_DELAY = {CommandKind.POSITION: 2.5, CommandKind.VELOCITY: 1.5, CommandKind.TORQUE: 1.0}
#: of a servo of velocities so many times its lag more,
PER_LAG = 2.0
#: and where nobody told how the servo responds, at least this [s]
CAREFUL = {CommandKind.POSITION: 0.3, CommandKind.VELOCITY: 0.05, CommandKind.TORQUE: 0.0}
#: The integral of a torque servo is this many times slower than its proportional part
SLOWER = 3.0
#: Acceleration of braking where a joint has no limit [rad/s^2, m/s^2]
PLAIN = 10.0


class Following(StrEnum):
    """How a robot follows its reference: as it should; the reference waits for it; or it was stopped for good."""

    CLOSE = "close"
    SLOWED = "slowed"
    STOPPED = "stopped"


@dataclass(frozen=True, eq=False)
class ServoStep:
    """A tick and what goes to the servos.

    Attributes:
        command: for :meth:`wbc.simulation.Plant.apply`; ``command.values`` for a driver of one's own.
        step: the tick's, at the reference. following: see :class:`Following`.
        error: of the robot behind its reference, nv numbers [rad, m].
    """

    command: Command
    step: Step
    following: Following
    error: Array


class Servo:
    """Lets a robot follow a controller through servos of positions, velocities or torques.

        servo = Servo(controller, "position", response=identify(commands, positions, dt))
        servo.reset(q)
        while True:
            driver.send(servo.step(driver.positions()).command.values)

    The controller's ticks are taken at a reference r that nothing disturbs, dr/dt = v: limits and accelerations count from it.
    The robot follows it by what is known of its servos and by feedback of e = r(t - D) (-) q, with D the delay and
    w = 1 / max(10 dt, 4 D):

        position   u = r (+) (T v + T w e + w int e dt)               T: the servo's lag
        velocity   u = v + w e + w^2/4 int e dt
        torque     u = M(r) (a + 2 w de/dt + w^2 e + w^3/3 int e dt) + h(r, v)

    The integrals make up for gravity, payload and friction that nobody told. They stand while the robot is farther behind than
    ``divergence[0]``; then the reference slows down as well, and at ``divergence[1]`` it brakes and stays stopped until
    :meth:`reset`.

    Args:
        controller: compiled; it belongs to the servo from now on, apart from its run-time values.
        kind: what the servos take. response: lag and delay, see :func:`identify`; default: none of either.
        divergence: distance behind the reference at which it begins to wait, and at which it stops [rad or m].
        armature: of motors, added to the diagonal of M for torque servos, nv numbers or one [kg m^2].
        damping: of joints, for torque servos [N m s].

    Raises:
        UnknownNameError: another kind. ShapeError, NotFiniteError, RangeError, BoundsError: arguments that make no sense.
    """

    def __init__(
        self,
        controller: Controller,
        kind: str | CommandKind,
        *,
        response: Response | None = None,
        divergence: tuple[float, float] = (0.1, 0.3),
        armature: Any = 0.0,
        damping: Any = 0.0,
    ) -> None:
        self.kind = CommandKind(validation.one_of("kind", str(kind), [str(one) for one in CommandKind]))
        self.controller, self._robot, self._dt = controller, controller.stack.robot, controller.stack.dt
        self._model, nv = self._robot.model, self._robot.nv
        self._data = self._model.createData()
        near, far = validation.ordinary_array("divergence", divergence, (2,)).tolist()
        if not 0.0 < near < far:
            raise BoundsError("divergence", divergence, "expected 0 < where it waits < where it stops")
        self._near, self._far = near, far
        self._lag = np.zeros(nv) if response is None else validation.real_array("response.lag", response.lag, (nv,))
        delay = 0.0 if response is None else validation.scalar("response.delay", response.delay, low=0.0, unit="s")
        self._delay, self._late = delay, round(delay / self._dt)
        slow = PER_LAG * self._lag if self.kind is CommandKind.VELOCITY else np.zeros(nv)
        least = CAREFUL[self.kind] if response is None else PER_DELAY[self.kind] * delay + slow
        self._w = 1.0 / np.maximum(QUICKEST * self._dt, least)
        self._armature = np.broadcast_to(validation.real_array("armature", armature), (nv,)) + np.zeros(nv)
        self._damping = np.broadcast_to(validation.real_array("damping", damping), (nv,)) + np.zeros(nv)
        known = self._robot.limits.acceleration
        self._most = np.where(np.isfinite(known), known, PLAIN)
        self.reset(self._robot.neutral)

    @property
    def reference(self) -> Array:
        """The configuration that the robot is to be at [nq]."""
        return self._q.copy()

    def reset(self, q: Any) -> None:
        """Begin anew, at rest at a measured configuration.

        Raises:
            ShapeError, NotFiniteError, RotationError: no configuration; nothing is changed.
        """
        q = self._robot.configuration("q", q)
        self.controller.reset(q)
        self._q, self._v, self._sum = q, np.zeros(self._robot.nv), np.zeros(self._robot.nv)
        self._before = deque([(q, self._v)] * (self._late + 1), maxlen=self._late + 1)
        self._pending = deque[Array](maxlen=self._late)
        self._measured, self._stopped, self._a = q, False, np.zeros(self._robot.nv)

    def step(self, q: Any, v: Any = None) -> ServoStep:
        """One period: a tick at the reference, and the command that lets the robot follow it.

        Args:
            q: measured configuration. v: measured velocity; default: from two measurements.

        Raises:
            ShapeError, NotFiniteError, RotationError: no configuration or velocity; nothing is changed.
        """
        q = self._robot.configuration("q", q)
        speed = (
            pin.difference(self._model, self._measured, q) / self._dt
            if v is None
            else validation.real_array("v", v, (self._robot.nv,))
        )
        self._measured = q
        where, rate = self._before[0]
        error = np.asarray(pin.difference(self._model, q, where))
        behind = float(np.abs(error).max(initial=0.0))
        self._stopped |= behind >= self._far
        pace = 0.0 if self._stopped else min(1.0, (self._far - behind) / (self._far - self._near))
        step = self.controller.step(self._q, self._v)
        before, self._v = self._v, self._limited(step.v * pace) if pace < 1.0 else step.v.copy()
        change = (self._v - before) / self._dt
        self._q = np.asarray(pin.integrate(self._model, self._q, self._v * self._dt))
        self._a += (change - self._a) * self._dt / (self._delay + self._dt)
        ahead = np.asarray(pin.integrate(self._model, self._q, self._v * self._delay)), self._v + self._a * self._delay
        self._before.append(ahead)
        if behind < self._near:
            self._sum += error * self._dt
        following = Following.STOPPED if self._stopped else Following.CLOSE if pace == 1.0 else Following.SLOWED
        return ServoStep(Command(self.kind, self._values(ahead, error, rate - speed, change)), step, following, error)

    def _limited(self, wanted: Array) -> Array:
        """A velocity that the joints can take from the last one within their accelerations."""
        change = self._most * self._dt
        return np.asarray(np.clip(wanted, self._v - change, self._v + change))

    def _values(self, ahead: tuple[Array, Array], error: Array, rate_error: Array, change: Array) -> Array:
        """What the servos get."""
        (q, v), w = ahead, self._w
        if self.kind is CommandKind.POSITION:
            lead = self._lag * v + self._lag * w * error + w * self._sum
            return np.asarray(pin.integrate(self._model, q, lead))
        # The error when this takes hold: what was commanded against it and has not taken hold yet is still to come
        pending = np.array(self._pending).reshape(-1, error.size)
        if self.kind is CommandKind.VELOCITY:
            error = error - pending.sum(axis=0) * self._dt
            against = w * error + 0.25 * w * w * self._sum
            self._pending.append(against)
            return v + self._lag * self._a + against
        left = self._dt * (np.arange(len(pending), 0.0, -1.0) - 0.5)[:, None]
        error = error + rate_error * self._delay - (pending * left).sum(axis=0) * self._dt
        rate_error = rate_error - pending.sum(axis=0) * self._dt
        against = 2.0 * w * rate_error + w * w * error + w**3 / SLOWER * self._sum
        self._pending.append(against)
        a = change + against
        torque = pin.rnea(self._model, self._data, q, v, a)
        return np.asarray(torque + self._armature * a + self._damping * v)
