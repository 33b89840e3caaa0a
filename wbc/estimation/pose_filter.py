"""A Kalman filter on SE(3): pose, twist and acceleration of a frame from noisy poses.

State, in world axes: position p and rotation R of the frame, velocity of its origin v, angular velocity w; in the model
of constant acceleration also a and alpha. The error state is the vector

    (dp, dtheta, dv, dw [, da, dalpha])         R = exp(dtheta) R_estimated,     all else additive

Prediction over t, with phi = w t + alpha t^2/2:

    p <- p + v t + a t^2/2      R <- exp(phi) R      v <- v + a t      w <- w + alpha t

    dp <- dp + t dv + t^2/2 da      dtheta <- exp(phi) dtheta + Jl(phi) (t dw + t^2/2 dalpha)      dv <- dv + t da ...

with Jl the left Jacobian of SO(3), which is exact to first order in the errors. Process noise is white, of spectral
density s^2 on the last derivative: on the acceleration for a constant twist,

    Q = s^2 [t^3/3  t^2/2; t^2/2  t]             s in m/s^1.5 and rad/s^1.5

and on the jerk for a constant acceleration,

    Q = s^2 [t^5/20  t^4/8  t^3/6; t^4/8  t^3/3  t^2/2; t^3/6  t^2/2  t]             s in m/s^2.5 and rad/s^2.5

A measured pose (p_m, R_m) has the residual (p_m - p, log(R_m R')), the noise diag(s_p^2, s_r^2), and the identity on
(dp, dtheta) for its Jacobian. The gain is Kalman's, the covariance Joseph's form (1960; Bucy and Joseph 1968); the
error state of rotations is that of Sola, "Quaternion kinematics for the error-state Kalman filter" (2017), section 6.
What is neglected is of second order: phi's axis turning within t, and the turn of the covariance by a correction.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from wbc import validation
from wbc.errors import RangeError, SolverError
from wbc.multibody import pin
from wbc.validation import Array

Model = Literal["constant_twist", "constant_acceleration"]
ORDERS = {"constant_twist": 2, "constant_acceleration": 3}


@dataclass(frozen=True, eq=False)
class FrameMotion:
    """Pose of a frame in the world, its twist (velocity of its origin; angular velocity) and the twist's rate, world
    axes [m, rad, s].
    """

    pose: pin.SE3
    twist: Array
    acceleration: Array

    def after(self, t: float) -> FrameMotion:
        """The motion t later at constant acceleration."""
        turn = pin.exp3(t * self.twist[3:] + 0.5 * t * t * self.acceleration[3:])
        place = self.pose.translation + t * self.twist[:3] + 0.5 * t * t * self.acceleration[:3]
        pose = pin.SE3(turn @ self.pose.rotation, place)
        return FrameMotion(pose, self.twist + t * self.acceleration, self.acceleration)


class PoseFilter:
    """Estimates a frame's motion from time-stamped poses, see the module. No clock, no randomness.

    Args:
        noise: standard deviation of measured (position [m], rotation [rad]) along each axis.
        process: s of (position, rotation), see the module: how restless the motion is.
        model: ``"constant_twist"`` or ``"constant_acceleration"``.
        speed: standard deviation of (v, w) before anything is known [m/s, rad/s]; of (a, alpha) the same per second.

    Attributes:
        time: stamp of the last measurement, None before the first. covariance: of the error state then.
        surprise: r' S^-1 r of the last measurement, chi-square(6) where the noise is as declared.

    Raises:
        ShapeError, NotFiniteError, RangeError: not two positive numbers. UnknownNameError: no such model.
    """

    def __init__(
        self, noise: Any, process: Any, model: Model = "constant_acceleration", speed: Any = (1.0, 1.0)
    ) -> None:
        self._order = ORDERS[validation.one_of("model", model, ORDERS)]
        self._noise, self._process, self._speed = (
            np.repeat([_positive(f"{name}[{k}]", x) for k, x in enumerate(validation.real_array(name, pair, (2,)))], 3)
            for name, pair in (("noise", noise), ("process", process), ("speed", speed))
        )
        self._powers = np.arange(self._order)
        self.reset()

    def reset(self) -> None:
        """Forget every measurement."""
        self.time: float | None = None
        self.surprise = 0.0
        self.covariance = np.zeros((6 * self._order, 6 * self._order))
        self._motion = FrameMotion(pin.SE3.Identity(), np.zeros(6), np.zeros(6))

    def update(self, time: float, pose: Any) -> None:
        """Take a measured pose in; the first one is where the estimate begins.

        Raises:
            RangeError: a time before the last one; nothing is changed. WbcError: no pose.
        """
        measured = validation.pose("pose", pose)
        now = validation.scalar("time", time, unit="s")
        if self.time is None:
            first = [self._noise, *[self._speed] * (self._order - 1)]
            self.covariance = np.diag(np.concatenate(first) ** 2)
            self._motion = FrameMotion(measured, np.zeros(6), np.zeros(6))
            self.time = now
            return
        if now < self.time:
            raise RangeError("time", time, f"the filter is at {self.time:g} s already")
        t = now - self.time
        covariance = self.predicted(t)
        motion = self._motion.after(t)
        turn = measured.rotation @ motion.pose.rotation.T
        residual = np.concatenate([measured.translation - motion.pose.translation, pin.log3(turn)])
        spread = covariance[:6, :6] + np.diag(self._noise**2)
        gain = np.linalg.solve(spread, covariance[:6]).T
        self.surprise = float(residual @ np.linalg.solve(spread, residual))
        kept = np.eye(len(covariance))
        kept[:, :6] -= gain
        joseph = kept @ covariance @ kept.T + (gain * self._noise**2) @ gain.T
        self.covariance = 0.5 * (joseph + joseph.T)
        self._motion = _corrected(motion, gain @ residual)
        self.time = now

    def at(self, time: float) -> FrameMotion:
        """The motion expected at a time, from the last measurement on; also for a time before it.

        Raises:
            SolverError: there was no measurement.
        """
        if self.time is None:
            raise SolverError("at", time, "there is no measurement yet")
        return self._motion.after(time - self.time)

    def predicted(self, t: float) -> Array:
        """Covariance of the error state t after the last measurement, see the module."""
        step = self._motion.twist[3:] * t + 0.5 * t * t * self._motion.acceleration[3:]
        transition = np.eye(6 * self._order)
        linear = np.eye(6)
        linear[3:, 3:] = pin.Jexp3(-step)  # Jl(phi) = Jr(-phi)
        transition[3:6, 3:6] = pin.exp3(step)
        for k in range(1, self._order):
            share = t**k / (1.0, 1.0, 2.0)[k]
            transition[:6, 6 * k : 6 * k + 6] = share * linear
            if k == 2:
                transition[6:12, 12:18] = t * np.eye(6)
        out: Array = transition @ self.covariance @ transition.T
        blocks, diagonal = out.reshape(self._order, 6, self._order, 6), np.arange(6)
        blocks[:, diagonal, :, diagonal] += self._process[:, None, None] ** 2 * self._white(t)
        return out

    def _white(self, t: float) -> Array:
        """Q / s^2, order x order: integrals over s in [0, t] of the powers (t - s)^i/i! (t - s)^j/j!."""
        top = self._order - 1 - self._powers
        factorial = np.array([1.0, 1.0, 2.0])[top]
        power = top[:, None] + top[None, :] + 1
        white: Array = t**power / (power * np.outer(factorial, factorial))
        return white


def _positive(field: str, value: float) -> float:
    return validation.scalar(field, value, low=0.0, open_low=True)


def _corrected(motion: FrameMotion, error: Array) -> FrameMotion:
    """The motion with an error state added."""
    pose = pin.SE3(pin.exp3(error[3:6]) @ motion.pose.rotation, motion.pose.translation + error[:3])
    out = replace(motion, pose=pose, twist=motion.twist + error[6:12])
    return out if len(error) == 12 else replace(out, acceleration=motion.acceleration + error[12:])
