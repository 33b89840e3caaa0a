"""A reference between the tick and a robot's servos: kept, integrated, and followed with feedback from measurement."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np

from wbc import validation
from wbc.controller import Step
from wbc.controller.compiled_stack import CompiledStack
from wbc.errors import BoundsError, RangeError, UnsupportedJointError
from wbc.multibody import pin
from wbc.sealed import Sealed
from wbc.servo.laws import Feedback, quickness
from wbc.servo.response import ENOUGH, PER_JOINT, SHOWN, Identification, Response
from wbc.simulation import Command, CommandKind
from wbc.validation import Array

log = logging.getLogger("wbc")

#: No delay is longer than this [s]
LONGEST_DELAY = 0.05
#: A response that nobody told is looked for as it was over the last [s],
MEMORY = 5.0
#: again after [s],
EVERY = 0.02
#: and taken on with this time constant [s],
TAKEN_ON = 0.1
#: its delay by at most so many seconds a second: a reference that is asked for earlier runs faster meanwhile
CATCHES_UP = 0.2
#: A response is checked by what follows after so much motion, see :attr:`Identification.motion` [rad^2/s, rad^2/s^3]
CHECKED = {CommandKind.POSITION: 0.02, CommandKind.VELOCITY: 0.5, CommandKind.TORQUE: 1.0}
#: It is doubted where another one predicts what follows with this part of its squared error,
BETTER = 1.0 / 16.0
#: so many times one after another
TIMES = 3
#: Part of their limits up to which joints make up for an error
ROOM = 1.1
#: Friction is all there at several times this speed [rad/s, m/s]
CREEP = 0.01
#: A joint of a stopped robot runs away that moves away at so many times its limit,
RUNS = 0.5
#: farther off than so many times where it was stopped
AWAY = 3.0
#: for so long [s]
LASTS = 0.05
#: Part of its speed that a reference keeps until it is stopped: it does not wait for ever for a robot that is stuck
SLOWEST = 0.2
#: Acceleration of braking where a joint has no limit [rad/s^2, m/s^2]
PLAIN = 10.0


#: What is counted on where nothing was told
UNKNOWN = Response(doubt=LONGEST_DELAY)
#: A response whose delay is doubted by so much is not counted on [s]
DOUBTFUL = 0.5 * LONGEST_DELAY
UNCONFIRMED = "what was found is not confirmed yet by what followed"


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


class Servo(Sealed):
    """Lets a robot follow a controller through servos of positions, velocities or torques.

        servo = Servo(controller, "position")
        servo.reset(q)
        while True:
            driver.send(servo.step(driver.positions()).command.values)

    The controller's ticks are taken at a reference r that nothing disturbs, dr/dt = v, a = dv/dt: limits count from it.
    With e = r(t) (-) q, where r(t) is what was to be reached now when the command of D ago was sent, and the
    corrections d and b of :class:`wbc.servo.laws.Feedback`, the robot gets

        position   u = r (+) (T v + f + d)          velocity   u = v + T (a + b) + f + d
        torque     u = (M(r) + armature) (a + d) + h(r, v) + damping v + f

    (of a robot with loops the torques of motors that do that, :meth:`wbc.robot.Robot.at_motors`)

    at r(t + D), with f = C (M (a + b) + c) + S g + F sign(v) + B v, see :class:`Response`. z = int e dt makes up for
    what nobody told.

    Where the robot is farther behind than ``divergence[0]`` the reference slows down, z stands and no correction is
    larger than for that distance; at ``divergence[1]`` the reference brakes, and stays where it is until :meth:`reset`.
    A joint that runs away even then, such as one of the wrong sign, ends all feedback.

    Attributes:
        response: that is counted on, as told or as found so far: to be told next time.
        doubt: what speaks or spoke last against what was told or found, a sentence; else empty.

    Args:
        controller: compiled; it belongs to the servo from now on, apart from its run-time values.
        kind: what the servos take: "position", "velocity" or "torque".
        response: see :func:`wbc.servo.identify`. Default: it is found while the robot moves. A delay that is told
            stays; of torques it should be told, because it shows in accelerations alone. What is told is let go where
            what follows contradicts it, and the log says so.
        learn: whether the numbers of joints are found while the robot moves. Default: where none is told, or where
            what was told is let go, or its delay is in doubt by 25 ms or more. False: they are never found.
        divergence: distance behind the reference at which it begins to wait, and at which it stops [rad or m].
        armature: of motors, where the model has none, nv numbers or one [kg m^2]. damping: of joints [N m s]. Both for
            torques only.

    Raises:
        UnknownNameError: another kind. UnsupportedJointError: a base that moves, which no servo holds.
        ShapeError, NotFiniteError, RangeError, BoundsError: arguments that make no sense.
    """

    _changing = ("doubt", "response")

    def __init__(
        self,
        controller: CompiledStack,
        kind: str | CommandKind,
        *,
        response: Response | None = None,
        learn: bool | None = None,
        divergence: tuple[float, float] = (0.1, 0.3),
        armature: Any = 0.0,
        damping: Any = 0.0,
    ) -> None:
        self.kind = CommandKind(validation.one_of("kind", str(kind), [str(one) for one in CommandKind]))
        validation.instance("controller", controller, CompiledStack, "a compiled stack")
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
        told = validation.instance("response", response or UNKNOWN, Response, "a wbc.servo.Response")
        self._trusted = told.doubt < DOUBTFUL
        self._delay: float | None = told.delay if self._trusted else None
        self.doubt = "" if self._trusted else UNCONFIRMED
        self._learns = not (self._trusted and told.of_joints) if learn is None else learn
        self._may_learn = learn is not False
        for name in PER_JOINT:
            _each(f"response.{name}", getattr(told, name), nv)
        validation.scalar("response.delay", told.delay, high=LONGEST_DELAY, unit="s")
        if response is not None and not self._trusted:
            log.warning("the response told, %s, is not counted on: its delay is in doubt, and is found anew", told)
            told = UNKNOWN
        if not np.isfinite(known).all():
            joint = self._robot.dof_names[int(np.argmin(np.isfinite(known)))]
            log.warning("%s has no acceleration limit: its reference may jump, which no servo follows", joint)
        self._most, self._every = round(LONGEST_DELAY / self._dt) + 1, max(1, round(EVERY / self._dt))
        self._room = ROOM * self._robot.limits.velocity
        self.response = self._counted = told
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
        self._identification = Identification(nv, self._dt, LONGEST_DELAY, MEMORY, SHOWN[self.kind])
        self._rivals, self._verdicts = [self._counted, UNKNOWN], 0
        self._q: Array = q
        self._v, self._a, self._wanted, self._sum = np.zeros((4, nv))
        self._measured, self._command, self._moved, self._asked = q, q, *np.zeros((2, nv))
        self._stopped, self._lost, self._ticks, self._away = False, False, 0, 0
        self._set_feedback()
        #: How far ahead the reference is asked for now [s], and T, C, S, F and B as they are taken on
        self._lead, self._rows = self._late * self._dt, self._found.copy()
        #: The last references as they were asked for, and the last corrections, the oldest first
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
        where, rate, _ = self._references[-1 - self._late]
        error = np.asarray(pin.difference(self._model, q, where))
        behind = float(np.abs(error).max(initial=0.0))
        if behind >= self._far and not self._stopped:
            self._stopped = True
            self._set_feedback()
        farther = max(0.0, (behind - self._near) / (self._far - self._near))
        pace = 0.0 if self._stopped else 1.0 - (1.0 - SLOWEST) * farther
        step = self._tick(pace)
        part = self._feedback.within(error, -self._room - rate, self._room - rate, self._near)
        if behind < self._near:
            self._sum += part * self._dt
        sent = self._sent[self._most - self._late :]
        d, b = self._feedback.correction(part, rate - speed, self._sum, sent, self._near)
        if self._lost or self._runs_away(error, speed):
            d, b = np.zeros_like(d), np.zeros_like(b)
        self._sent[:-1] = self._sent[1:]
        self._sent[-1] = d
        values = self._values(d, b)
        if not self._stopped:
            self._learn(values, q, speed)
        following = Following.STOPPED if self._stopped else Following.CLOSE if pace == 1.0 else Following.SLOWED
        return ServoStep(Command(self.kind, values), step, following, error)

    def _runs_away(self, error: Array, speed: Array) -> bool:
        """Whether a joint of a stopped robot is driven farther and farther off by what should bring it back."""
        if not self._stopped:
            return False
        fast = np.abs(speed) > RUNS * self._robot.limits.velocity
        away = fast & (error * speed < 0.0) & (np.abs(error) > AWAY * self._far)
        self._away = self._away + 1 if away.any() else 0
        if self._away * self._dt > LASTS and not self._lost:
            self._lost = True
            joint = self._robot.dof_names[int(np.argmax(away))]
            log.warning(
                "%s runs away from its reference: feedback is off until a reset; are its sign and order right?", joint
            )
        return self._lost

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
        late = self._late * self._dt
        self._lead = min(max(late, self._lead - CATCHES_UP * self._dt), self._lead + CATCHES_UP * self._dt)
        self._references.append(self._ahead(self._q, self._v, self._a, self._lead))
        del self._references[0]
        return step

    def _ahead(self, q: Array, v: Array, a: Array, late: float) -> tuple[Array, Array, Array]:
        """Where a reference is so much later, how fast, and its acceleration."""
        return np.asarray(pin.integrate(self._model, q, late * (v + 0.5 * late * a))), v + late * a, a

    def _loads(self, q: Array, v: Array, a: Array) -> Array:
        """What compliance, sag, friction and damping answer to ``[4, nv]``."""
        gravity = pin.computeGeneralizedGravity(self._model, self._data, q).copy()
        moved = pin.rnea(self._model, self._data, q, v, a) - gravity
        return np.array([moved, gravity, v / (np.abs(v) + CREEP), v])

    def _values(self, d: Array, b: Array) -> Array:
        """What the servos get."""
        q, v, a = self._references[-1]
        if self._learns:
            self._rows += min(1.0, self._dt / TAKEN_ON) * (self._found - self._rows)
        lag, yields = self._rows[0], self._rows[1:]
        if self.kind is CommandKind.TORQUE:
            a = self._change + d
            moved, gravity, *_ = loads = self._loads(q, v, a)
            own = self._armature * a + self._damping * v
            return self._robot.at_motors(q, moved + gravity + own + (yields * loads).sum(axis=0))
        a = a + b
        if yields.any():
            d = d + (yields * self._loads(q, v, a)).sum(axis=0)
        if self.kind is CommandKind.VELOCITY:
            return np.asarray(v + lag * a + d)
        return np.asarray(pin.integrate(self._model, q, lag * v + d))

    def _respond(self, response: Response) -> None:
        """Count on a response; what nothing confirmed is to be told with all the doubt that there is."""
        self._counted, self.response = response, response if self._trusted else _doubted(response)
        self._set_feedback()

    def _set_feedback(self) -> None:
        """By what is counted on; after a stop with all doubt, and where what follows speaks against it with as much as
        what was found says.
        """
        careful = response = self._counted
        if self._stopped:
            careful = _doubted(response)
        elif self._verdicts < 0:
            found = self._rivals[1]
            careful = replace(response, doubt=max(response.doubt, found.delay + found.doubt - response.delay))
        self._late, self._found = round(response.delay / self._dt), np.array(response.rows(self._robot.nv))
        w = quickness(self.kind, self._dt, careful, self._delay is not None)
        self._feedback = Feedback(self.kind, self._dt, self._found[0], self._late, w)

    def _learn(self, values: Array, q: Array, v: Array) -> None:
        """Find the response while the robot moves, and check what is counted on."""
        found = self._identification
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
        if self._ticks % self._every == 0:
            self._check(found)
            if self._learns and found.motion > ENOUGH:
                self._respond(found.response(self._delay))

    def _check(self, found: Identification) -> None:
        """Whether what was counted on before predicts what followed as well as what was found before, or as nothing."""
        misfits = found.misfits(self._rivals, CHECKED[self.kind])
        if not misfits:
            return
        own, other = misfits[0], min(misfits[1:])
        # So many verdicts of a kind one after another, those against it below 0
        self._verdicts = min(self._verdicts, 0) - 1 if other < BETTER * own else max(self._verdicts, 0) + 1
        if self._verdicts >= TIMES and not self._trusted:
            self._trusted, self.doubt = True, "" if self.doubt == UNCONFIRMED else self.doubt
            self._respond(self._counted)
        elif self._verdicts <= -TIMES and (self._trusted or self._delay is not None):
            self._let_go(float(np.sqrt(own / other)), None if misfits[2] == other else found.response())
        self._rivals = [self._counted, found.response(), UNKNOWN]
        self._set_feedback()
        found.mark()

    def _let_go(self, times: float, better: Response | None) -> None:
        """Doubt what is counted on, say so, and count on what predicts better where there is such a one."""
        which, what = "found", "feedback is careful"
        if self._delay is not None:
            self._delay, self._learns, which, what = None, self._may_learn, "told", "it is let go"
        than = "none" if better is None else f"what was found, {better}"
        if not self._learns:
            better, what = None, "feedback is careful"
        self._trusted, self._verdicts = better is not None, 0 if better is not None else -TIMES
        said = f"the response {which}, {self._counted}, errs {times:.2g} times as much about what follows as {than}"
        if self.doubt in ("", UNCONFIRMED):
            log.warning("%s: %s", said, what)
        self.doubt = said
        self._respond(better or self._counted)


def _doubted(response: Response) -> Response:
    """With all the doubt that a delay can be in."""
    return replace(response, doubt=max(response.doubt, LONGEST_DELAY - response.delay))


def _each(field: str, value: Any, nv: int) -> Array:
    """One number at least 0 for each degree of freedom, from one or from nv."""
    number = validation.ordinary_array(field, value)
    if number.shape not in ((), (nv,)):
        validation.real_array(field, value, (nv,))
    if (number < 0.0).any():
        raise RangeError(field, value, "expected at least 0")
    return np.broadcast_to(number, (nv,)).copy()
