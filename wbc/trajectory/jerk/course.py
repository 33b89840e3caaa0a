"""One joint under piecewise constant jerk: exact states, extrema, stops and rest-to-rest courses in closed form.

p(t) = p + v t + a t^2 / 2 + j t^3 / 6:

exact states and extrema, stops and courses from rest to rest in closed form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wbc.validation import Array

#: (position, velocity, acceleration) of one joint
Point = tuple[float, float, float]


def moved(point: Point, jerk: float, span: float) -> Point:
    """The state after ``span`` seconds under constant jerk."""
    p, v, a = point
    return (
        p + span * (v + span * (a / 2.0 + span * jerk / 6.0)),
        v + span * (a + span * jerk / 2.0),
        a + span * jerk,
    )


@dataclass(frozen=True)
class Course:
    """A start and phases of constant jerk.

    Attributes:
        start: position, velocity, acceleration at time 0.
        spans: durations of the phases [s], all > 0. jerks: of the phases.
    """

    start: Point
    spans: tuple[float, ...]
    jerks: tuple[float, ...]

    @property
    def duration(self) -> float:
        """[s]."""
        return math.fsum(self.spans)

    def points(self) -> list[Point]:
        """States at the beginning of every phase, and at the end."""
        return list(self._points)

    @cached_property
    def _points(self) -> tuple[Point, ...]:
        out = [self.start]
        for jerk, span in zip(self.jerks, self.spans, strict=True):
            out.append(moved(out[-1], jerk, span))
        return tuple(out)

    def extrema(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """((lowest position, its time), (highest position, its time)), exact: at ends and where v = 0."""
        low = high = (self.start[0], 0.0)
        time = 0.0
        for point, jerk, span in zip(self.points(), self.jerks, self.spans, strict=False):
            inside = [u for u in _zeros(0.5 * jerk, point[2], point[1]) if 0.0 < u < span]
            for u in (*inside, span):
                here = (moved(point, jerk, u)[0], time + u)
                low, high = min(low, here), max(high, here)
            time += span
        return low, high

    def fastest(self) -> float:
        """The highest speed, exact: at ends of phases and where a = 0."""
        out = abs(self.start[1])
        for point, jerk, span in zip(self._points, self.jerks, self.spans, strict=False):
            top = -point[2] / jerk if jerk else 0.0
            places = (top, span) if 0.0 < top < span else (span,)
            out = max(out, *(abs(moved(point, jerk, u)[1]) for u in places))
        return out

    def then(self, spans: tuple[float, ...], jerks: tuple[float, ...]) -> Course:
        """With further phases; those without duration are left out."""
        some = [(t, j) for t, j in zip(spans, jerks, strict=True) if t > 0.0]
        return Course(self.start, self.spans + tuple(t for t, _ in some), self.jerks + tuple(j for _, j in some))


def _zeros(a: float, b: float, c: float) -> tuple[float, ...]:
    """Real roots of a x^2 + b x + c, without cancellation."""
    square = b * b - 4.0 * a * c
    if square < 0.0:
        return ()
    far = -0.5 * (b + math.copysign(math.sqrt(square), b))
    return tuple(x for x in ((far / a) if a else math.inf, (c / far) if far else math.inf) if math.isfinite(x))


def stop(point: Point, acceleration: float, jerk: float) -> Course:
    """To rest in the shortest time, with at most these sizes.

    With v > -a|a|/(2 j), the speed that is left when the acceleration is taken back: down to the acceleration -d,
    d^2 = min(A^2, j v + a^2/2), hold, and up to 0; mirrored for the other sign. An acceleration beyond A comes back
    to A first.
    """
    start = point
    lead: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())
    if abs(point[2]) > acceleration:
        back, span = -math.copysign(jerk, point[2]), (abs(point[2]) - acceleration) / jerk
        lead, point = ((span,), (back,)), moved(point, back, span)
    _, v, a = point
    rest = v + a * abs(a) / (2.0 * jerk)
    sign = 1.0 if rest >= 0.0 else -1.0
    v, a = sign * v, sign * a
    deepest = math.sqrt(max(jerk * v + 0.5 * a * a, 0.0))
    hold = 0.0
    if deepest > acceleration:
        hold = (v + 0.5 * a * a / jerk - acceleration * acceleration / jerk) / acceleration
        deepest = acceleration
    spans = (max(a + deepest, 0.0) / jerk, max(hold, 0.0), deepest / jerk)
    return Course(start, (), ()).then(*lead).then(spans, (-sign * jerk, 0.0, sign * jerk))


def hard_stop(point: Point, acceleration: float, jerk: float, left: float = math.inf) -> Course:
    """To v = 0 over the least distance, with a deceleration of at most ``left`` then, and from there to rest.

    The least distance: jerk against the motion down to the deceleration d, d^2 = min(A^2, j v + (a^2 + left^2)/2),
    hold, and up to ``left`` where v = 0. Taking that back moves the joint at up to left^2/2j in the other direction.
    """
    _, v, a = point
    if v == 0.0 or abs(a) > acceleration:
        return stop(point, acceleration, jerk)
    sign = math.copysign(1.0, v)
    v, a = abs(v), sign * a
    end = min(left, acceleration)
    deepest = math.sqrt(max(jerk * v + 0.5 * (a * a + end * end), 0.0))
    if deepest >= max(end, -a):
        hold = max((v + 0.5 * (a * a + end * end) / jerk) / acceleration - acceleration / jerk, 0.0)
        deepest = min(deepest, acceleration)
        spans = (a + deepest) / jerk, hold, (deepest - end) / jerk
    else:
        spans = min((u for u in _zeros(-0.5 * jerk, a, v) if u > 0.0), default=0.0), 0.0, 0.0
    first = Course(point, (), ()).then(spans, (-sign * jerk, 0.0, sign * jerk))
    after = stop(first.points()[-1], acceleration, jerk)
    return first.then(after.spans, after.jerks)


def rest_to_rest(distance: float, velocity: float, acceleration: float, jerk: float) -> Course:
    """The shortest course over a ``distance`` from rest to rest from position 0; no phases where it is 0.

    Jerk phases of u, acceleration held for h, cruise for c:

        distance = (2 u + h + c) v,    v = j u (u + h) <= V,    j u <= A
    """
    size = abs(distance)
    u = min(math.cbrt(size / (2.0 * jerk)), math.sqrt(velocity / jerk), acceleration / jerk)
    hold = cruise = 0.0
    if u == acceleration / jerk:
        # distance = A (u + h)(2 u + h) for the hold, as far as the speed A (u + h) may grow
        hold = 0.5 * (math.sqrt(u * u + 4.0 * size / acceleration) - 3.0 * u)
        hold = max(min(hold, velocity / acceleration - u), 0.0)
    speed = jerk * u * (u + hold)
    if speed > 0.0:
        cruise = max(size / speed - 2.0 * u - hold, 0.0)
    j = math.copysign(jerk, distance)
    return Course((0.0, 0.0, 0.0), (), ()).then((u, hold, u, cruise, u, hold, u), (j, 0.0, -j, 0.0, -j, 0.0, j))


def stretched(course: Course, duration: float) -> Course:
    """A course from rest to rest in more time, every phase by the same factor."""
    if not course.spans:
        return course
    factor = duration / course.duration
    return Course(
        course.start,
        tuple(t * factor for t in course.spans),
        tuple(j / (factor * factor * factor) for j in course.jerks),
    )


def backwards(course: Course) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Phases of the course from its end to its start: v -> -v, a -> a, j -> -j."""
    return course.spans[::-1], tuple(-j for j in reversed(course.jerks))


def polished(course: Course, end: Point, tolerance: float = 0.0) -> Course:
    """The same jerks with durations changed by the least that ends in ``end``, the sum of durations kept; as it is
    where that is nearer than ``tolerance``, velocities counted over the duration of the course.

    ruckig's last position is off by up to 1e-8 of its unit. A longer phase k moves the end by what its own end moves,
    (v, a, j) dt, carried over the time R that is left: (v + a R + j R^2/2, a + j R, j) dt.
    """
    for _ in range(2):
        points, span = course.points(), course.duration
        weight = (1.0, span, span * span)
        before = max(abs(x - y) * w for x, y, w in zip(end, points[-1], weight, strict=True))
        if before <= tolerance or len(course.spans) < 4:
            return course
        off = np.subtract(end, points[-1])
        left = span - np.cumsum(course.spans)
        jerks = np.array(course.jerks)
        v, a = np.array(points[1:])[:, 1:].T
        moves = np.array([v + left * (a + 0.5 * jerks * left), a + jerks * left, jerks]) * np.array(weight)[:, None]
        rows = np.vstack([moves, np.full(len(jerks), float(np.abs(moves).max()))])
        change: Array = np.linalg.lstsq(rows, np.append(off * weight, 0.0), rcond=1e-9)[0]
        if (np.array(course.spans) + change <= 0.0).any():
            return course
        tried = Course(course.start, tuple((np.array(course.spans) + change).tolist()), course.jerks)
        after = float(np.abs(np.subtract(end, tried.points()[-1]) * weight).max())
        if after >= before:
            return course
        course = tried
    return course
