"""Swings as the search has them: the law of each while the body moves, and the points of its arm."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.body_path import BodyPath
from wbc.walking.native import compiled
from wbc.walking.planner.grips.conflicts import LimbShapes
from wbc.walking.planner.grips.table import Grips, Ints
from wbc.walking.planner.swings.curve import Curves
from wbc.walking.planner.swings.joints import blend, guide_between, guided_end
from wbc.walking.planner.swings.least_time import rules, speeds
from wbc.walking.planner.swings.waiting import Waiting

#: How often the law is made, each time with the body where the last one has it
PASSES = 2


@dataclass(frozen=True, eq=False)
class Tracks:
    """m swings over n points: within reach and limits ``[m]``, duration ``[m]`` [s], samples of the path ``[m, n]``,
    and points of the arms in the body's frame ``[m, n, points, 3]``.
    """

    possible: NDArray[np.bool_]
    duration: Array
    samples: Array
    points: Array

    @staticmethod
    def of(swings: Waiting, rows: Ints, shapes: LimbShapes) -> Tracks:
        """Of swings of arms (rows) that wait, their three parts one after the other."""
        samples = np.concatenate([swings.away.samples, swings.samples, swings.onto.samples], axis=1)
        return Tracks(swings.possible, swings.duration, samples, points_along(shapes, rows, swings.angles))


@dataclass(frozen=True, eq=False)
class TrackRequests:
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
    walker: Walker, shapes: LimbShapes, path: BodyPath, grips: Grips, curve: Curves, asked: TrackRequests, n: int
) -> Tracks:
    """Swings along curves, at n points of each."""
    limb = shapes.limb
    library = compiled.library_for(limb)
    if library is None:
        return _numpy(walker, shapes, path, grips, curve, asked, n)
    x, m = np.linspace(0.0, 1.0, n), len(asked.arms)
    out = Tracks(np.empty(m, dtype=np.bool_), np.empty(m), np.empty((m, n)), np.empty((m, n, 6, 3)))
    bases = shapes.bases[asked.arms]
    given = [compiled.packed(array) for array in (bases, path.poses, curve.at(x), blend(x))]
    where = [compiled.at(array) for array in (*given, asked.source, asked.target, asked.begin, asked.last, asked.least)]
    library.swing_tracks(
        compiled.arm_of(limb),
        rules(walker.margins),
        ctypes.byref(grips.table),
        ctypes.c_long(m),
        ctypes.c_long(n),
        ctypes.c_int(guided_end(limb, grips, asked.source, asked.target) - limb.guided),
        ctypes.c_long(PASSES),
        *where[:2],
        ctypes.c_long(len(path)),
        ctypes.c_double(path.spacing),
        *where[2:],
        *(compiled.at(array) for array in (out.possible, out.duration, out.samples, out.points)),
    )
    return out


def _numpy(
    walker: Walker, shapes: LimbShapes, path: BodyPath, grips: Grips, curve: Curves, asked: TrackRequests, n: int
) -> Tracks:
    """What the compiled code does."""
    times = np.linspace(0.0, 1.0, n)
    guide = guide_between(shapes.limb, grips, asked.source, asked.target, n)
    for _ in range(PASSES):
        samples = np.minimum(asked.begin[:, None] + times / path.spacing, asked.last[:, None])
        found = speeds(walker, asked.arms, path, curve, samples, guide)
        times = found.time
    duration, angles, possible = found.duration, found.angles, found.possible
    waits = duration < asked.least
    if waits.any():
        times = times * (asked.least / duration)[:, None]
        longer = np.minimum(asked.begin[:, None] + times / path.spacing, asked.last[:, None])
        samples = np.where(waits[:, None], longer, samples)
        again = speeds(walker, asked.arms, path, curve, samples, guide)
        angles = np.where(waits[:, None, None], again.angles, angles)
        possible = np.where(waits, again.possible, possible)
    return Tracks(possible, duration, samples, points_along(shapes, asked.arms, angles))


def points_along(shapes: LimbShapes, rows: Ints, angles: Array) -> Array:
    """Points of arms (rows) at joints, the last of which may be left out ``[m, n, joints]``, in the body's frame
    ``[m, n, points, 3]``; the last joint, which turns the hand about its own axis, moves none of them.
    """
    count = len(shapes.limb.position_limits)
    postures = np.zeros((*angles.shape[:2], count))
    postures[..., : count - 1] = angles[..., : count - 1]
    return shapes.points_of(rows, postures)
