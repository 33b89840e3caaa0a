"""Operational-space impedance: a frame yields to what pushes it as a spring and damper would, and the rest follows.

    tau = J'F + N'M (a_d + 2 w (v_d - v) + w^2 (q_d (-) q)) + h
    F = Lambda (dx2_d - dJ/dt v) + D (dx_d - dx) + K (x_d (-) x),  Lambda = (J M^-1 J')^-1,  N = 1 - M^-1 J'Lambda J

x_d is where the motion has the frame. An outer wrench f moves it as Lambda d2e/dt2 + D de/dt + K e = f, whatever the
other joints do. D is critical: D = 2 sqrt(Lambda) sqrt(sqrt(Lambda)^-1 K sqrt(Lambda)^-1) sqrt(Lambda).
Source: Khatib 1987, A unified approach for motion and force control; D: Albu-Schaeffer et al. 2003.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError, UnsupportedJointError
from wbc.motion_control.motion import Motion, checked_dynamics, checked_gains, checked_motion, measured
from wbc.multibody import mass_matrix, pin
from wbc.robot import Robot
from wbc.symbolic.kinematics import frame_index
from wbc.validation import Array

#: Part of the largest eigenvalue of J M^-1 J' below which a direction counts as none: the frame cannot move there
DAMPED = 1e-9
_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class Impedance:
    """A frame on a spring towards where the motion has it.

    Args:
        robot: the model that is believed, on a fixed base. motion: what to follow. dt: step [s].
        frame: default: the robot's tip, else its last frame. frequency: w, of the joints besides, and of the
            frame where no stiffness is given: K = w^2 Lambda [1/s].
        stiffness: K, of translations and rotations along the world's axes ``[6]`` [N/m, N m/rad].

    Raises:
        RangeError: a frequency, or a stiffness and a step with which the error does not die away; negative masses,
            a singular mass matrix. UnsupportedJointError: a base that moves, coupled joints. UnknownNameError: no such
            frame. ShapeError, NotFiniteError, RotationError: a motion of another robot, no stiffness.
    """

    def __init__(
        self,
        robot: Robot,
        motion: Motion,
        dt: float,
        *,
        frequency: float,
        frame: str | None = None,
        stiffness: Any = None,
    ) -> None:
        self.motion = checked_motion(robot, motion)
        self._robot = checked_dynamics(robot, motion(0.0)[0])
        if robot.base != "fixed":
            raise UnsupportedJointError("robot.base", robot.base, "the joints of a base that moves bear no spring")
        w = validation.scalar("frequency", frequency, low=0.0, open_low=True, unit="1/s")
        self.frequency, self.dt = w, checked_gains(w * w, 2.0 * w, dt)[2]
        self.frame = robot.check_frame("frame", frame or robot.frames.get("tip", robot.frame_names[-1]))
        self._model, self._data, self._index = (
            robot.model,
            robot.model.createData(),
            frame_index(robot.model, self.frame),
        )
        # The motion's own kinematics
        self._wanted = robot.model.createData()
        self.stiffness: Array | None = None
        if stiffness is not None:
            K = validation.ordinary_array("stiffness", stiffness, (6,))
            if not (K > 0.0).all():
                raise RangeError("stiffness", stiffness, "expected six numbers above 0")
            self.stiffness = np.diag(K)
            q = self.motion(0.0)[0]
            J = np.array(pin.computeFrameJacobian(self._model, self._data, q, self._index, _AXES))
            inverse = J @ np.linalg.solve(mass_matrix(self._model, self._data, q), J.T)
            fastest = float(np.sqrt(np.linalg.eigvals(inverse @ self.stiffness).real.max()))
            checked_gains(fastest**2, 2.0 * fastest, dt)

    def command(self, time: float, q: Array, v: Array) -> Array:
        """Torques ``[nv]``.

        Raises:
            ShapeError, NotFiniteError, RangeError, RotationError: no measurement.
        """
        q, v = measured(self._robot, q, v)
        wanted, rate, acceleration = self.motion(time)
        model, data, w = self._model, self._data, self.frequency
        pin.forwardKinematics(model, self._wanted, wanted, rate, acceleration)
        there, speed, change = self._state(self._wanted)
        M = mass_matrix(model, data, q)
        h = np.array(pin.nonLinearEffects(model, data, q, v))
        J = np.array(pin.computeFrameJacobian(model, data, q, self._index, _AXES))
        pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
        here, moving, drift = self._state(data)
        error = np.concatenate([there.translation - here.translation, _turn(here.rotation, there.rotation)])
        by_force = np.linalg.solve(M, J.T)
        inverse = J @ by_force
        values, vectors = np.linalg.eigh((inverse + inverse.T) / 2.0)
        kept = values > DAMPED * values[-1]
        root = vectors[:, kept] / np.sqrt(values[kept])
        Lambda = root @ root.T
        K, D = w * w * Lambda, 2.0 * w * Lambda
        if self.stiffness is not None:
            K = self.stiffness
            # In the axes of root', where Lambda is the unit matrix
            back = vectors[:, kept] * np.sqrt(values[kept])
            squared, turned = np.linalg.eigh(back.T @ K @ back)
            half = root @ turned
            D = 2.0 * (half * np.sqrt(squared)) @ half.T
        F = Lambda @ (change - drift) + D @ (speed - moving) + K @ error
        a = acceleration + 2.0 * w * (rate - v) + w * w * pin.difference(model, q, wanted)
        rest = M @ (a - by_force @ (Lambda @ (J @ a)))
        return np.asarray(J.T @ F + rest + h)

    def _state(self, data: pin.Data) -> tuple[pin.SE3, Array, Array]:
        """Pose, twist and acceleration of the frame, world axes."""
        pin.updateFramePlacement(self._model, data, self._index)
        return (
            data.oMf[self._index].copy(),
            np.array(pin.getFrameVelocity(self._model, data, self._index, _AXES)),
            np.array(pin.getFrameClassicalAcceleration(self._model, data, self._index, _AXES)),
        )


def _turn(here: Array, there: Array) -> Array:
    """The rotation from one orientation to another as a vector, world axes."""
    return np.asarray(here @ pin.log3(here.T @ there))
