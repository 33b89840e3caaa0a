"""Courses of single joints as one law."""

from __future__ import annotations

import numpy as np

from wbc.trajectory.jerk.course import Course
from wbc.trajectory.laws.certificate import STEP
from wbc.trajectory.laws.law import Law
from wbc.trajectory.laws.limits import MotionLimits
from wbc.trajectory.laws.timing import Timing
from wbc.trajectory.paths.path import PolynomialPath
from wbc.validation import Array

#: Duration of a law that has nowhere to go [s]: laws have a duration, and this one is short
STILL = 1e-6

#: Change of a direction that limits do not notice
NEARLY = 1e-9


def standing(position: Array, limits: MotionLimits) -> Law:
    """The law that stays where it is, for a microsecond."""
    return Law(PolynomialPath([0.0, STILL], position[None, None, :]), Timing.identity(STILL), limits)


def law_of(courses: list[Course], end: Array, limits: MotionLimits) -> Law:
    """Cubics in time between the union of all phases; a joint that arrives early waits at its ``end`` (3 x n)."""
    duration, accelerations = max(c.duration for c in courses), np.asarray(limits.acceleration).tolist()
    tables = [_table(c, end[:, i], duration) for i, c in enumerate(courses)]
    times = np.unique(np.concatenate([knots for knots, _ in tables]))
    # Breaks that differ by rounding are one
    times = times[np.concatenate([[True], np.diff(times) > 1e-15 * duration])]
    times[-1] = duration
    cubics = np.empty((4, len(times) - 1, len(courses)))
    middle = 0.5 * (times[:-1] + times[1:])
    for i, (knots, points) in enumerate(tables):
        knots = times[np.searchsorted(times, knots, side="right") - 1]
        phase = np.searchsorted(knots, middle, side="right") - 1
        since = times[:-1] - knots[phase]
        p, v, a = points[phase].T
        j = _jerks(courses[i], knots, accelerations[i])[phase]
        cubics[0, :, i], cubics[1, :, i] = j / 6.0, 0.5 * (a + j * since)
        cubics[2, :, i] = v + since * (a + 0.5 * j * since)
        cubics[3, :, i] = p + since * (v + since * (0.5 * a + j * since / 6.0))
    moving = (any(any(c.start[1:]) for c in courses), bool(end[1:].any()))
    return Law(PolynomialPath(times, cubics), Timing.identity(duration), limits, moving=moving)


def _table(course: Course, end: Array, duration: float) -> tuple[Array, Array]:
    """(times between phases, states there); who arrives early waits until the end."""
    points = [*course.points()[:-1], (float(end[0]), float(end[1]), float(end[2]))]
    knots = np.concatenate([[0.0], np.cumsum(course.spans)])
    if knots[-1] >= duration * (1.0 - 1e-12):
        knots[-1] = duration
        return knots, np.array(points)
    return np.append(knots, duration), np.array([*points, points[-1]])


def _jerks(course: Course, knots: Array, acceleration: float) -> Array:
    """Jerks of a course whose phases begin at ``knots``, which doubles tell from each other to some digits only: where
    a phase late in a long course would end in another acceleration than the next one begins with, by what counts as a
    jump beside the limit, the jerk that leads to it. Who waits has none.
    """
    spans, jerks = np.diff(knots), np.zeros(len(knots) - 1)
    jerks[: len(course.jerks)] = course.jerks
    changes = np.zeros(len(jerks))
    changes[: len(course.jerks)] = np.diff([point[2] for point in course.points()])
    off = np.abs(jerks * spans - changes) > 0.5 * STEP * acceleration
    np.divide(changes, spans, out=jerks, where=off & (spans > 0.0))
    return jerks


def along_line(course: Course, direction: Array, begin: Array, end: Array, limits: MotionLimits) -> Law:
    """q = start + s direction, with s the course, between two states (3 x n each)."""
    start, ends_moving = begin[0], bool(end[1:].any())
    (lowest, _), (highest, _) = course.extrema()
    tolerance = 1e-12 * (1.0 + abs(lowest) + abs(highest))
    points, times = course.points(), np.concatenate([[0.0], np.cumsum(course.spans)])
    with np.errstate(divide="ignore"):
        least = float(np.min(np.asarray(limits.acceleration) / np.abs(direction)))
    rows = [
        [jerk / 6.0, 0.5 * a, v, p]
        for (p, v, a), jerk in zip(points, _jerks(course, times, least).tolist(), strict=False)
    ]
    low, high = lowest - tolerance, highest + tolerance
    # Rounding of the course is made up for by the direction, unless its end is so near the start that little would
    # be much: limits along the line are those of the direction
    if abs(points[-1][0]) > NEARLY * (high - low):
        met = (end[0] - start) / points[-1][0]
        if np.abs(met - direction).max() <= NEARLY:
            direction = met
    path = PolynomialPath([low, high], [[direction], [start + low * direction]])
    moving = (any(course.start[1:]), ends_moving)
    return Law(path, Timing(times, np.array(rows).T), limits, moving=moving)
