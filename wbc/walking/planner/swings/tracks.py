"""Swings as the search has them: the law of each with the body on its way, and the points of its arm."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.arms.puma import ArmKinematics
from wbc.walking.body_path import BodyPath
from wbc.walking.native import compiled
from wbc.walking.planner.grips.conflicts import ArmClearance
from wbc.walking.planner.grips.table import Grips, Ints
from wbc.walking.planner.swings.curve import Curves
from wbc.walking.planner.swings.joints import blend, grip_wrists, wrist_end
from wbc.walking.planner.swings.least_time import RULES, speeds
from wbc.walking.planner.swings.parked import Parked

#: How often the law is made, each time with the body where the last one has it
PASSES = 2


@dataclass(frozen=True, eq=False)
class Tracks:
    """m swings over n points: within reach and limits ``[m]``, duration ``[m]`` [s], samples of the path ``[m, n]``,
    and points of the arms in the body's frame ``[m, n, 6, 3]``.
    """

    possible: NDArray[np.bool_]
    duration: Array
    samples: Array
    points: Array

    @staticmethod
    def of(swings: Parked, rows: Ints, arms: ArmClearance) -> Tracks:
        """Of swings of arms (rows) that wait, their three parts one after the other."""
        samples = np.concatenate([swings.away.samples, swings.samples, swings.onto.samples], axis=1)
        return Tracks(swings.possible, swings.duration, samples, _points(swings.angles, rows, arms))


@dataclass(frozen=True, eq=False)
class Asked:
    """Swings of arms between grips, ``[m]`` each: the body is at sample ``begin`` at first and ``last`` at most, and
    they take ``least`` [s] if their law takes less.
    """

    arms: Ints
    source: Ints
    target: Ints
    begin: Array
    last: Ints
    least: Array


def tracks(
    walker: Walker, arms: ArmClearance, path: BodyPath, grips: Grips, way: Curves, asked: Asked, n: int
) -> Tracks:
    """Swings along curves, at n points of each."""
    library = compiled.library()
    if library is None:
        return _numpy(walker, arms, path, grips, way, asked, n)
    x, m = np.linspace(0.0, 1.0, n), len(asked.arms)
    out = Tracks(np.empty(m, dtype=np.bool_), np.empty(m), np.empty((m, n)), np.empty((m, n, 6, 3)))
    bases = np.array([arm.base.homogeneous for arm in walker.arms])[asked.arms]
    given = [compiled.packed(array) for array in (bases, path.poses, way.at(x), blend(x))]
    where = [compiled.at(array) for array in (*given, asked.source, asked.target, asked.begin, asked.last, asked.least)]
    library.swing_tracks(
        ctypes.byref(compiled.arm(walker.data)),
        RULES,
        ctypes.byref(grips.table),
        ctypes.c_long(m),
        ctypes.c_long(n),
        ctypes.c_int(wrist_end(grips, asked.source, asked.target) - 3),
        ctypes.c_long(PASSES),
        *where[:2],
        ctypes.c_long(len(path)),
        ctypes.c_double(path.spacing),
        *where[2:],
        *(compiled.at(array) for array in (out.possible, out.duration, out.samples, out.points)),
    )
    return out


def _numpy(
    walker: Walker, arms: ArmClearance, path: BodyPath, grips: Grips, way: Curves, asked: Asked, n: int
) -> Tracks:
    """What the compiled code does."""
    times, kinematics = np.linspace(0.0, 1.0, n), ArmKinematics(walker.data)  # type: ignore[arg-type]
    wrists = grip_wrists(grips, asked.source, asked.target, n)
    for _ in range(PASSES):
        samples = np.minimum(asked.begin[:, None] + times / path.spacing, asked.last[:, None])
        found = speeds(kinematics, walker, asked.arms, path, way, samples, wrists)
        times = found.time
    duration, angles, possible = found.duration, found.angles, found.possible
    waits = duration < asked.least
    if waits.any():
        times = times * (asked.least / duration)[:, None]
        longer = np.minimum(asked.begin[:, None] + times / path.spacing, asked.last[:, None])
        samples = np.where(waits[:, None], longer, samples)
        again = speeds(kinematics, walker, asked.arms, path, way, samples, wrists)
        angles = np.where(waits[:, None, None], again.angles, angles)
        possible = np.where(waits, again.possible, possible)
    return Tracks(possible, duration, samples, _points(angles, asked.arms, arms))


def _points(angles: Array, rows: Ints, arms: ArmClearance) -> Array:
    """Points of arms (rows) at joints 1 to 5 or 6 ``[m, n, 5 or 6]``, in the body's frame ``[m, n, 6, 3]``."""
    postures = np.zeros((*angles.shape[:2], 6))
    postures[..., :5] = angles[..., :5]
    out = np.empty((*postures.shape[:2], 6, 3))
    for arm in np.unique(rows):
        out[rows == arm] = arms.points(int(arm), postures[rows == arm])
    return out
