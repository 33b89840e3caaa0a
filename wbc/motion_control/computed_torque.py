"""Computed torque: the model's torques for an acceleration that removes the error.

    tau = M(q) (a_d + damping (v_d - v) + stiffness (q_d (-) q)) + h(q, v)

A floating base has no motor: its acceleration is the one that needs no force, M_bb a_b = -(M_bj a_j + h_b), and the
joints follow. Source: Luh, Walker and Paul 1980; of free bases, Umetani and Yoshida 1989.
"""

from __future__ import annotations

import numpy as np

from wbc.motion_control.motion import Motion, checked_dynamics, checked_gains, checked_motion, measured
from wbc.multibody import mass_matrix, pin
from wbc.robot import Robot
from wbc.validation import Array


class ComputedTorque:
    """Follows a motion with the model of a robot.

    Args:
        robot: the model that is believed. motion: what to follow. dt: step [s]. stiffness [1/s^2], damping [1/s].

    Raises:
        RangeError: gains or a step with which the error does not die away; negative masses, a singular mass matrix.
        UnsupportedJointError: a base that is neither fixed nor floating, coupled joints.
        ShapeError, NotFiniteError, RotationError: a motion of another robot.
    """

    def __init__(self, robot: Robot, motion: Motion, dt: float, *, stiffness: float, damping: float) -> None:
        self.motion = checked_motion(robot, motion)
        self._robot = checked_dynamics(robot, motion(0.0)[0])
        self.stiffness, self.damping, self.dt = checked_gains(stiffness, damping, dt)
        self._model, self._data, self._base = robot.model, robot.model.createData(), robot.base_nv

    def command(self, time: float, q: Array, v: Array) -> Array:
        """Torques ``[nv]``, 0 for a floating base.

        Raises:
            ShapeError, NotFiniteError, RangeError, RotationError: no measurement.
        """
        q, v = measured(self._robot, q, v)
        wanted, rate, acceleration = self.motion(time)
        error = pin.difference(self._model, q, wanted)
        a = acceleration + self.damping * (rate - v) + self.stiffness * error
        M = mass_matrix(self._model, self._data, q)
        h, base = np.array(pin.nonLinearEffects(self._model, self._data, q, v)), slice(0, self._base)
        if self._base:
            a[base] = -np.linalg.solve(M[base, base], M[base, self._base :] @ a[self._base :] + h[base])
        tau = M @ a + h
        tau[base] = 0.0
        return np.asarray(tau)
