"""A reference between the tick and a robot's servos: kept, integrated, and followed with feedback from measurement."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
import pinocchio as pin

from wbc import validation
from wbc.controller import Controller, Step
from wbc.errors import BoundsError, RangeError, UnsupportedJointError
from wbc.servo.laws import Feedback, quickness
from wbc.servo.response import PER_JOINT, SHOWN, Identification, Response
from wbc.simulation import Command, CommandKind
from wbc.validation import Array

log = logging.getLogger("wbc")

#: No delay is longer than this [s]
LONGEST_DELAY = 0.05
#: A response that nobody told is looked for after so much motion, see :attr:`Identification.motion` [rad^2/s],
ENOUGH = 0.05
#: as it was over the last [s],
MEMORY = 5.0
#: again after so many periods,
EVERY = 20
#: and taken on with this time constant [s]
TAKEN_ON = 0.1
#: Friction is all there at several times this speed [rad/s, m/s]
CREEP = 0.01
#: Part of its speed that a reference keeps until it is stopped: it does not wait for ever for a robot that is stuck
SLOWEST = 0.2
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

        servo = Servo(controller, "position")
        servo.reset(q)
        while True:
            driver.send(servo.step(driver.positions()).command.values)

    The controller's ticks are taken at a reference r that nothing disturbs, dr/dt = v, a = dv/dt: limits count from it.
    With e = r(t) (-) q, where r(t) is what was to be reached now when the command of D ago was sent, and the correction
    d of :class:`wbc.servo.laws.Feedback`, the robot gets

        position   u = r (+) (T v + f + d)          velocity   u = v + T a + f + d
        torque     u = (M(r) + armature) (a + d) + h(r, v) + damping v

    at r(t + D), with f = C (M a + c) + S g + F sign(v), see :class:`Response`. z = int e dt makes up for what nobody
    told.

    Where the robot is farther behind than ``divergence[0]`` the reference slows down, z stands and no correction is
    larger than for that distance; at ``divergence[1]`` the reference brakes, and stays where it is until :meth:`reset`.

    Attributes:
        response: that is counted on, as told or as found so far: to be told next time.

    Args:
        controller: compiled; it belongs to the servo from now on, apart from its run-time values.
        kind: what the servos take: "position", "velocity" or "torque".
        response: see :func:`wbc.servo.identify`. Default: of positions and velocities it is found while the robot
            moves; of torques, which show none, only a delay counts, 0 unless it is told.
        divergence: distance behind the reference at which it begins to wait, and at which it stops [rad or m].
        armature: of motors, where the model has none, nv numbers or one [kg m^2]. damping: of joints [N m s]. Both for
            torques only.

    Raises:
        UnknownNameError: another kind. UnsupportedJointError: a base that moves, which no servo holds.
        ShapeError, NotFiniteError, RangeError, BoundsError: arguments that make no sense.
    """

    def __init__(
        self,
        controller: Controller,
        kind: str | CommandKind,
        *,
        response: Response | None = None,
        learn: bool | None = None,
        divergence: tuple[float, float] = (0.1, 0.3),
        armature: Any = 0.0,
        damping: Any = 0.0,
    ) -> None:
        self.kind = CommandKind(validation.one_of("kind", str(kind), [str(one) for one in CommandKind]))
        validation.instance("controller", controller, Controller, "a compiled stack")
        self.controller, self._robot, self._dt = controller, controller.stack.robot, controller.stack.dt
        self._model, nv = self._robot.model, self._robot.nv
        if self._robot.base != "fixed":
            raise UnsupportedJointError(
                "controller", self._robot.base, "no servo holds a base that moves: expected a fixed one"
            )
        near, far = validation.ordinary_array("divergence", divergence, (2,)).tolist()
        if not 0.0 < near < far:
            raise BoundsError("divergence", divergence, "expected 0 < where it waits < where it stops")
        self._near, self._far = near, far
        self._armature, self._damping = (
            _each(name, value, nv) for name, value in (("armature", armature), ("damping", damping))
        )
        self._data = self._model.createData()
        known = self._robot.limits.acceleration
        self._brake = np.where(np.isfinite(known), known, PLAIN)
        told = validation.instance("response", response or Response(), Response, "a wbc.servo.Response")
        self._delay = None if response is None else told.delay
        self._learns = not told.of_joints if learn is None else learn
        for name in PER_JOINT:
            _each(f"response.{name}", getattr(told, name), nv)
        validation.scalar("response.delay", told.delay, high=LONGEST_DELAY, unit="s")
        if not np.isfinite(known).all():
            joint = self._robot.dof_names[int(np.argmin(np.isfinite(known)))]
            log.warning("%s has no acceleration limit: its reference may jump, which no servo follows", joint)
        self._most = round(LONGEST_DELAY / self._dt) + 1
        self._respond(told)
        self.reset(self._robot.neutral)

    @property
    def reference(self) -> Array:
        """The configuration that the robot is to be at [nq]."""
        out: Array = self._q.copy()
        return out

    def reset(self, q: Any) -> None:
        """Begin anew, at rest at a measured configuration. What was found of the response is kept.

        Raises:
            ShapeError, NotFiniteError, RotationError: no configuration; nothing is changed.
        """
        q, nv = self._robot.configuration("q", validation.ordinary_array("q", q)), self._robot.nv
        self.controller.reset(q)
        shown = SHOWN[self.kind]
        self._identification = Identification(nv, self._dt, LONGEST_DELAY, MEMORY, shown) if self._learns else None
        self._q: Array = q
        self._v, self._a, self._wanted, self._sum = np.zeros((4, nv))
        self._measured, self._command, self._moved, self._asked = q, q, *np.zeros((2, nv))
        self._stopped, self._ticks = False, 0
        #: The last references and corrections, the oldest first
        self._references = [(q, self._v, self._a)] * self._most
        self._sent = np.zeros((self._most, nv))

    def step(self, q: Any, v: Any = None) -> ServoStep:
        """One period: a tick at the reference, and the command that lets the robot follow it.

        Args:
            q: measured configuration. v: measured velocity; default: from two measurements of q.

        Raises:
            ShapeError, NotFiniteError, RotationError: no configuration or velocity; nothing is changed.
        """
        q = self._robot.configuration("q", validation.ordinary_array("q", q))
        given = None if v is None else validation.ordinary_array("v", v, (self._robot.nv,))
        moved = pin.difference(self._model, self._measured, q)
        speed = moved / self._dt if given is None else given
        self._measured, self._moved = q, self._moved + moved
        where, rate, _ = self._ahead(*self._references[-1 - self._late])
        error = np.asarray(pin.difference(self._model, q, where))
        behind = float(np.abs(error).max(initial=0.0))
        self._stopped |= behind >= self._far
        farther = max(0.0, (behind - self._near) / (self._far - self._near))
        pace = 0.0 if self._stopped else 1.0 - (1.0 - SLOWEST) * farther
        step = self._tick(pace)
        if behind < self._near:
            self._sum += error * self._dt
        sent = self._sent[self._most - self._late :]
        d, b = self._feedback.correction(error, rate - speed, self._sum, sent, self._near)
        self._sent[:-1] = self._sent[1:]
        self._sent[-1] = d
        values = self._values(d, b)
        if self._identification is not None and not self._stopped:
            self._learn(self._identification, values, q, speed)
        following = Following.STOPPED if self._stopped else Following.CLOSE if pace == 1.0 else Following.SLOWED
        return ServoStep(Command(self.kind, values), step, following, error)

    def _tick(self, pace: float) -> Step:
        """The reference one period on, at a part of the tick's velocity."""
        # From what was wanted last, not from the part that was taken: that would be cut again in every tick
        step, before = self.controller.step(self._q, self._wanted), self._v
        self._wanted = step.v
        change = self._brake * self._dt
        self._v = step.v.copy() if pace == 1.0 else np.asarray(np.clip(pace * step.v, before - change, before + change))
        self._change = (self._v - before) / self._dt
        # Smoothed over the time that it is extrapolated by
        self._a = self._a + (self._change - self._a) / (self._late + 1.0)
        self._q = np.asarray(pin.integrate(self._model, self._q, self._v * self._dt))
        self._references.append((self._q, self._v, self._a))
        del self._references[0]
        return step

    def _ahead(self, q: Array, v: Array, a: Array) -> tuple[Array, Array, Array]:
        """Where a reference is D later, how fast, and its acceleration."""
        late = self._late * self._dt
        return np.asarray(pin.integrate(self._model, q, late * (v + 0.5 * late * a))), v + late * a, a

    def _loads(self, q: Array, v: Array, a: Array) -> Array:
        """What compliance, sag, friction and damping answer to ``[4, nv]``."""
        gravity = pin.computeGeneralizedGravity(self._model, self._data, q).copy()
        moved = pin.rnea(self._model, self._data, q, v, a) - gravity
        return np.array([moved, gravity, v / (np.abs(v) + CREEP), v])

    def _values(self, d: Array, b: Array) -> Array:
        """What the servos get."""
        q, v, a = self._ahead(*self._references[-1])
        if self.kind is CommandKind.TORQUE:
            a = self._change + d
            moved, gravity, *_ = loads = self._loads(q, v, a)
            own = self._armature * a + self._damping * v
            return np.asarray(moved + gravity + own + (self._yields * loads).sum(axis=0))
        a = a + b
        if self._yields.any():
            d = d + (self._yields * self._loads(q, v, a)).sum(axis=0)
        if self.kind is CommandKind.VELOCITY:
            return np.asarray(v + self._lag * a + d)
        return np.asarray(pin.integrate(self._model, q, self._lag * v + d))

    def _respond(self, response: Response) -> None:
        """Count on a response."""
        self.response, self._late = response, round(response.delay / self._dt)
        self._lag, *yields = response.rows(self._robot.nv)
        self._yields = np.array(yields)
        w = quickness(self.kind, self._dt, response, self._delay is not None)
        self._feedback = Feedback(self.kind, self._dt, self._lag, self._late, w)

    def _learn(self, found: Identification, values: Array, q: Array, v: Array) -> None:
        """Find lag and delay while the robot moves, and take them on slowly."""
        a = found.slope(v)
        loads = self._loads(q, v, np.zeros_like(v))
        resting = pin.rnea(self._model, self._data, q, np.zeros_like(v), a) - loads[1]
        if self.kind is CommandKind.POSITION:
            self._asked = self._asked + pin.difference(self._model, self._command, values)
            self._command = values
            found.add(self._asked, self._moved, loads, resting)
        elif self.kind is CommandKind.VELOCITY:
            found.add(values, v, loads, resting)
        else:
            found.add(values, loads[0] + loads[1] + self._damping * v, loads, resting, resting + self._armature * a)
        self._ticks += 1
        if self._ticks % EVERY == 0 and found.motion > ENOUGH:
            self._respond(self.response.towards(found.response(self._delay), EVERY * self._dt / TAKEN_ON))


def _each(field: str, value: Any, nv: int) -> Array:
    """One number at least 0 for each degree of freedom, from one or from nv."""
    number = validation.ordinary_array(field, value)
    if number.shape not in ((), (nv,)):
        validation.real_array(field, value, (nv,))
    if (number < 0.0).any():
        raise RangeError(field, value, "expected at least 0")
    return np.broadcast_to(number, (nv,)).copy()
