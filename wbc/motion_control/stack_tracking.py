"""This package's torque stack on a motion: one posture with its velocity and acceleration, within torque limits."""

from __future__ import annotations

import numpy as np

from wbc.api import Stack
from wbc.motion_control.motion import Motion, checked_dynamics, checked_gains, checked_motion, measured
from wbc.robot import Robot
from wbc.tasks import JointLimits, Posture, TorqueLimits
from wbc.validation import Array


class StackTracking:
    """A stack that follows a motion of the joints: docs/torque.md.

    Args:
        robot: the model that is believed. motion: what to follow; it is not to leave the limits of the joints.
        dt: step [s]. stiffness [1/s^2], damping [1/s]. backend: see :meth:`wbc.Stack.compile`.

    Raises:
        RangeError: gains or a step with which the error does not die away; negative masses, a singular mass matrix.
        UnsupportedJointError: a base that is neither fixed nor floating, coupled joints.
        ShapeError, NotFiniteError, RotationError: a motion of another robot.
    """

    def __init__(
        self, robot: Robot, motion: Motion, dt: float, *, stiffness: float, damping: float, backend: str = "auto"
    ) -> None:
        self.motion = checked_motion(robot, motion)
        self._robot = checked_dynamics(robot, motion(0.0)[0])
        self.stiffness, self.damping, self.dt = checked_gains(stiffness, damping, dt)
        stack = Stack(robot, dt=self.dt)
        stack.add(Posture(), name="motion")
        limits = robot.limits
        if np.isfinite(limits.effort[robot.base_nv :]).any():
            stack.add(TorqueLimits())
        if np.isfinite([limits.position_lower, limits.position_upper, limits.velocity]).any():
            stack.add(JointLimits())
        self.controller = stack.compile(command="torque", backend=backend)
        self.controller.reset(motion(0.0)[0])
        self._handle = self.controller["motion"]
        self._handle.set(stiffness=self.stiffness, damping=self.damping)

    def command(self, time: float, q: Array, v: Array) -> Array:
        """Torques ``[nv]``.

        Raises:
            ShapeError, NotFiniteError, RangeError, RotationError: no measurement.
        """
        q, v = measured(self._robot, q, v)
        wanted, rate, acceleration = self.motion(time)
        self._handle.set(target=wanted, feedforward=rate, acceleration=acceleration)
        return np.asarray(self.controller.step(q, v).torque)
