"""How far one joint goes until it stands, and its next state under its shortest stop: plain floats, for a loop."""

from __future__ import annotations

from math import sqrt

from wbc.trajectory.jerk.course import Course, Point, hard_stop, moved, stop


def reach(v: float, a: float, acceleration: float, jerk: float) -> tuple[float, float]:
    """(lowest, highest) displacement on the shortest course to rest of a joint with velocity v and acceleration a.

    While it only slows down, one is 0 and the other

        v t1 + a t1^2/2 - j t1^3/6  +  (d^2/2j) t2 + d t2^2/2  +  d^3/6j^2

    for down to the deceleration d in t1, hold for t2, and back up; mirrored for v < 0.
    """
    if v == 0.0 and a == 0.0:
        return 0.0, 0.0
    rest = v + a * abs(a) / (2.0 * jerk)
    if v * rest < 0.0 or abs(a) > acceleration:
        low, high = stop((0.0, v, a), acceleration, jerk).extrema()
        return low[0], high[0]
    backwards = rest < 0.0 or v < 0.0
    if backwards:
        v, a = -v, -a
    square, hold = jerk * v + 0.5 * a * a, 0.0
    if square > acceleration * acceleration:
        deepest = acceleration
        hold = (square - acceleration * acceleration) / (jerk * acceleration)
    else:
        deepest = sqrt(square)
    down = max(a + deepest, 0.0) / jerk
    distance = down * (v + down * (0.5 * a - jerk * down / 6.0))
    distance += hold * 0.5 * deepest * (deepest / jerk + hold) + deepest * deepest * deepest / (6.0 * jerk * jerk)
    return (-distance, 0.0) if backwards else (0.0, distance)


def after(course: Course, time: float) -> Point:
    """The state at a time; after the end, the last one."""
    point = course.start
    for span, jerk in zip(course.spans, course.jerks, strict=True):
        if time <= span:
            return moved(point, jerk, time)
        point, time = moved(point, jerk, span), time - span
    return point


def guarded(
    now: Point, wanted: Point, walls: tuple[float, float], sizes: tuple[float, float], dt: float, tolerance: float
) -> Point | None:
    """What a joint does instead of going to ``wanted`` in the next tick, None where it may.

    It may go where its shortest stop stays within its walls, (low, high), or goes no farther outside than the one from
    ``now``. Otherwise it takes a tick of that stop, or of the one over the least distance once the former leaves the
    limits. Stops from states on a stop are its rest: who starts with a stop within the limits keeps having one.

    Args:
        sizes: largest acceleration and jerk.
    """
    (low, high), (acceleration, jerk) = walls, sizes
    below, above = reach(wanted[1], wanted[2], acceleration, jerk)
    below, above = wanted[0] + below, wanted[0] + above
    if below >= low - tolerance and above <= high + tolerance:
        return None
    lowest, highest = reach(now[1], now[2], acceleration, jerk)
    lowest, highest = now[0] + lowest, now[0] + highest
    if below >= min(low, lowest) - tolerance and above <= max(high, highest) + tolerance:
        return None
    inside = lowest >= low - tolerance and highest <= high + tolerance
    course = stop(now, acceleration, jerk) if inside else hard_stop(now, acceleration, jerk)
    p, v, a = after(course, dt)
    if dt >= course.duration:
        v = a = 0.0
    return p, v, a
