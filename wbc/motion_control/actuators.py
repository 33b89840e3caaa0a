"""Which load and which speed of a motion the motors of a robot allow, under limits of torque and voltage.

    T = inertia gear s^2 a + friction gear s v + (g(q) + s^2 d(q, v, a)) / gear        |T| <= torque
    u = resistance / constant T + constant gear s v                                    |u| <= voltage

of every joint, for a motion q(s t) with v and a at s = 1; g and d are what gravity and motion ask of the joint, affine
in the mass m of the load. So rows are polynomials of second degree in s, affine in m: both bounds have closed forms.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from math import inf
from typing import NamedTuple

import numpy as np

from wbc import validation
from wbc.errors import DuplicateNameError, RangeError, ShapeError, UnsupportedJointError
from wbc.motion_control.motion import Motion, checked_dynamics, checked_motion
from wbc.motion_control.trial import loaded
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.validation import Array

#: Rows of a joint
ROWS = ("torque", "voltage")
UNITS = {"torque": "N m", "voltage": "V"}


@dataclass(frozen=True)
class Actuator:
    """A direct-current motor with its gear, as catalogues have it.

    Attributes:
        torque: largest of the motor [N m]. voltage: largest [V]. constant: of torque and back-EMF [N m/A = V s/rad].
        resistance [ohm]. gear: angle of the motor for 1 rad or 1 m of the joint. inertia: of the rotor [kg m^2].
        friction: viscous, of the motor [N m s].

    Raises:
        NotFiniteError, RangeError: a number that is not above 0, or inertia or friction below.
    """

    torque: float
    voltage: float
    constant: float
    resistance: float
    gear: float = 1.0
    inertia: float = 0.0
    friction: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            validation.scalar(f"Actuator.{name}", value, low=0.0, open_low=name not in ("inertia", "friction"))


def read_actuators(robot: Robot, texts: Sequence[str]) -> dict[str, Actuator]:
    """Joint -> motor, from texts such as ``"1,48,0.05,0.4,100"`` or ``"elbow=0.5,48,0.05,0.4"``: the fields of
    :class:`Actuator` in their order, at least four; a text without a joint is for all joints that have none.

    Raises:
        ShapeError: a text that is none of these. UnknownNameError: no such joint. DuplicateNameError: two motors of one
            joint, or two for all others. NotFiniteError, RangeError: as of :class:`Actuator`.
    """
    found: dict[str, Actuator] = {}
    for text in validation.items("motor", texts, "texts"):
        joint, _, numbers = text.rpartition("=")
        try:
            values = [float(number) for number in numbers.split(",")]
        except ValueError:
            values = []
        if not 4 <= len(values) <= len(fields(Actuator)):
            raise ShapeError("motor", text, "expected 4 to 7 numbers with commas, such as elbow=0.5,48,0.05,0.4")
        if joint:
            validation.one_of("motor", joint, robot.dof_names)
        if joint in found:
            raise DuplicateNameError("motor", text, f"two motors of {joint or 'all other joints'}")
        found[joint] = Actuator(*values)
    others = found.pop("", None)
    return (dict.fromkeys(robot.dof_names, others) if others is not None else {}) | found


class Bound(NamedTuple):
    """A largest load or speed, and what binds there.

    Attributes:
        value: [kg], or times the motion's own speed; infinite where nothing binds. joint: "" then. row: of
            :data:`ROWS`. time: of the motion at its own speed [s].
    """

    value: float
    joint: str = ""
    row: str = ""
    time: float = 0.0


@dataclass(frozen=True, eq=False)
class ActuatorSizing:
    """A motion of a robot on a fixed base with given motors; limits are looked at, at evenly spaced times.

    Attributes:
        robot: its armature counts for nothing, that of the motors does. motion: followed for ``seconds`` [s].
        actuators: joint name -> :class:`Actuator`, or one for all joints. frame: where the load is; default: the tip.
        samples: of the motion.

    Raises:
        UnknownNameError: a joint or frame that is not there. RangeError: a joint without an actuator, fewer than two
            samples, a singular mass matrix. UnsupportedJointError: a base that moves, coupled joints.
    """

    robot: Robot
    motion: Motion
    seconds: float
    actuators: Mapping[str, Actuator] | Actuator
    frame: str | None = None
    samples: int = 1001
    #: Parts of the limits that are used, polynomials in s ``[3, samples, joints, rows]``: without load, and for 1 kg
    _rows: tuple[Array, Array] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        robot, motion = self.robot, checked_motion(self.robot, self.motion)
        checked_dynamics(robot, motion(0.0)[0])
        if robot.base != "fixed":
            raise UnsupportedJointError("robot.base", robot.base, "motors are sized for a robot on a fixed base")
        validation.scalar("seconds", self.seconds, low=0.0, open_low=True, unit="s")
        validation.integer("samples", self.samples, low=2)
        one = self.actuators
        alike = isinstance(one, Actuator)
        given = dict.fromkeys(robot.dof_names, one) if alike else validation.mapping("actuators", one)
        for name, actuator in given.items():
            validation.one_of("actuators", name, robot.dof_names)
            validation.instance(f"actuators.{name}", actuator, Actuator, "an Actuator")
        for name in robot.dof_names:
            if name not in given:
                raise RangeError("actuators", tuple(given), f"expected one of {name} too")
        columns = np.array([list(vars(given[name]).values()) for name in robot.dof_names]).T
        torque, voltage, constant, resistance, gear, inertia, friction = columns
        parts = []
        for machine in (robot, loaded(robot, 1.0, frame=self.frame)):
            model = machine.model.copy()
            model.armature = np.zeros(model.nv)
            data, still = model.createData(), np.zeros(model.nv)
            rows = []
            for q, v, a in map(motion, self.times):
                gravity = np.array(pin.rnea(model, data, q, still, still))
                rows.append((gravity, v, a, np.array(pin.rnea(model, data, q, v, a)) - gravity))
            g, v, a, d = (np.array(column) for column in zip(*rows, strict=True))
            T = np.array([g / gear, friction * gear * v, inertia * gear * a + d / gear])
            u = resistance / constant * T
            u[1] += constant * gear * v
            parts.append(np.stack([T / torque, u / voltage], axis=-1))
        object.__setattr__(self, "_rows", (parts[0], parts[1] - parts[0]))

    @property
    def times(self) -> Array:
        """At which limits are looked at ``[samples]`` [s]."""
        return np.linspace(0.0, self.seconds, self.samples)

    def used(self, speed: float = 1.0, payload: float = 0.0) -> Array:
        """Parts of the limits of torque and voltage, with signs, ``[samples, joints, 2]``.

        Raises:
            NotFiniteError, RangeError: a speed or a payload [kg] below 0.
        """
        speed = validation.scalar("speed", speed, low=0.0)
        own, more = (np.tensordot(speed ** np.arange(3), part, 1) for part in self._rows)
        return np.asarray(own + validation.scalar("payload", payload, low=0.0, unit="kg") * more)

    def largest_load(self, speed: float = 1.0) -> Bound:
        """The largest mass at the frame with which the motion is possible at so many times its speed.

        Raises:
            NotFiniteError, RangeError: a speed below 0; no load at all is possible, with the joint, and what it needs.
        """
        own, more = self.used(speed), self.used(speed, 1.0)
        more = more - own
        with np.errstate(divide="ignore", invalid="ignore"):
            most = np.where(more == 0.0, np.where(np.abs(own) <= 1.0, inf, -inf), (np.sign(more) - own) / more)
            least = np.where(more == 0.0, 0.0, (-np.sign(more) - own) / more)
        if max(float(least.max()), 0.0) > most.min():
            self._refuse("speed", speed, own)
        return self._bound(most)

    def largest_speed(self, payload: float = 0.0) -> Bound:
        """How many times its own speed the motion may have with a mass at the frame, and at every lower speed too.

        Raises:
            NotFiniteError, RangeError: a payload [kg] below 0; the robot cannot stand still with it, with the joint,
                and what it needs.
        """
        at_rest = self.used(0.0, payload)
        if np.abs(at_rest).max() > 1.0:
            self._refuse("payload", payload, at_rest)
        c, b, a = (own + payload * more for own, more in zip(*self._rows, strict=True))
        return self._bound(np.minimum(_first_root(a, b, c - 1.0), _first_root(-a, -b, -c - 1.0)))

    def _bound(self, values: Array) -> Bound:
        k, joint, row = np.unravel_index(int(values.argmin()), values.shape)
        value = float(values[k, joint, row])
        if value == inf:
            return Bound(inf)
        return Bound(value, self.robot.dof_names[joint], ROWS[row], float(self.times[k]))

    def _refuse(self, field: str, value: float, used: Array) -> None:
        k, joint, row = np.unravel_index(int(np.abs(used).argmax()), used.shape)
        name, kind, part = self.robot.dof_names[joint], ROWS[row], float(abs(used[k, joint, row]))
        actuator = self.actuators if isinstance(self.actuators, Actuator) else self.actuators[name]
        has, unit = getattr(actuator, kind), UNITS[kind]
        if part > 1.0:
            reason = f"{name} needs {part * has:.3g} {unit} at {self.times[k]:.3g} s and has {has:.3g} {unit}"
        else:
            reason = "no load fits: some joints need one of at least, others of at most, so much"
        raise RangeError(field, value, reason)


def _first_root(a: Array, b: Array, c: Array) -> Array:
    """The least s > 0 at which a s^2 + b s + c, not above 0 at s = 0, gets above it; infinite where it never does."""
    inside = b * b - 4.0 * a * c
    with np.errstate(divide="ignore", invalid="ignore"):
        # Without cancellation: c <= 0, and q has the sign of b
        q = -0.5 * (b + np.where(b >= 0.0, 1.0, -1.0) * np.sqrt(np.maximum(inside, 0.0)))
        roots = np.stack([q / a, c / q])
        slope = 2.0 * a * roots + b
    rises = (slope > 0.0) | ((slope == 0.0) & (a > 0.0))
    passes = (inside >= 0.0) & np.isfinite(roots) & (roots >= 0.0) & rises
    return np.asarray(np.where(passes, roots, inf).min(axis=0))
