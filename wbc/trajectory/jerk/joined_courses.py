"""Courses of single joints as one law."""

from __future__ import annotations

import numpy as np

from wbc.trajectory.jerk.course import Course, Point, moved
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
    duration = max(c.duration for c in courses)
    tables = [_table(c, end[:, i], duration) for i, c in enumerate(courses)]
    times = np.unique(np.concatenate([starts for starts, _, _ in tables] + [np.array([0.0, duration])]))
    # Breaks that differ by rounding are one
    apart = np.concatenate([[True], np.diff(times) > 1e-15 * duration])
    times = times[apart & (times <= duration)]
    times[-1] = duration
    cubics = np.empty((4, len(times) - 1, len(courses)))
    middle = 0.5 * (times[:-1] + times[1:])
    for i, (starts, points, jerks) in enumerate(tables):
        phase = np.searchsorted(starts, middle, side="right") - 1
        since = times[:-1] - starts[phase]
        p, v, a = points[phase].T
        j = jerks[phase]
        cubics[0, :, i], cubics[1, :, i] = j / 6.0, 0.5 * (a + j * since)
        cubics[2, :, i] = v + since * (a + 0.5 * j * since)
        cubics[3, :, i] = p + since * (v + since * (0.5 * a + j * since / 6.0))
    moving = (any(any(c.start[1:]) for c in courses), bool(end[1:].any()))
    return Law(PolynomialPath(times, cubics), Timing.identity(duration), limits, moving=moving)


def _table(course: Course, end: Array, duration: float) -> tuple[Array, Array, Array]:
    """(times at which phases begin, states there, jerks); the last phase waits."""
    points: list[Point] = course.points()
    starts = np.concatenate([[0.0], np.cumsum(course.spans)])
    jerks = [*course.jerks, 0.0]
    points[-1] = (float(end[0]), float(end[1]), float(end[2]))
    if starts[-1] >= duration * (1.0 - 1e-12):
        starts, points, jerks = starts[:-1], points[:-1], jerks[:-1]
    return starts, np.array(points), np.array(jerks)


def along_line(course: Course, direction: Array, begin: Array, end: Array, limits: MotionLimits) -> Law:
    """q = start + s direction, with s the course, between two states (3 x n each)."""
    start, ends_moving = begin[0], bool(end[1:].any())
    (lowest, _), (highest, _) = course.extrema()
    tolerance = 1e-12 * (1.0 + abs(lowest) + abs(highest))
    point, rows, times = course.start, [], [0.0]
    for span, jerk in zip(course.spans, course.jerks, strict=True):
        rows.append([jerk / 6.0, 0.5 * point[2], point[1], point[0]])
        point = moved(point, jerk, span)
        times.append(times[-1] + span)
    low, high = lowest - tolerance, highest + tolerance
    # Rounding of the course is made up for by the direction, unless its end is so near the start that little would
    # be much: limits along the line are those of the direction
    if abs(point[0]) > NEARLY * (high - low):
        met = (end[0] - start) / point[0]
        if np.abs(met - direction).max() <= NEARLY:
            direction = met
    path = PolynomialPath([low, high], [[direction], [start + low * direction]])
    moving = (any(course.start[1:]), ends_moving)
    return Law(path, Timing(times, np.array(rows).T), limits, moving=moving)
