"""How fast a hand can swing along its way while the body moves: the least time under the limits of joints 1 to 5."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.arms.puma import ArmKinematics
from wbc.walking.body_path import BodyPath
from wbc.walking.native import compiled
from wbc.walking.planner.grips.table import Ints
from wbc.walking.planner.swings.curve import Curves
from wbc.walking.planner.swings.joints import ANGLE_ROOM, AXIS_ROOM, ELBOW_ROOM, REACH_ROOM, Wrists, joint_paths

#: Parts of joint rates and accelerations that a swing is planned with; the rest is for feedback
RATE_PART, ACCELERATION_PART = 0.96, 0.9
#: Fastest hand [m/s]
FASTEST = 2.0
#: Derivatives smaller than this [rad] limit nothing
LEAST = 1e-6
#: The body's part of the rates is that over so many samples
STEP = 0.5
#: Rules of native/speeds.h
RULES = compiled.doubles(
    (RATE_PART, ACCELERATION_PART, FASTEST, LEAST, STEP, REACH_ROOM, ANGLE_ROOM, ELBOW_ROOM, AXIS_ROOM)
)


@dataclass(frozen=True, eq=False)
class Speeds:
    """Laws of m swings over n points, evenly over x in [0, 1] of their curves.

    Attributes:
        possible: the hand stays in reach and joints 1 to 5 within their limits ``[m]``.
        angles: of joints 1 to 5, and 6 where the roll counts, ``[m, n, 5 or 6]`` [rad].
        rate: dx/dt ``[m, n]`` [1/s]; its square changes evenly from point to point.
        time: at the points, from 0 ``[m, n]`` [s].
    """

    possible: NDArray[np.bool_]
    angles: Array
    rate: Array
    time: Array

    @property
    def duration(self) -> Array:
        """Of each swing [s]."""
        out: Array = self.time[:, -1]
        return out


def speeds(
    kinematics: ArmKinematics, walker: Walker, arms: Ints, path: BodyPath, way: Curves, samples: Array, wrists: Wrists
) -> Speeds:
    """Least times along m curves, each for an arm of a body that is at fractional ``samples`` ``[m, n]`` of its path:

        |q_x x' + q_u u'| <= part rate,     |q_x x'' + q_xx x'^2| <= part acceleration,     |p_x x'| <= fastest

    for joints 1 to 5, by one pass forwards and one backwards over x'^2; q_u u' is what the body's motion asks of a hand
    at rest.
    """
    place, wrist = way.at(np.linspace(0.0, 1.0, samples.shape[1])), wrists(samples)
    bases = np.array([arm.base.homogeneous for arm in walker.arms])[arms]
    found = _compiled(kinematics, bases, path, place, samples, wrist)
    return found or _numpy(kinematics, bases, path, place, samples, wrist)


def _compiled(
    kinematics: ArmKinematics, bases: Array, path: BodyPath, place: Array, samples: Array, wrist: Array
) -> Speeds | None:
    """By the compiled code; None where there is none."""
    library = compiled.library()
    if library is None:
        return None
    count, points, bends = wrist.shape
    angles = np.empty((count, points, 3 + bends))
    rate, time, possible = np.empty((count, points)), np.empty((count, points)), np.empty(count, dtype=np.bool_)
    given = [compiled.packed(array) for array in (bases, path.poses, place, wrist, samples)]
    where = [compiled.at(array) for array in given]
    library.swing_speeds(
        ctypes.byref(compiled.arm(kinematics.data)),
        RULES,
        ctypes.c_long(count),
        ctypes.c_long(points),
        ctypes.c_int(bends),
        *where[:2],
        ctypes.c_long(len(path)),
        ctypes.c_double(path.spacing),
        *where[2:],
        *(compiled.at(array) for array in (possible, angles, rate, time)),
    )
    return Speeds(possible, angles, rate, time)


@dataclass(frozen=True, eq=False)
class SwingJoints:
    """Joints 1 to 5, and 6 where the roll counts, of m swings over n points, evenly over x in [0, 1].

    Attributes:
        possible: within reach and limits ``[m]``.
        angles: ``[m, n, 5 or 6]`` [rad]. first, second: derivatives by x of a body that stands. bias: by the sample, of
            a hand that stands; all ``[m, n, 5 or 6]``.
    """

    possible: NDArray[np.bool_]
    angles: Array
    first: Array
    second: Array
    bias: Array


def swing_joints(
    kinematics: ArmKinematics, bases: Array, path: BodyPath, place: Array, samples: Array, wrist: Array
) -> SwingJoints:
    """Joints of arms with bases ``[m, 4, 4]`` in the body, hands at ``place`` ``[m, n, 3]`` [m] and wrists bent by
    ``wrist`` ``[m, n, 2 or 3]`` [rad], while the body is at ``samples`` ``[m, n]`` of its path; by differences.
    """
    count, points = samples.shape
    gap = 1.0 / (points - 1)
    # The same hand on a body that is a little further
    doubled = np.concatenate([samples, samples + STEP])
    both, possible = joint_paths(
        kinematics,
        path.blended(doubled) @ np.concatenate([bases, bases])[:, None],
        np.concatenate([place, place]),
        np.concatenate([wrist, wrist]),
    )
    angles, further = both[:count], both[count:]
    bias = (further - angles) / STEP
    first = np.gradient(angles, gap, axis=1, edge_order=2)
    first -= bias * np.gradient(samples, gap, axis=1)[..., None]
    return SwingJoints(possible[:count], angles, first, np.gradient(first, gap, axis=1), bias)


def _numpy(
    kinematics: ArmKinematics, bases: Array, path: BodyPath, place: Array, samples: Array, wrist: Array
) -> Speeds:
    """What the compiled code does."""
    joints = swing_joints(kinematics, bases, path, place, samples, wrist)
    first, second, bias = joints.first, joints.second, joints.bias
    gap = 1.0 / (samples.shape[1] - 1)
    limits, most = (
        np.array(v)[: first.shape[2]] for v in (kinematics.data.joint_rates, kinematics.data.joint_accelerations)
    )
    # Where the body goes the way of the hand, the hand may go faster
    rates = np.maximum(RATE_PART * limits - np.sign(first) * bias / path.spacing, 0.1 * limits)
    slope = np.linalg.norm(np.gradient(place, gap, axis=1), axis=2)
    top = np.minimum((rates / np.maximum(np.abs(first), LEAST)).min(axis=2), FASTEST / np.maximum(slope, LEAST)) ** 2
    top[:, 0] = top[:, -1] = 0.0
    square = _squares(first, second, ACCELERATION_PART * most, top, gap)
    rate = np.sqrt(square)
    time = np.zeros_like(samples)
    np.cumsum(2 * gap / np.maximum(rate[:, 1:] + rate[:, :-1], 1e-6), axis=1, out=time[:, 1:])
    return Speeds(joints.possible, joints.angles, rate, time)


def _squares(first: Array, second: Array, limits: Array, top: Array, gap: float) -> Array:
    """The largest s = x'^2 ``[m, n]`` under ``top`` with |a u + b s| <= limit, where s changes by 2 gap u a point.

    With c = b / a and e = limit / |a|, u lies between -e - c s and e - c s of every joint. The sets of s from which
    the end can be reached are intervals [0, K]; they are made backwards, then s goes forwards as high as they allow
    (reachability analysis of Pham and Pham, 2018).
    """
    # Points, joints, swings: minima over the few joints are of long rows then
    turned, bent = first.transpose(1, 2, 0), second.transpose(1, 2, 0)
    a = np.where(np.abs(turned) < LEAST, LEAST, turned)
    c, e = bent / a, limits[:, None] / np.abs(a)
    step = 2 * gap
    # Some u is left between all joints, and one with which s stays above 0
    most = top.T.copy()
    for k, j in permutations(range(c.shape[1]), 2):
        np.minimum(most, (e[:, j] + e[:, k]) / np.maximum(c[:, j] - c[:, k], LEAST), out=most)
    rise, push = 1.0 + step * c, step * e
    np.minimum(most, (push / np.maximum(step * c - 1.0, LEAST)).min(axis=1), out=most)
    # From point to point by the limit where the step begins, and by the same where it ends
    back, on = 1.0 / np.maximum(1.0 - step * c, LEAST), np.maximum(rise, 0.0)
    for i in range(len(most) - 2, -1, -1):
        after = most[i + 1]
        reach = np.minimum((after + push[i]) * back[i], push[i + 1] + after * on[i + 1])
        np.minimum(most[i], reach.min(axis=0), out=most[i])
    out = np.zeros_like(most)
    held, free = 1.0 / np.maximum(rise, LEAST), np.where(rise > LEAST, 0.0, np.inf)
    for i in range(len(most) - 1):
        here = out[i]
        ends = (e[i + 1] - c[i + 1] * here) * held[i + 1] + free[i + 1]
        u = np.minimum(e[i] - c[i] * here, ends).min(axis=0)
        out[i + 1] = np.minimum(most[i + 1], np.maximum(here + step * u, 0.0))
    return np.ascontiguousarray(out.T)
