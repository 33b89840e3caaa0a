"""Jerk-limited courses of all joints between two states: ruckig in units of the motion, and courses of our own.

ruckig's tolerances are absolute, and it fails in a quarter of states within 1e-11 of their target. A motion that is
measured in its own size and duration,

    p / P, v tau / P, a tau^2 / P, j tau^3 / P

is the same motion, and succeeds; its last position is off by 1e-8 P at most, which ``course.polished`` takes away.
What ruckig still refuses is driven as stop, course from rest to rest, and a stop run backwards.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from wbc import extras
from wbc.trajectory.jerk.course import (
    Course,
    Point,
    backwards,
    hard_stop,
    polished,
    rest_to_rest,
    stop,
    stretched,
)
from wbc.trajectory.laws.certificate import STEP
from wbc.validation import Array

#: Limits in units of the motion that no course can reach; ruckig is exact up to 1e9
UNREACHED = 1e7

#: A motion of no size [rad or m]
LEAST = 1e-200

#: What a course may miss its target by, and exceed its limits by, as a share of the motion and of the limit
NEAR = 1e-8


@dataclass(frozen=True, eq=False)
class StateTask:
    """Two states (3 x n: positions, velocities, accelerations) and the sizes allowed between them (n each)."""

    start: Array
    target: Array
    velocity: Array
    acceleration: Array
    jerk: Array

    @property
    def dof(self) -> int:
        return int(self.start.shape[1])

    @property
    def ends_at_rest(self) -> bool:
        """Whether joints may arrive early and wait."""
        return not self.target[1:].any()

    def joint(self, i: int) -> StateTask:
        """The task of one joint."""
        k = slice(i, i + 1)
        return StateTask(self.start[:, k], self.target[:, k], self.velocity[k], self.acceleration[k], self.jerk[k])

    def points(self, i: int) -> tuple[Point, Point]:
        """Start and target of a joint."""
        a, b = self.start[:, i].tolist(), self.target[:, i].tolist()
        return (a[0], a[1], a[2]), (b[0], b[1], b[2])

    @cached_property
    def units(self) -> tuple[float, float]:
        """A length P and a time tau of the size of the motion."""
        distance = np.abs(self.target[0] - self.start[0])
        speed = np.maximum(np.abs(self.start[1]), np.abs(self.target[1]))
        push = np.maximum(np.abs(self.start[2]), np.abs(self.target[2]))
        times = (
            np.cbrt(distance / self.jerk),
            np.sqrt(distance / self.acceleration),
            distance / self.velocity,
            np.sqrt(speed / self.jerk),
            speed / self.acceleration,
            push / self.jerk,
        )
        tau = float(np.max(times))
        return float(np.max([distance, speed * tau, push * tau * tau])), tau


def by_ruckig(task: StateTask, synchronisation: str, duration: float = 0.0) -> list[Course] | None:
    """A course a joint, None where ruckig refuses; ``synchronisation``: time, phase, none; ``duration``: at least."""
    extras.require("laws", "a jerk-limited law", "ruckig")
    import ruckig

    length, tau = task.units
    if length < LEAST:
        return [Course((p, 0.0, 0.0), (), ()) for p in task.start[0].tolist()]
    scale = np.array([1.0, tau, tau * tau])[:, None] / length
    asked: Any = ruckig.InputParameter(task.dof)
    asked.current_position = np.zeros(task.dof)
    asked.target_position = (task.target[0] - task.start[0]) * scale[0]
    asked.current_velocity, asked.target_velocity = task.start[1] * scale[1], task.target[1] * scale[1]
    asked.current_acceleration, asked.target_acceleration = task.start[2] * scale[2], task.target[2] * scale[2]
    asked.max_velocity = np.minimum(task.velocity * scale[1], UNREACHED)
    asked.max_acceleration = np.minimum(task.acceleration * scale[2], UNREACHED)
    asked.max_jerk = task.jerk * (tau * tau * tau / length)
    names = {"time": "Time", "phase": "Phase", "none": "No"}
    asked.synchronization = getattr(ruckig.Synchronization, names[synchronisation])
    if duration > 0.0:
        asked.minimum_duration = duration / tau
    answer = ruckig.Trajectory(task.dof)
    try:
        ruckig.Ruckig(task.dof).calculate(asked, answer)
    except (ruckig.RuckigError, ValueError):  # a ValueError: its binding does not know the code of long durations
        return None  # the caller has courses of its own
    courses = []
    for i, profile in enumerate(answer.profiles[0]):
        spans = [t * tau for t in (*profile.brake.t, *profile.t)]
        jerks = [j * (length / tau**3) for j in (*profile.brake.j, *profile.j)]
        first, last = task.points(i)
        courses.append(polished(Course(first, (), ()).then(tuple(spans), tuple(jerks)), last, 1e-13 * length))
    return _repaired(task, courses)


def _repaired(task: StateTask, courses: list[Course]) -> list[Course] | None:
    """Courses of joints that ruckig missed the target of, because it is measured in the units of a larger motion, in
    their own units; None where that does not help.
    """
    longest = max(c.duration for c in courses)
    for i, course in enumerate(courses):
        if arrives(task, i, course):
            continue
        for least in (course.duration, 0.0) if task.dof > 1 else ():
            alone = by_ruckig(task.joint(i), "none", least)
            if alone is not None and _in_time(task, alone[0].duration, longest):
                courses[i] = alone[0]
                break
        else:
            return None
    return courses


def _in_time(task: StateTask, duration: float, longest: float) -> bool:
    """Whether a course may stand beside others: who arrives at rest may wait."""
    early = task.ends_at_rest and duration <= longest
    return early or math.isclose(duration, longest, rel_tol=1e-12)


def arrives(task: StateTask, i: int, course: Course) -> bool:
    """Whether a joint's course ends in its target, to rounding, and satisfies its limits of speed and acceleration."""
    length, tau = task.joint(i).units
    here, there = course.points()[-1], task.points(i)[1]
    v, a = float(task.velocity[i]), float(task.acceleration[i])
    tolerance = (
        NEAR * length + 1e-14 * abs(there[0]),
        NEAR * length / tau if tau else 0.0,
        min(NEAR * length / (tau * tau), 0.5 * STEP * a) if tau else 0.0,
    )
    if not all(abs(x - y) <= r for x, y, r in zip(here, there, tolerance, strict=True)):
        return False
    pushes = [abs(point[2]) for point in course.points()]
    return course.fastest() <= v * (1.0 + NEAR) and max(pushes) <= a * (1.0 + NEAR)


def by_stops(
    task: StateTask, i: int, duration: float, hard: tuple[bool, bool] = (False, False), left: float = math.inf
) -> Course:
    """A joint's course that always exists: stop, from rest to rest, and the stop of the mirrored target backwards.

    It takes ``duration``, or its own least time where that is longer. ``hard``: stop over the least distance, at either
    end; ``left``: the largest deceleration at the end of that stop.
    """
    sizes = float(task.acceleration[i]), float(task.jerk[i])
    first, last = task.points(i)
    leave, arrive = (
        hard_stop(end, *sizes, left) if h else stop(end, *sizes)
        for h, end in zip(hard, (first, (last[0], -last[1], last[2])), strict=True)
    )
    distance = arrive.points()[-1][0] - leave.points()[-1][0]
    middle = rest_to_rest(distance, float(task.velocity[i]), *sizes)
    left_over = duration - leave.duration - arrive.duration
    if left_over > middle.duration:
        middle = stretched(middle, left_over) if middle.spans else Course(middle.start, (left_over,), (0.0,))
    return leave.then(middle.spans, middle.jerks).then(*backwards(arrive))


def plan(task: StateTask, synchronisation: str) -> list[Course]:
    """Courses of all joints, of one duration but for ``none``; never refused for a task within its limits."""
    for how in dict.fromkeys((synchronisation, "time")):
        courses = by_ruckig(task, how)
        if courses is not None:
            return courses
    alone = [by_ruckig(task.joint(i), "none") for i in range(task.dof)]
    own = [c[0] if c is not None else by_stops(task, i, 0.0) for i, c in enumerate(alone)]
    if task.ends_at_rest:
        return own  # who arrives early waits
    longest = max(by_stops(task, i, 0.0).duration for i in range(task.dof))
    return [by_stops(task, i, longest) for i in range(task.dof)]


def others(task: StateTask, i: int, duration: float) -> Iterator[Course]:
    """Further courses of one joint, tried where the first leaves its position limits: the fastest one, if it may wait
    for the rest, then stops at both ends, then stops over the least distance.
    """
    alone = by_ruckig(task.joint(i), "none")
    if alone is not None and _in_time(task, alone[0].duration, duration):
        yield alone[0]
    # Taking back the deceleration that is left when the joint stands moves it at up to left^2 / 2j
    left = math.sqrt(2.0 * float(task.velocity[i]) * float(task.jerk[i]))
    for hard in ((False, False), (True, False), (False, True), (True, True)):
        course = by_stops(task, i, duration, hard, left)
        if arrives(task, i, course):
            yield course
