"""Jerk-limited laws from one state to another."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from wbc import validation
from wbc.errors import BoundsError, ContinuityError, InfeasibleError, RangeError, ShapeError
from wbc.trajectory.jerk.course import Course
from wbc.trajectory.jerk.joined_courses import along_line, law_of, standing
from wbc.trajectory.jerk.state_to_state import StateTask, by_ruckig, by_stops, others, plan
from wbc.trajectory.laws.law import Law
from wbc.trajectory.laws.limits import MotionLimits, for_all
from wbc.validation import Array, bound_text

Synchronisation = Literal["time", "phase", "none"]

#: Speeds and accelerations across the line, as a share of their size, that are rounding
ACROSS = 1e-9

#: Positions outside their limits by less than this share of the range are rounding
STATE_TOLERANCE = 1e-10


def jerk_limited(
    start: Any,
    target: Any,
    *,
    velocity: Any,
    acceleration: Any,
    jerk: Any,
    lower: Any = None,
    upper: Any = None,
    start_velocity: Any = None,
    start_acceleration: Any = None,
    target_velocity: Any = None,
    target_acceleration: Any = None,
    synchronisation: Synchronisation = "time",
    straight: bool = False,
) -> Law:
    """The shortest law between two states with bounded jerk (L. Berscheid, T. Kroeger, "Jerk-limited real-time
    trajectory generation with arbitrary target states", RSS 2021):

        q(0), dq(0), d2q(0) = start,    q(T), dq(T), d2q(T) = target,    |dq| <= V, |d2q| <= A, |d3q| <= J

    A joint that leaves its position limits in between is driven otherwise: as fast as it can where it may wait at its
    target, else it stops (first in the shortest time, then over the least distance), and goes on from rest to rest.

    Args:
        start, target: n joint coordinates [rad or m].
        velocity, acceleration, jerk: n finite positive numbers, or one for all joints [per s, s^2, s^3].
        lower, upper: limits of positions, n, or one for all joints; inf where there is none.
        start_velocity, start_acceleration, target_velocity, target_acceleration: n each, 0 by default.
        synchronisation: joints arrive together (``time``); together and in the same proportion, where that takes no
            longer than ``time`` (``phase``); each as fast as it can (``none``: only to targets at rest).
        straight: on the straight line from start to target, whatever the limits are:
            q = start + s (target - start) / |target - start|, with the limits on s that all joints leave.

    Raises:
        ShapeError, NotFiniteError, UnknownNameError: of arguments. RangeError: limits not positive, a velocity or
            acceleration at an end beyond its limit, ``none`` with a moving target. BoundsError: start or target
            outside the position limits, or a joint that leaves them whatever is tried, with the time and the position.
        InfeasibleError: an end state whose acceleration carries the velocity beyond its limit. ContinuityError:
            ``straight`` with velocities or accelerations across the line.
    """
    validation.one_of("synchronisation", synchronisation, ("time", "phase", "none"))
    straight = validation.flag("straight", straight)
    begin = _state("start", start, start_velocity, start_acceleration, None)
    end = _state("target", target, target_velocity, target_acceleration, begin.shape[1])
    limits = limits_of(begin.shape[1], velocity, acceleration, jerk, lower, upper)
    _check_inside("start", begin, limits, 1.0)
    _check_inside("target", end, limits, -1.0)
    task = StateTask(begin, end, *sizes_of(limits))
    if synchronisation == "none" and not task.ends_at_rest:
        raise RangeError("synchronisation", synchronisation, "joints that arrive one by one must arrive at rest")
    if straight:
        return _on_line(task, limits)
    courses = _within(task, plan(task, synchronisation), limits)
    return law_of(courses, end, limits) if any(c.spans for c in courses) else standing(begin[0], limits)


def limits_of(dof: int, velocity: Any, acceleration: Any, jerk: Any, lower: Any, upper: Any) -> MotionLimits:
    """Limits of so many joints, from numbers for all of them or one for each; sizes must be finite.

    Raises:
        ShapeError, NotFiniteError, RangeError, BoundsError: as of :class:`~wbc.trajectory.laws.limits.MotionLimits`.
    """
    sizes = {}
    for name, value in (("velocity", velocity), ("acceleration", acceleration), ("jerk", jerk)):
        sizes[name] = for_all(f"limits.{name}", value, dof, finite=True)
    if lower is None and upper is None:
        return MotionLimits(**sizes)
    low, high = (none if x is None else x for x, none in ((lower, -np.inf), (upper, np.inf)))
    return MotionLimits(for_all("limits.lower", low, dof), for_all("limits.upper", high, dof), **sizes)


def sizes_of(limits: MotionLimits) -> tuple[Array, Array, Array]:
    """Limits of velocity, acceleration and jerk, all of which there are."""
    assert limits.velocity is not None
    assert limits.acceleration is not None
    assert limits.jerk is not None
    return limits.velocity, limits.acceleration, limits.jerk


def _state(name: str, position: Any, velocity: Any, acceleration: Any, dof: int | None) -> Array:
    given = np.atleast_1d(validation.ordinary_array(name, position))
    if not given.size:
        raise ShapeError(name, position, "expected one number for each joint")
    shape = (len(given) if dof is None else dof,)
    rows = [validation.ordinary_array(name, given, shape)]
    for part, value in (("velocity", velocity), ("acceleration", acceleration)):
        rows.append(np.zeros(shape) if value is None else validation.ordinary_array(f"{name}_{part}", value, shape))
    return np.stack(rows)


def _check_inside(name: str, state: Array, limits: MotionLimits, towards: float) -> None:
    """Ends within the limits, also of what their acceleration makes of the velocity (towards the future: 1)."""
    v, a, j = sizes_of(limits)
    if limits.lower is not None and limits.upper is not None:
        out = np.flatnonzero((state[0] < limits.lower) | (state[0] > limits.upper))
        if out.size:
            i = int(out[0])
            bounds = f"{bound_text(limits.lower[i], 1)} to {bound_text(limits.upper[i], -1)}"
            raise BoundsError(name, float(state[0, i]), f"joint {i} is outside its limits, {bounds}")
    for part, row, limit in (("velocity", state[1], v), ("acceleration", state[2], a)):
        out = np.flatnonzero(np.abs(row) > limit)
        if out.size:
            i = int(out[0])
            raise RangeError(
                f"{name}_{part}", float(row[i]), f"joint {i}: expected at most {bound_text(limit[i], -1)} in size"
            )
    change = towards * state[2] * np.abs(state[2]) / (2.0 * j)
    out = np.flatnonzero(np.abs(state[1] + change) > v * (1.0 + 1e-9))
    if out.size:
        i = int(out[0])
        least, most = max(-v[i], -v[i] - change[i]), min(v[i], v[i] - change[i])
        if least > most:
            slow = float(bound_text(v[i], -1))
            push = bound_text(np.sqrt(2.0 * j[i] * (v[i] + slow)), -1)
            allowed = f"{push}, with a velocity of {-np.copysign(slow, change[i]):g}"
            raise InfeasibleError(
                f"{name}_acceleration",
                float(state[2, i]),
                f"joint {i}: with any velocity at this end the velocity passes {v[i]:g}; largest that works: {allowed}",
            )
        raise InfeasibleError(
            f"{name}_velocity",
            float(state[1, i]),
            f"joint {i}: with its acceleration of {state[2, i]:g} the velocity passes {v[i]:g}; what works: "
            f"{bound_text(least, 1)} to {bound_text(most, -1)}",
        )


def _within(task: StateTask, courses: list[Course], limits: MotionLimits) -> list[Course]:
    """Courses that keep the position limits, the given ones where they do."""
    if limits.lower is None or limits.upper is None:
        return courses
    duration = max(c.duration for c in courses)
    for _ in range(8):
        longest = duration
        for i in range(task.dof):
            if _escape(courses[i], limits, i) is None:
                continue
            courses[i] = _kept(task, i, courses[i], duration, limits)
            longest = max(longest, courses[i].duration)
        if longest <= duration * (1.0 + 1e-12) or task.ends_at_rest:
            return courses
        # One joint takes longer than all did: so do the others
        duration = longest
        again = by_ruckig(task, "time", duration)
        courses = again if again is not None else [by_stops(task, i, duration) for i in range(task.dof)]
        duration = max(c.duration for c in courses)
    i = max(range(task.dof), key=lambda k: courses[k].duration)
    raise InfeasibleError("target_velocity", task.target[1].tolist(), f"joint {i} finds no common time of arrival")


def _kept(task: StateTask, i: int, first: Course, duration: float, limits: MotionLimits) -> Course:
    for course in others(task, i, duration):
        if _escape(course, limits, i) is None:
            return course
    escape = _escape(first, limits, i)
    assert escape is not None
    value, time = escape
    raise BoundsError(
        f"position of joint {i}",
        value,
        f"leaves its limits at {time:.6g} s; tried: the shortest course, stops in the shortest time and over the least "
        "distance at either end",
    )


def _escape(course: Course, limits: MotionLimits, i: int) -> tuple[float, float] | None:
    """(position, time) farthest outside the limits of the joint, None where it stays within them."""
    assert limits.lower is not None
    assert limits.upper is not None
    low, high = float(limits.lower[i]), float(limits.upper[i])
    below, above = course.extrema()
    size = high - low if np.isfinite(high - low) else max(abs(x) for x in (low, high, 1.0) if np.isfinite(x))
    if above[0] > high + STATE_TOLERANCE * size:
        return above
    return below if below[0] < low - STATE_TOLERANCE * size else None


def _on_line(task: StateTask, limits: MotionLimits) -> Law:
    """One course along start + s u, |u| = 1."""
    displacement = task.target[0] - task.start[0]
    vectors = (displacement, *task.start[1:], *task.target[1:])
    lengths = [float(np.linalg.norm(x)) for x in vectors]
    along = next((x for x, size in zip(vectors, lengths, strict=True) if size), None)
    if along is None:
        return standing(task.start[0], limits)
    u = along / np.abs(along).max()
    u = u / np.linalg.norm(u)
    for name, state in (("start", task.start), ("target", task.target)):
        for part, row in (("velocity", state[1]), ("acceleration", state[2])):
            across = float(np.abs(row - u * (row @ u)).max())
            if across > ACROSS * float(np.abs(row).max()):
                raise ContinuityError(f"{name}_{part}", row.tolist(), f"is not along the line, {across:g} across it")
    moving = u != 0.0
    sizes = [
        np.array([float(np.min(x[moving] / np.abs(u[moving])))]) for x in (task.velocity, task.acceleration, task.jerk)
    ]
    first = np.array([0.0, task.start[1] @ u, task.start[2] @ u])
    last = np.array([displacement @ u, task.target[1] @ u, task.target[2] @ u])
    scalar = StateTask(first[:, None], last[:, None], *sizes)
    course = plan(scalar, "none")[0]
    law = along_line(course, u, task.start, task.target, limits)
    for i in range(task.dof):
        joint = Course(
            (float(task.start[0, i]), float(first[1] * u[i]), float(first[2] * u[i])),
            course.spans,
            tuple(j * float(u[i]) for j in course.jerks),
        )
        if limits.lower is not None and _escape(joint, limits, i) is not None:
            value, time = _escape(joint, limits, i) or (0.0, 0.0)
            raise BoundsError(f"position of joint {i}", value, f"leaves its limits at {time:.6g} s on a straight line")
    return law
