"""Quantities with limits that depend on the robot: torques, speeds of frames, and whatever is affine in acceleration.

Each says how much of its limits it uses at given states; a law carries them, and its certificate samples them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, Protocol

import casadi as ca
import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.multibody import pin
from wbc.robot.robot import Robot
from wbc.stack.evaluation import ManyStates
from wbc.symbolic.dynamics import Dynamics
from wbc.symbolic.kinematics import Kinematics, frame_index
from wbc.trajectory.laws.certificate import Check
from wbc.validation import Array

#: w(q, dq/dt, d2q/dt2), one state at a time
Function = Callable[[Array, Array, Array], Any]


class Force(Check, Protocol):
    """A check that is affine in accelerations and quadratic in velocities: A(q) a + v'B(q) v + c(q)."""

    def unit(self, column: int) -> str:
        """What a column of the ratios is, for messages."""
        ...


def at_rest(check: Check, position: Array) -> Array:
    """Ratios of a check where nothing moves, m x k."""
    still = np.zeros((len(position), position.shape[1] if position.ndim == 2 else 6))
    return check.ratios(position, still, still)


@dataclass(frozen=True, eq=False)
class TorqueCheck:
    """|M(q) a + C(q, v) v + g(q)| <= limit, by compiled inverse dynamics (armature included, joint friction not).

    Args:
        robot: its nv coordinates are those of the path. limit: nv positive numbers, inf where there is none [N m or N].
    """

    robot: Robot
    limit: Array
    name: str = "torque"

    def __post_init__(self) -> None:
        plain_coordinates(self.robot)

    @property
    def columns(self) -> int:
        return self.robot.nv

    def unit(self, column: int) -> str:
        """The joint of a column, with its limit."""
        joint = column % self.columns
        return f"{self.robot.dof_names[joint]}, whose limit is {self.limit[joint]:g}"

    def torques(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        """Generalised forces at m states, m x nv."""
        return inverse_dynamics(self.robot)(configurations(self.robot, position), velocity, acceleration)

    def ratios(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        """Both signs side by side, m x 2 nv."""
        used = self.torques(position, velocity, acceleration) / self.limit
        return np.concatenate([used, -used], axis=1)


@lru_cache(maxsize=16)
def inverse_dynamics(robot: Robot) -> ManyStates:
    """tau(q, v, a) of a robot at many states, [m x nq, m x nv, m x nv] to m x nv, as ``pin.rnea``."""
    dynamics = Dynamics(Kinematics(robot.model))
    kinematics = dynamics.kinematics
    torques = dynamics.inverse_dynamics
    return ManyStates(ca.Function("inverse_dynamics", [kinematics.q, kinematics.v, dynamics.a], [torques]))


@dataclass(frozen=True, eq=False)
class FrameSpeed:
    """|J(q) v| <= limit, the linear velocity of the origins of named frames.

    Args:
        robot: its nv coordinates are those of the path. limits: frame name -> positive speed [m/s].
    """

    robot: Robot
    limits: Mapping[str, float]
    name: str = "cartesian_speed"
    _frames: tuple[tuple[int, float], ...] = field(init=False)

    def __post_init__(self) -> None:
        plain_coordinates(self.robot)
        frames = []
        for frame, speed in self.limits.items():
            known = self.robot.check_frame("cartesian_speed", frame)
            limit = validation.scalar(f"cartesian_speed.{frame}", speed, low=0.0, open_low=True, unit="m/s")
            frames.append((frame_index(self.robot.model, known), limit))
        object.__setattr__(self, "_frames", tuple(frames))

    @property
    def columns(self) -> int:
        return len(self._frames)

    def ratios(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        model = self.robot.model
        data = model.createData()
        out = np.empty((len(position), self.columns))
        for row, q, v in zip(out, configurations(self.robot, position), velocity, strict=True):
            pin.forwardKinematics(model, data, q, v)
            for k, (frame, limit) in enumerate(self._frames):
                motion = pin.getFrameVelocity(model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
                row[k] = np.linalg.norm(motion.linear) / limit
        return out


@dataclass(frozen=True, eq=False)
class PoseSpeed:
    """|dp/dt| <= linear and |w| <= angular, along a path of poses.

    Args:
        limits: ``linear`` [m/s] and ``angular`` [rad/s], or one of them, positive.
    """

    limits: Mapping[str, float]
    name: str = "cartesian_speed"

    def __post_init__(self) -> None:
        for part, speed in self.limits.items():
            validation.one_of("cartesian_speed", part, ("linear", "angular"))
            validation.scalar(f"cartesian_speed.{part}", speed, low=0.0, open_low=True)

    @property
    def columns(self) -> int:
        return len(self.limits)

    def ratios(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        parts = {"linear": velocity[:, :3], "angular": velocity[:, 3:]}
        sizes = [np.linalg.norm(parts[part], axis=1) / limit for part, limit in self.limits.items()]
        return np.stack(sizes, axis=1)


@dataclass(frozen=True, eq=False)
class Inequality:
    """F w(q, v, a) <= g for a function w that is affine in a and quadratic in v: contact wrenches, cable forces.

    Its ratio is 1 + (F w - g) / |g|, with 1 instead of |g| where g = 0.

    Args:
        function: one state -> r numbers. matrix: F, k x r. bound: g, k. name: its entry in the certificate.

    Raises:
        ShapeError, NotFiniteError: of other shapes, or not finite.
    """

    function: Function
    matrix: Array
    bound: Array
    name: str = "inequality"

    def __post_init__(self) -> None:
        matrix = validation.ordinary_array(f"{self.name}.F", self.matrix)
        if matrix.ndim != 2:
            raise ShapeError(f"{self.name}.F", self.matrix, "expected a matrix")
        object.__setattr__(self, "matrix", matrix)
        object.__setattr__(self, "bound", validation.ordinary_array(f"{self.name}.g", self.bound, (len(matrix),)))

    @property
    def columns(self) -> int:
        return len(self.matrix)

    def unit(self, column: int) -> str:
        """The row of a column, with its bound."""
        return f"row {column} of {self.name}, whose bound is {self.bound[column]:g}"

    @cached_property
    def _size(self) -> Array:
        return np.where(self.bound == 0.0, 1.0, np.abs(self.bound))

    def ratios(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        shape = (self.matrix.shape[1],)
        states = zip(position, velocity, acceleration, strict=True)
        field = f"{self.name}.function"
        w = [validation.ordinary_array(field, self.function(*s), shape) for s in states]
        rows = np.array(w).reshape(-1, *shape) @ self.matrix.T
        return np.asarray(1.0 + (rows - self.bound) / self._size)


def plain_coordinates(robot: Robot) -> None:
    """Refuses robots whose velocity is not the derivative of nv coordinates.

    Raises:
        RangeError: a joint such as a free flyer.
    """
    model = robot.model
    for j in range(1, model.njoints):
        if model.nvs[j] > 1 and model.nqs[j] != model.nvs[j]:
            raise RangeError("robot", str(model.names[j]), "a path of coordinates needs joints of one axis each")


def configurations(robot: Robot, coordinates: Array) -> Any:
    """Configurations (nq) at m x nv coordinates: unbounded joints are given by their angle."""
    if robot.nq == robot.nv:
        return coordinates
    zero = pin.neutral(robot.model)
    return np.array([pin.integrate(robot.model, zero, c) for c in coordinates]).reshape(-1, robot.nq)
