"""What the controllers of this package follow and what they need of a robot: a motion, and dynamics that are regular.

    e = q_d (-) q,   d2e/dt2 + damping de/dt + stiffness e = 0

of an error that is measured and corrected once a step: the gains are of 1/s^2 and 1/s, whatever the inertias are.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError, UnsupportedJointError
from wbc.identification.pseudo_inertia import is_body
from wbc.multibody import mass_matrix
from wbc.robot import Robot
from wbc.validation import Array

#: Time [s] -> configuration [nq], velocity [nv], acceleration [nv]; of a floating base only the joints' are followed
Motion = Callable[[float], tuple[Array, Array, Array]]
#: A mass matrix whose smallest eigenvalue is below this part of its largest is singular
SINGULAR = 1e-12


class TorqueController(Protocol):
    """A law that is asked once a step, in order."""

    def command(self, time: float, q: Array, v: Array) -> Array:
        """Torques ``[nv]`` at a time [s] and the measured configuration ``[nq]`` and velocity ``[nv]``."""


def largest_step(stiffness: float, damping: float) -> float:
    """The longest step [s] at which the error still dies away when accelerations are held over a step:

        dt < min(2 / damping, 2 damping / stiffness)

    by Jury's test of z^2 - (2 - d - k/2) z + (1 - d + k/2), d = damping dt, k = stiffness dt^2.
    """
    return min(2.0 / damping, 2.0 * damping / stiffness)


def checked_gains(stiffness: float, damping: float, dt: float) -> tuple[float, float, float]:
    """Gains [1/s^2, 1/s] and a step [s] with which the error dies away.

    Raises:
        ShapeError, NotFiniteError, RangeError: no such numbers; a step above :func:`largest_step`, which it names.
    """
    stiffness = validation.scalar("stiffness", stiffness, low=0.0, open_low=True, unit="1/s^2")
    damping = validation.scalar("damping", damping, low=0.0, open_low=True, unit="1/s")
    dt, most = validation.scalar("dt", dt, low=0.0, open_low=True, unit="s"), largest_step(stiffness, damping)
    if dt >= most:
        raise RangeError("dt", dt, f"too coarse for these gains: expected a step below {most:.4g} s")
    return stiffness, damping, dt


def checked_dynamics(robot: Robot, q: Array) -> Robot:
    """A robot on a fixed or floating base whose mass matrix is regular at a configuration.

    Raises:
        ShapeError: no robot. UnsupportedJointError: another base, or coupled joints. RangeError: a link of a negative
            mass, or of moments that no body has; a mass matrix that is singular, with the degree of freedom that moves
            no mass.
    """
    robot = validation.instance("robot", robot, Robot, "a wbc Robot")
    if robot.base not in ("fixed", "floating"):
        raise UnsupportedJointError("robot.base", robot.base, "torques are for a fixed or a floating base")
    robot.require_tree("torque that follows a motion")
    if robot.couplings:
        name = robot.dof_names[robot.couplings[0].follower]
        raise UnsupportedJointError("robot", name, "a joint that follows another has no torque of its own")
    for index in range(1, robot.model.njoints):
        phi, name = np.array(robot.model.inertias[index].toDynamicParameters()), str(robot.model.names[index])
        if phi[0] < 0.0:
            raise RangeError(f"robot.inertia[{name!r}].mass", float(phi[0]), "expected a mass of at least 0 kg")
        # What is without any inertia is a frame; flat and pointed bodies lie on the border of what is possible
        if phi.any() and not is_body(phi + np.array([0, 0, 0, 0, 1, 0, 1, 0, 0, 1]) * 1e-9 * np.abs(phi).max()):
            raise RangeError(f"robot.inertia[{name!r}]", phi, "no body has such moments")
    M = mass_matrix(robot.model, robot.model.createData(), q)
    values, vectors = np.linalg.eigh(M)
    if not values[0] > SINGULAR * values[-1]:
        name = robot.dof_names[int(np.abs(vectors[:, 0]).argmax())]
        raise RangeError("robot", name, f"the mass matrix is singular: nothing that weighs moves with {name}")
    return robot


def checked_motion(robot: Robot, motion: Motion) -> Motion:
    """A motion whose beginning fits the robot.

    Raises:
        ShapeError, NotFiniteError, RangeError, RotationError: it is no function, or gives other numbers.
    """
    if not callable(motion):
        raise ShapeError("motion", motion, "expected a function of time")
    state = validation.called("motion", motion, 0.0)
    if not isinstance(state, tuple) or len(state) != 3:
        raise ShapeError("motion(0)", state, "expected (q, v, a)")
    robot.configuration("motion(0).q", state[0])
    for name, value in zip("va", state[1:], strict=True):
        validation.ordinary_array(f"motion(0).{name}", value, (robot.nv,))
    return motion


def measured(robot: Robot, q: Array, v: Array) -> tuple[Array, Array]:
    """A configuration ``[nq]`` and a velocity ``[nv]`` as they were measured.

    Raises:
        ShapeError, NotFiniteError, RangeError, RotationError: they are none.
    """
    return robot.configuration("q", validation.ordinary_array("q", q)), validation.ordinary_array("v", v, (robot.nv,))
