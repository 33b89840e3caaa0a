"""The arm of the thesis: two turning joints and a sliding one, its motors, its task, its closed form.

What is hardly legible is chosen so that the drawing, A.69 and the listing agree: see docs/dynamics_published.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.published.newton_euler.actuators import Motor
from wbc.published.newton_euler.links import Link, SerialChain
from wbc.validation import Array

#: Gravity of the listing [m/s^2]
GRAVITY = 9.80621
#: From joint 1 to joint 2 along the axis of joint 2 [m]
SHOULDER = 0.1524
#: r_01, from joint 1 to the base's origin [m]
BASE = np.array([0.0, 0.1, -0.1])
#: From joint 3's origin, which is the tip, to the centre of mass of link 3 [m]
BEHIND = 0.6447
#: The motor of all joints, as printed: second order
MOTOR = Motor(np.array([[0.0, 1.0], [0.0, -46.4]]), np.array([0.0, 88.6]), np.array([0.0, -29.0]))
#: Of that motor: constant [V s/rad] and resistance [ohm] of a rotor of 1/29 kg m^2, 1 / f
CONSTANT = 46.4 / 88.6
RESISTANCE = 29.0 * CONSTANT / 88.6
#: The same motor with the inductance of its armature, which is not printed: current follows within 2 ms
ELECTRIC = Motor.third_order(CONSTANT, RESISTANCE, 0.002 * RESISTANCE, 1.0 / 29.0)
#: A hydraulic one, none is printed: 31 cm^3 a turn, 0.1 l of oil of 1.4 GPa, at most 0.1 l/s through the valve
HYDRAULIC = Motor.third_order(5e-6, 1e-12, 1e-4 / (4 * 1.4e9), 1.0 / 29.0, inflow=1e-4)
State = tuple[Array, Array, Array]


def arm(payload: float = 0.0) -> SerialChain:
    """The modified Stanford arm; ``payload``: a point mass at the centre of mass of link 3 [kg]."""
    validation.scalar("payload", payload, low=0.0, unit="kg")
    x, y, z = np.eye(3)
    side = np.array([0.0, -0.1054, 0.0])
    return SerialChain(
        (
            Link(9.29, np.array([0.276, 0.255, 0.071]), -y, z, np.array([0, 0.0175, -0.1105]),
                 np.array([0, 0.0175, -0.2629])),
            Link(5.01, np.array([0.108, 0.018, 0.100]), y, z, side, side, reference=z),
            Link(4.25 + payload, np.array([2.51, 2.51, 0.006]), z, z, -BEHIND * z, -BEHIND * z, prismatic=True,
                 reference=y, next_reference=x),
        ),
        z, BASE, GRAVITY,
    )  # fmt: skip


def tip(q: Array) -> Array:
    """The tip from joint 1, in the base's axes [m] (A.69)."""
    (s1, s2), (c1, c2) = np.sin(q[:2]), np.cos(q[:2])
    return np.array([-SHOULDER * s1 + q[2] * c1 * s2, SHOULDER * c1 + q[2] * s1 * s2, q[2] * c2])


@dataclass(frozen=True, eq=False)
class StraightLine:
    """A line of the tip at constant speed, joint 1 at rest (A.70 to A.73); it begins and ends at full speed.

    Attributes:
        start, end: of the tip, from the base's origin [3] [m]; their y is not used.
        duration: [s].

    Raises:
        RangeError: the line passes joint 2, where the rate of joint 2 has no bound.
    """

    start: Array
    end: Array
    duration: float = 1.0

    def __post_init__(self) -> None:
        validation.scalar("duration", self.duration, low=0.0, open_low=True, unit="s")
        start = validation.ordinary_array("start", self.start, (3,))
        end = validation.ordinary_array("end", self.end, (3,))
        object.__setattr__(self, "start", start)
        object.__setattr__(self, "end", end)
        way, first = (end - start)[[0, 2]], (start + BASE)[[0, 2]]
        nearest = np.clip(-(way @ first) / max(way @ way, 1e-300), 0.0, 1.0)
        if np.linalg.norm(first + nearest * way) < 1e-6:
            raise RangeError("end", self.end, "the line passes joint 2: expected one that stays clear of it")

    def __call__(self, time: float) -> State:
        """q, q' and q'', [3] each, at a time [s]; after the end the line goes on."""
        x, _, z = self.start + BASE + time / self.duration * (self.end - self.start)
        dx, _, dz = (self.end - self.start) / self.duration
        q3, q2 = float(np.hypot(x, z)), float(np.arctan2(x, z))
        c, s = np.cos(q2), np.sin(q2)
        v2, v3 = (c * dx - s * dz) / q3, s * dx + c * dz
        return np.array([0.0, q2, q3]), np.array([0.0, v2, v3]), np.array([0.0, -2.0 * v2 * v3 / q3, q3 * v2**2])


def task() -> StraightLine:
    """The task of the thesis: half a metre up and to the axis in 1 s."""
    return StraightLine(np.array([0.30, SHOULDER, 0.1530]), np.array([0.0, SHOULDER, 0.653]))


def closed_form(q: Array, v: Array, *, printed: bool = False) -> tuple[Array, Array]:
    """c and d, [2] each, of q'' = c + d tau for joints 2 and 3 while joint 1 is still (C.128).

    ``printed``: with the sign of gravity in c2 as printed, which the Lagrangian above it contradicts.
    """
    m3, out = 4.25, q[2] - BEHIND
    D = 0.018 + 2.51 + m3 * out**2
    sign = 1.0 if printed else -1.0
    c2 = -out * m3 * (2.0 * v[1] * v[2] + sign * GRAVITY * np.sin(q[1])) / D
    return np.array([c2, out * v[1] ** 2 - GRAVITY * np.cos(q[1])]), np.array([1.0 / D, 1.0 / m3])
