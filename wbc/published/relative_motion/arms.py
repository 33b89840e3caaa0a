"""Both arms of the document: the manipulator with its level hand, and the arm that measures where the table is."""

from __future__ import annotations

import functools

import casadi as ca
import numpy as np

from wbc import robots, validation
from wbc.errors import RangeError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.robot.transmission import Transmission
from wbc.robots.link_tree import TreeLink, build_model
from wbc.robots.operator_chains import X, Y, Z
from wbc.symbolic.evaluation import SingleState
from wbc.symbolic.kinematics import Kinematics
from wbc.validation import Array

INCH = 0.0254
#: Manipulator: shoulder along y [m]
SHOULDER = 18.0 * INCH
#: Manipulator: arm down [m]
ARM = 40.0 * INCH
#: Manipulator: wrist along y [m]
WRIST = 1.39 * INCH
#: Measuring arm [m]
LINKS = (15.125 * INCH, 14.750 * INCH, 4.00 * INCH)
#: Potentiometers: degrees a volt
DEGREES = -20.0
#: Potentiometers: volts a count
VOLTS = 10.0 / 32752.0
#: Potentiometers: which channel has which joint
CHANNELS = (1, 0, 3, 2, 5, 4)
#: Shorter than this no direction is read from a vector
NONE = 1e-12
MINUS_Y = (0.0, -1.0, 0.0)
Axis = tuple[float, float, float]


def _chain(name: str, joints: list[tuple[Axis, Axis]], end: Axis) -> Robot:
    """A robot of turns: (axis, where the joint is in the one before) each; it has no published limits."""
    links, parent = [], "base"
    for k, (axis, at) in enumerate(joints, start=1):
        bounds = (-np.inf, np.inf, np.inf, np.inf)
        links.append(TreeLink(f"F{k}", parent, pin.SE3(np.eye(3), np.array(at)), f"joint{k}", *bounds, axis))
        parent = f"F{k}"
    links.append(TreeLink("tip", parent, pin.SE3(np.eye(3), np.array(end))))
    return robots.load(build_model(name, "base", links, floating=False), name=name)


@functools.cache
def manipulator() -> Robot:
    """Rx(q1) Tr(0, 18, 0) Ry(q2) Rx(q3) Tr(0, 0, -40) Rz(q4) Tr(0, 1.39, 0) Rx(q5) Ry(q6) in inches; frame ``tip``."""
    o = (0.0, 0.0, 0.0)
    turns = [(X, o), (Y, (0.0, SHOULDER, 0.0)), (X, o), (Z, (0.0, 0.0, -ARM)), (X, (0.0, WRIST, 0.0)), (Y, o)]
    return _chain("relative_motion_manipulator", turns, o)


def wrist_drives() -> Transmission:
    """TH2 to TH7 of the manipulator and of its master: a differential wrist, an elbow that stays parallel."""
    joints = tuple(f"joint{k}" for k in range(1, 7))
    third, sixth = -0.27, 0.825
    drives = {
        "TH2": {"joint4": 1.0},
        "TH3": {"joint5": 1.0, "joint6": -sixth, "joint3": third},
        "TH4": {"joint5": 1.0, "joint6": sixth, "joint3": third},
        "TH5": {"joint1": 1.0},
        "TH6": {"joint1": 1.0, "joint3": 1.0},
        "TH7": {"joint2": 1.0},
    }
    return Transmission(joints, drives)


@functools.cache
def _fourth() -> SingleState:
    """Rotation of frame 4, which the first four joints turn, and position of the hand."""
    kinematics = Kinematics(manipulator().model)
    rotation = kinematics.pose("F4").rotation
    return SingleState(ca.Function("fourth", [kinematics.q], [rotation, kinematics.pose("tip").position]))


def hand(q: Array) -> tuple[Array, float]:
    """Position [m] and yaw [rad] of the levelled hand: tan alpha = -x4y / x4x (3.13), 0 along +y, positive to +x."""
    rotation, position = _fourth()(q)
    return position[:, 0], float(np.arctan2(-rotation[1, 0], rotation[0, 0]))


def levelled(q: Array) -> Array:
    """The same first four joints, and the wrist that makes y6 and x6 horizontal (3.10, 3.11), |q6| <= 90 degrees:

        tan q5 = -y4z / z4z,   tan q6 = x4z / z5z,   z5z = hypot(y4z, z4z)

    Of both wrists this is the one with z6 upwards, also where the published arctangents change branch.

    Raises:
        RangeError: x4 is vertical, and q5 is arbitrary.
    """
    q = validation.ordinary_array("q", q, (6,))
    R = _fourth()(q)[0]
    up = np.hypot(R[2, 1], R[2, 2])
    if up < NONE:
        raise RangeError("q", q, "axis x4 is vertical: no turn of the wrist levels the hand")
    q[4:] = np.arctan2(-R[2, 1], R[2, 2]), np.arctan2(R[2, 0], up)
    return q


@functools.cache
def measuring_arm() -> Robot:
    """Ry(q1) Rx(q2) Rz(q3) a R-y(q4) b R-y(q5) c Rx(q6): a gimbal, the turn about link a, elbow, last link, gripper.

    The gripper's heading is z of the frame ``tip``, which is horizontal where link c hangs straight down.
    """
    a, b, c = LINKS
    o = (0.0, 0.0, 0.0)
    turns = [(Y, o), (X, o), (Z, o), (MINUS_Y, (0.0, 0.0, a)), (MINUS_Y, (b, 0.0, 0.0)), (X, (c, 0.0, 0.0))]
    return _chain("relative_motion_measuring_arm", turns, o)


def hanging(angles: Array) -> Array:
    """All six joints for (q1, q2, q4, q6): q3 keeps the links in one vertical plane, q5 the last one vertical.

    Raises:
        RangeError: link a is vertical, so that it has no azimuth.
    """
    q1, q2, q4, q6 = validation.ordinary_array("angles", angles, (4,))
    elevation, azimuth = _direction(q1, q2)
    across = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    turned = pin.utils.rotate("y", q1) @ pin.utils.rotate("x", q2)
    q3 = np.arctan2(-across @ turned[:, 0], across @ turned[:, 1])
    return np.array([q1, q2, q3, q4, -(elevation + q4), q6])


def measured(angles: Array) -> Array:
    """(x, y, z, alpha) of the table [m, rad] by the gimbal's geometry: link a points along (s1 c2, -s2, c1 c2).

    Raises:
        RangeError: as :func:`hanging`.
    """
    q1, q2, q4, q6 = validation.ordinary_array("angles", angles, (4,))
    return _pose(*_direction(q1, q2), q4, q6)


def published_measured(angles: Array) -> Array:
    """The same by the program MSURE: elevation atan(1 / sqrt(tan^2 q1 + tan^2 q2)), azimuth -atan(tan q2 / sin q1).

    The first is right for q1 = 0 or q2 = 0 alone; the second loses the quadrant for q1 < 0.

    Raises:
        RangeError: q1 = q2 = 0, where the program stops.
    """
    q1, q2, q4, q6 = validation.ordinary_array("angles", angles, (4,))
    if abs(q1) < NONE:
        _direction(q1, q2)
        return _pose(np.pi / 2 - q2, np.copysign(np.pi / 2, q2), q4, q6)
    slope = np.hypot(np.tan(q1), np.tan(q2))
    return _pose(np.arctan(1.0 / slope), -np.arctan(np.tan(q2) / np.sin(q1)), q4, q6)


def _direction(q1: float, q2: float) -> tuple[float, float]:
    """Elevation and azimuth of link a."""
    x, y, z = np.sin(q1) * np.cos(q2), -np.sin(q2), np.cos(q1) * np.cos(q2)
    if np.hypot(x, y) < NONE:
        raise RangeError("angles", (q1, q2), "the first link is vertical and has no azimuth")
    return float(np.arctan2(z, np.hypot(x, y))), float(np.arctan2(y, x))


def _pose(elevation: float, azimuth: float, elbow: float, gripper: float) -> Array:
    """(3.36) and (3.38)."""
    a, b, c = LINKS
    reach = a * np.cos(elevation) + b * np.sin(elevation + elbow)
    height = a * np.sin(elevation) - b * np.cos(elevation + elbow) - c
    return np.array([reach * np.cos(azimuth), reach * np.sin(azimuth), height, np.pi / 2 - (azimuth - gripper)])


class Potentiometers:
    """Six angles from counts, calibrated in one known pose: q_i = -20 deg/V (V_i - V_i0) + q_i0, channels in pairs.

    Args:
        counts: read in the pose [6], in the order of the channels. angles: of the joints there [rad].

    Raises:
        ShapeError, NotFiniteError.
    """

    def __init__(self, counts: Array, angles: Array) -> None:
        self._offset = validation.ordinary_array("angles", angles, (6,)) - self._turned("counts", counts)

    def angles(self, counts: Array) -> Array:
        """[rad]."""
        return self._turned("counts", counts) + self._offset

    @staticmethod
    def _turned(name: str, counts: Array) -> Array:
        volts = validation.ordinary_array(name, counts, (6,))[list(CHANNELS)] * VOLTS
        return np.asarray(np.radians(DEGREES) * volts)
