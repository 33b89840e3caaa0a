"""What stands between a commanded torque and a joint: delay, lag, saturation, noise, gear and friction."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.robot import Robot
from wbc.validation import Array

#: A number for all joints, or one for each degree of freedom that a motor drives
PerJoint = float | tuple[float, ...] | Array


@dataclass(frozen=True, eq=False)
class Motors:
    """Motors, their gears and the friction of joints. Of a command u the torque at the joint is

        d tau / dt = (u(t - delay) - tau) / lag,     |tau + noise| <= effort (1 - tau v / (|tau| no_load_speed))
        tau - viscous v - coulomb tanh(v / slip_speed)                                         [N m; N]

    and gear^2 rotor is added to ``model.armature``. The command holds for a time step, over which the lag is
    integrated exactly; friction is that of the velocity at every instant. Every number is one for all joints or one
    for each of ``robot.nv - robot.base_nv`` degrees of freedom; a base has no motors.

    Attributes:
        effort: largest torque at rest [N m; N]; None: ``robot.limits.effort``.
        no_load_speed: speed at which none is left [rad/s; m/s]; infinite: torque does not fall with speed.
        lag: time constant of the torque [s]. delay: until a command takes hold [s], in whole time steps.
        noise: standard deviation of the torque, drawn anew in every time step [N m; N].
        viscous [N m s], coulomb [N m]: friction. slip_speed: below which Coulomb's falls off [rad/s; m/s].
        gear, rotor: ratio, and inertia of the rotor [kg m^2; kg].
    """

    effort: PerJoint | None = None
    no_load_speed: PerJoint = np.inf
    lag: float = 0.0
    delay: float = 0.0
    noise: PerJoint = 0.0
    viscous: PerJoint = 0.0
    coulomb: PerJoint = 0.0
    slip_speed: float = 0.01
    gear: PerJoint = 1.0
    rotor: PerJoint = 0.0

    @classmethod
    def described(cls, robot: Robot, **more: Any) -> Motors:
        """With the damping and the friction that the robot's description states."""
        base, model = robot.base_nv, robot.model
        return cls(viscous=np.array(model.damping[base:]), coulomb=np.array(model.friction[base:]), **more)


class PlantMotors:
    """The motors of one plant, numbers spread over all velocity coordinates.

    Args:
        time_step: of the plant [s].

    Attributes:
        armature: that the gears add ``[nv]``. damping: slope of the friction at rest, the steepest ``[nv]``.
        driven: 1 where a motor is, 0 for a base and passive joints ``[nv]``.

    Raises:
        ShapeError, NotFiniteError, RangeError: numbers that are none.
    """

    def __init__(self, motors: Motors, robot: Robot, time_step: float) -> None:
        self._robot, count = robot, robot.nv - robot.base_nv
        spread = {
            name: self._spread(name, getattr(motors, name), count)
            for name in ("no_load_speed", "noise", "viscous", "coulomb", "gear", "rotor")
        }
        efforts = robot.limits.effort[robot.base_nv :] if motors.effort is None else motors.effort
        self._effort = self._spread("effort", efforts, count)
        lag = validation.scalar("Motors.lag", motors.lag, low=0.0, unit="s")
        delay = validation.scalar("Motors.delay", motors.delay, low=0.0, unit="s")
        self._slip = validation.scalar("Motors.slip_speed", motors.slip_speed, low=0.0, open_low=True)
        self._steps = round(delay / time_step)
        if abs(self._steps - delay / time_step) > 1e-6:
            raise RangeError("Motors.delay", delay, f"expected a whole number of time steps of {time_step:g} s")
        self._follow = 1.0 if lag == 0.0 else -np.expm1(-time_step / lag)
        self._noise, self._no_load = spread["noise"], spread["no_load_speed"]
        self._viscous, self._coulomb = spread["viscous"], spread["coulomb"]
        self.armature = spread["gear"] ** 2 * spread["rotor"]
        self.damping = self._viscous + self._coulomb / self._slip
        self.driven = np.ones(robot.nv)
        self.driven[[*range(robot.base_nv), *robot.passive]] = 0.0
        self._noisy, self._slows = bool(self._noise.any()), bool(np.isfinite(self._no_load).any())
        #: Whether there is friction at all
        self.rubs = bool(self.damping.any())
        #: Whether torques depend on velocities
        self.felt = self.rubs or self._slows

    def _spread(self, name: str, value: Any, count: int) -> Array:
        field, low = f"Motors.{name}", 0.0
        numbers = validation.real_array(field, value, finite=False)
        numbers = validation.real_array(field, np.broadcast_to(numbers, (count,)) if numbers.ndim == 0 else value,
                                        (count,), finite=name not in ("effort", "no_load_speed"))  # fmt: skip
        if np.isnan(numbers).any() or (numbers < low).any() or (name == "no_load_speed" and (numbers == 0.0).any()):
            raise RangeError(
                field, value, "expected numbers of at least 0" + (" and not 0" * (name == "no_load_speed"))
            )
        rest = np.inf if name in ("effort", "no_load_speed") else 0.0
        return np.concatenate([np.full(self._robot.base_nv, rest), numbers])

    def fresh(self) -> MotorState:
        """Without a command, at no torque."""
        nothing = np.zeros(self._robot.nv)
        return MotorState(deque([nothing] * self._steps), nothing)

    def torque(self, state: MotorState, command: Array, v: Array, random: np.random.Generator) -> Array:
        """The motors' torque over the next time step ``[nv]``, and on to it in ``state``."""
        if self._steps:
            state.queue.append(command)
            command = state.queue.popleft()
        if self._follow != 1.0:
            state.torque = command = state.torque + self._follow * (command - state.torque)
        if self._noisy:
            command = command + self._noise * random.standard_normal(len(command))
        most = self._effort
        if self._slows:
            most = most * np.clip(1.0 - np.sign(command) * v / self._no_load, 0.0, 1.0)
        return np.minimum(np.maximum(command, -most), most) * self.driven

    def friction(self, v: Array) -> Array:
        """What friction takes from it ``[nv]``."""
        return self._viscous * v + self._coulomb * np.tanh(v / self._slip)


@dataclass(eq=False)
class MotorState:
    """Commands that have not taken hold yet, the oldest first, and the torque behind the lag."""

    queue: deque[Array]
    torque: Array


@dataclass(frozen=True, eq=False)
class Encoders:
    """How joints are read: q rounded to a whole multiple of the resolution after noise was added; v with noise.

    A base is read as it is: what senses it is not modelled.

    Attributes:
        position, velocity: standard deviations [rad; m], [rad/s; m/s]. resolution: [rad; m]; 0: none.
    """

    position: float = 0.0
    velocity: float = 0.0
    resolution: float = 0.0

    def __post_init__(self) -> None:
        validation.own_scalars(self, "position", "velocity", "resolution", low=0.0)

    @property
    def exact(self) -> bool:
        """Joints are read as they are."""
        return not (self.position or self.velocity or self.resolution)
