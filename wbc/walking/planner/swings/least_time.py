"""How fast a hand can swing along its curve while the body moves: the least time under the limits of its joints."""

from __future__ import annotations

import ctypes
import functools
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Margins, Walker
from wbc.validation import Array
from wbc.walking.arms.puma import limb_of
from wbc.walking.body_path import BodyPath
from wbc.walking.native import compiled
from wbc.walking.planner.grips.table import Ints
from wbc.walking.planner.swings.curve import Curves
from wbc.walking.planner.swings.joints import Guide

#: Derivatives smaller than this [rad] limit nothing
LEAST = 1e-6
#: The body's part of the rates is that over so many samples
STEP = 0.5


@functools.cache
def rules(margins: Margins) -> compiled.Numbers:
    """Rules of native/speeds.h."""
    to_limits = margins.swing_reach, margins.swing_angle, margins.swing_elbow, margins.swing_axis
    return compiled.doubles(
        (margins.swing_rate, margins.swing_acceleration, margins.hand_speed, LEAST, STEP, *to_limits)
    )


@dataclass(frozen=True, eq=False)
class Speeds:
    """Laws of m swings over n points, evenly over x in [0, 1] of their curves.

    Attributes:
        possible: the hand stays in reach and the joints within their limits ``[m]``.
        angles: of all joints, the last where the roll counts, ``[m, n, joints]`` [rad].
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


def speeds(walker: Walker, arms: Ints, path: BodyPath, curve: Curves, samples: Array, guide: Guide) -> Speeds:
    """Least times along m curves, each for an arm of a body that is at fractional ``samples`` ``[m, n]`` of its path:

        |q_x x' + q_u u'| <= part rate,     |q_x x'' + q_xx x'^2| <= part acceleration,     |p_x x'| <= fastest

    for all joints that count, by one pass forwards and one backwards over x'^2; q_u u' is what the body's motion asks
    of a hand at rest.
    """
    places, guided = curve.at(np.linspace(0.0, 1.0, samples.shape[1])), guide(samples)
    bases = np.array([arm.base.homogeneous for arm in walker.arms])[arms]
    found = _compiled(walker, bases, path, places, samples, guided)
    return found or _numpy(walker, bases, path, places, samples, guided)


def _compiled(
    walker: Walker, bases: Array, path: BodyPath, places: Array, samples: Array, guide: Array
) -> Speeds | None:
    """By the compiled code; None where there is none, or it does not know the limb."""
    limb = limb_of(walker)
    library = compiled.library_for(limb)
    if library is None:
        return None
    count, points, guided = guide.shape
    angles = np.empty((count, points, 3 + guided))
    rate, time, possible = np.empty((count, points)), np.empty((count, points)), np.empty(count, dtype=np.bool_)
    given = [compiled.packed(array) for array in (bases, path.poses, places, guide, samples)]
    where = [compiled.at(array) for array in given]
    library.swing_speeds(
        compiled.arm_of(limb),
        rules(walker.margins),
        ctypes.c_long(count),
        ctypes.c_long(points),
        ctypes.c_int(guided),
        *where[:2],
        ctypes.c_long(len(path)),
        ctypes.c_double(path.spacing),
        *where[2:],
        *(compiled.at(array) for array in (possible, angles, rate, time)),
    )
    return Speeds(possible, angles, rate, time)


@dataclass(frozen=True, eq=False)
class SwingJoints:
    """All joints, the last where the roll counts, of m swings over n points, evenly over x in [0, 1].

    Attributes:
        possible: within reach and limits ``[m]``.
        angles: ``[m, n, joints]`` [rad]. first, second: derivatives by x of a body that stands. bias: by the sample, of
            a hand that stands; all ``[m, n, joints]``.
    """

    possible: NDArray[np.bool_]
    angles: Array
    first: Array
    second: Array
    bias: Array


def swing_joints(
    walker: Walker, bases: Array, path: BodyPath, places: Array, samples: Array, guide: Array
) -> SwingJoints:
    """Joints of arms with bases ``[m, 4, 4]`` in the body, hands at ``places`` ``[m, n, 3]`` [m] and guided joints at
    ``guide`` ``[m, n, g]`` [rad], while the body is at ``samples`` ``[m, n]`` of its path; by differences.
    """
    count, points = samples.shape
    gap = 1.0 / (points - 1)
    # The same hand on a body that is a little further
    doubled = np.concatenate([samples, samples + STEP])
    both, possible = limb_of(walker).follow(
        path.blended(doubled) @ np.concatenate([bases, bases])[:, None],
        np.concatenate([places, places]),
        np.concatenate([guide, guide]),
        walker.margins,
    )
    angles, further = both[:count], both[count:]
    bias = (further - angles) / STEP
    first = np.gradient(angles, gap, axis=1, edge_order=2)
    first -= bias * np.gradient(samples, gap, axis=1)[..., None]
    return SwingJoints(possible[:count], angles, first, np.gradient(first, gap, axis=1), bias)


def _numpy(walker: Walker, bases: Array, path: BodyPath, places: Array, samples: Array, guide: Array) -> Speeds:
    """What the compiled code does, for any limb."""
    limb, margins = limb_of(walker), walker.margins
    joints = swing_joints(walker, bases, path, places, samples, guide)
    first, second, bias = joints.first, joints.second, joints.bias
    gap = 1.0 / (samples.shape[1] - 1)
    limits, most = (np.array(v)[: first.shape[2]] for v in (limb.joint_rates, limb.joint_accelerations))
    # Where the body goes where the hand does, the hand may go faster
    rates = np.maximum(margins.swing_rate * limits - np.sign(first) * bias / path.spacing, 0.1 * limits)
    slope = np.linalg.norm(np.gradient(places, gap, axis=1), axis=2)
    top = (
        np.minimum(
            (rates / np.maximum(np.abs(first), LEAST)).min(axis=2), margins.hand_speed / np.maximum(slope, LEAST)
        )
        ** 2
    )
    top[:, 0] = top[:, -1] = 0.0
    square = _squares(first, second, margins.swing_acceleration * most, top, gap)
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
