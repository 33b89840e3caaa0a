"""Motions of an object: a sea's, a free body's tumble, and the swing of a published experiment. Exact twists."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import pi
from typing import Protocol

import numpy as np
from scipy.integrate import solve_ivp

from wbc.estimation import FrameMotion
from wbc.multibody import pin
from wbc.rotations import quaternion
from wbc.validation import Array

#: Harmonic components of a sea
COMPONENTS = 24
#: Band that the components lie in, in parts of the peak frequency
BAND = (0.6, 2.5)
#: Half the step of the difference that gives angular accelerations [s]
STEP = 1e-4
#: Accuracy of a tumble
TOLERANCE = 1e-12


class TargetMotion(Protocol):
    """A frame over time."""

    def at(self, t: float) -> FrameMotion:
        """Pose, twist and acceleration at t [s]."""


@dataclass(frozen=True, eq=False)
class Waves:
    """A frame about its mean pose: position p0 + x(t), rotation exp(r(t)) R0, both sums of cosines.

    Attributes:
        mean: the mean pose. amplitude: components x 6, of x [m] and r [rad]. frequency: of the components [rad/s].
        phase: components x 6.
    """

    mean: pin.SE3
    amplitude: Array
    frequency: Array
    phase: Array

    def at(self, t: float) -> FrameMotion:
        """Exact but for the angular acceleration, a central difference of the exact angular velocity."""
        angle = self.phase + self.frequency[:, None] * t
        w, cosines, sines = self.frequency, self.amplitude * np.cos(angle), self.amplitude * np.sin(angle)
        x, dx, ddx = cosines.sum(axis=0), -w @ sines, -(w * w) @ cosines
        dddr, s = w**3 @ sines[:, 3:], STEP
        # r and dr/dt a little earlier and later, by their series: what is left out is below rounding
        spins = [
            pin.Jexp3(-x[3:] - h * dx[3:] - 0.5 * h * h * ddx[3:]) @ (dx[3:] + h * ddx[3:] + 0.5 * h * h * dddr)
            for h in (-s, 0.0, s)
        ]
        pose = pin.SE3(pin.exp3(x[3:]) @ self.mean.rotation, self.mean.translation + x[:3])
        turning = (spins[2] - spins[0]) / (2.0 * STEP)
        return FrameMotion(pose, np.concatenate([dx[:3], spins[1]]), np.concatenate([ddx[:3], turning]))


def sea(mean: pin.SE3, rng: np.random.Generator, significant: Array, period: float) -> Waves:
    """Random waves in six degrees of freedom, independent of each other, each with the spectrum

        S(w) = 5/16 H^2 wp^4 / w^5 exp(-5/4 (wp/w)^4),         wp = 2 pi / period

    (Bretschneider 1959) between 0.6 and 2.5 wp, as components of random frequency within bins of one width.

    Args:
        significant: H of x, y, z [m] and of rotations about x, y, z [rad]: four standard deviations. period: [s].
    """
    peak = 2.0 * pi / period
    edges = peak * np.linspace(*BAND, COMPONENTS + 1)
    w = rng.uniform(edges[:-1], edges[1:])
    density = 5.0 / 16.0 * peak**4 / w**5 * np.exp(-1.25 * (peak / w) ** 4)
    amplitude = np.sqrt(2.0 * density * np.diff(edges))[:, None] * significant[None, :]
    return Waves(mean, amplitude, w, rng.uniform(0.0, 2.0 * pi, (COMPONENTS, 6)))


def swing(mean: pin.SE3) -> Waves:
    """2 in along x at 0.1 Hz and 5 degrees of yaw at 0.05 Hz (Hirabayashi 1981)."""
    amplitude = np.zeros((2, 6))
    amplitude[0, 0], amplitude[1, 5] = 2 * 0.0254, np.radians(5.0)
    return Waves(mean, amplitude, 2.0 * pi * np.array([0.1, 0.05]), np.full((2, 6), -pi / 2))


@dataclass(frozen=True, eq=False)
class Tumble:
    """A rigid body free of forces: Euler's equations I dw/dt = -w x I w, its centre of mass on a straight line.

    Attributes:
        centre, drift: of the centre of mass at t = 0, and its velocity. arm: from there to the frame's origin, in the
            frame's axes [m]. inertia: principal moments about the frame's axes, to a common factor.
        state: t -> quaternion (x, y, z, w) and angular velocity in the frame's axes.
    """

    centre: Array
    drift: Array
    arm: Array
    inertia: Array
    state: Callable[[float], Array]

    def at(self, t: float) -> FrameMotion:
        state = self.state(t)
        turn = pin.Quaternion(state[:4] / np.linalg.norm(state[:4])).toRotationMatrix()
        spin, arm = turn @ state[4:], turn @ self.arm
        turning = turn @ _euler(self.inertia, state[4:])
        speed = self.drift + np.cross(spin, arm)
        change = np.cross(turning, arm) + np.cross(spin, np.cross(spin, arm))
        place = self.centre + self.drift * t + arm
        return FrameMotion(pin.SE3(turn, place), np.concatenate([speed, spin]), np.concatenate([change, turning]))


def tumble(start: pin.SE3, rng: np.random.Generator, rate: float, arm: float, drift: float, seconds: float) -> Tumble:
    """A random tumble that begins at a pose.

    Args:
        rate: |w| at the start [rad/s], about a random axis. arm: length of the lever to the centre of mass [m].
        drift: speed of the centre of mass [m/s]. seconds: how long it is known.
    """
    lever, way, spin = (v / np.linalg.norm(v) for v in rng.normal(size=(3, 3)))
    inertia = 1.0 + rng.uniform(0.0, 0.9, 3)  # of a real body: none exceeds the sum of the others
    lever = arm * lever

    def slope(_: float, y: Array) -> Array:
        x, w = y[:3], y[4:]
        return np.concatenate([0.5 * (y[3] * w + np.cross(x, w)), [-0.5 * x @ w], _euler(inertia, w)])

    first = np.concatenate([quaternion(start.rotation), rate * spin])
    solved = solve_ivp(slope, (0.0, seconds), first, method="DOP853", rtol=TOLERANCE, atol=TOLERANCE, dense_output=True)
    centre = start.translation - start.rotation @ lever
    return Tumble(centre, drift * way, lever, inertia, solved.sol)


def _euler(inertia: Array, w: Array) -> Array:
    return np.asarray(-np.cross(w, inertia * w) / inertia)
