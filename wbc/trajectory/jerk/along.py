"""Jerk-limited laws along paths."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import BoundsError, ContinuityError, InfeasibleError, ShapeError
from wbc.trajectory.jerk.between_states import limits_of, sizes_of
from wbc.trajectory.jerk.joined_courses import STILL
from wbc.trajectory.jerk.path_speed import Stretch, fastest
from wbc.trajectory.laws.certificate import TOLERANCE
from wbc.trajectory.laws.law import Law
from wbc.trajectory.laws.limits import MotionLimits
from wbc.trajectory.laws.timing import Timing
from wbc.trajectory.paths.path import Path
from wbc.validation import Array

#: Steps of the first or second derivative at a knot, as a share of its size, that are rounding
STEP = 1e-9

#: Coordinates of knots are off by this share of them
ROUNDING = 8.0 * float(np.finfo(float).eps)

#: Parts into which a path may be cut at most
MOST_CELLS = 20_000.0
#: Laws are slowed down by this share more than the certificate asks for
MARGIN = 1e-9


def jerk_limited_along(
    path: Path,
    *,
    velocity: Any,
    acceleration: Any,
    jerk: Any,
    lower: Any = None,
    upper: Any = None,
    stops: bool = False,
    cells: int = 200,
) -> Law:
    """A fast law exactly on a path, from rest to rest, with bounded jerk:

        |q' s'| <= V,    |q'' s'^2 + q' s''| <= A,    |q''' s'^3 + 3 q'' s' s'' + q' s'''| <= J

    by linear programs over the squared path speed (after D. Verscheure et al., "Time-optimal path tracking for robots:
    a convex optimization approach", IEEE TAC 54(10), 2009, with the jerk's limit replaced by its tangents), quintics in
    time between grid points, and a uniform slowing down by what the certificate still finds: max(v, sqrt a, cbrt j).

    Args:
        path: twice continuously differentiable between its ends, and moving everywhere; else see ``stops``.
        velocity, acceleration, jerk: n finite positive numbers, or one for all [per s, s^2, s^3]; for poses 6.
        lower, upper: limits of joint positions; a path that leaves them is refused.
        stops: come to rest where the direction or the curvature of the path jumps, instead of refusing it.
        cells: of the grid between two stops; more come nearer to the limits, and take longer.

    Raises:
        ShapeError, NotFiniteError, RangeError, BoundsError: of arguments; BoundsError: the path leaves its limits.
        ContinuityError: direction or curvature jump, with the coordinate, and not ``stops``. InfeasibleError: a part
            of the path between two stops begins without moving, or no speed is found.
    """
    if not isinstance(path, Path):
        raise ShapeError("path", path, "expected a path")
    cells = int(validation.scalar("cells", cells, low=8.0, high=MOST_CELLS))
    stops = validation.flag("stops", stops)
    limits = limits_of(path.dof, velocity, acceleration, jerk, lower, upper)
    breaks = _breaks(path)
    if breaks and not stops:
        place, what = breaks[0]
        raise ContinuityError(
            "path", place, f"{what} jumps at this coordinate, which no finite jerk follows; stops=True rests there"
        )
    ends = [float(path.knots[0]), *(place for place, _ in breaks), float(path.knots[-1])]
    timing: Timing | None = None
    for start, end in itertools.pairwise(ends):
        part = _part(path, start, end, sizes_of(limits), cells)
        timing = part if timing is None else timing.then(part, 0.0)
    assert timing is not None
    law = Law(path, timing, limits)
    slower = _slower(law)
    if slower > 1.0:
        law = law.scaled(slower * (1.0 + MARGIN))
    position = law.certificate.worst.get("position")
    if position is not None and position.ratio > 1.0 + TOLERANCE:
        value = float(law.at(position.time).position[position.joint])
        raise BoundsError(f"position of joint {position.joint}", value, "the path leaves the limits of this joint")
    return law


def _part(path: Path, start: float, end: float, sizes: tuple[Array, Array, Array], cells: int) -> Timing:
    """The timing between two stops; of a part on which nothing moves, a moment."""
    stretch = Stretch.of(path, start, end, sizes, cells)
    if not any(part.any() for place in (0.0, 0.5, 1.0) for part in stretch.derivatives(place)):
        return Timing([0.0, STILL], [[(end - start) / STILL], [start]])
    timing = fastest(stretch)
    return timing.scaled(_slower(Law(path, timing, None), sizes))


def _slower(law: Law, sizes: tuple[Array, Array, Array] | None = None) -> float:
    """The factor of time at which the limits are just satisfied, at least 1."""
    if sizes is not None:
        law = law.with_limits(MotionLimits(velocity=sizes[0], acceleration=sizes[1], jerk=sizes[2]))
    worst = law.certificate.worst
    factor = 1.0
    for order, name in enumerate(("velocity", "acceleration", "jerk"), 1):
        if not np.isfinite(worst[name].ratio):
            raise InfeasibleError("path", worst[name].time, f"{name} has no bound at this time")
        factor = max(factor, worst[name].ratio ** (1.0 / order))
    return factor


def _breaks(path: Path) -> list[tuple[float, str]]:
    """Inner knots at which the direction or the curvature jumps, as shares of their largest sizes anywhere."""
    knots = path.knots[1:-1]
    if not knots.size:
        return []
    before = np.arange(len(knots))
    pieces = np.arange(len(knots) + 1)
    starts, spans = path.knots[:-1], np.diff(path.knots)
    sizes = []
    for order in (1, 2):
        inside = [np.abs(path.evaluate(starts + u * spans, order, pieces)).max() for u in np.linspace(0.0, 1.0, 9)]
        sizes.append(max(*map(float, inside), 1e-300))
    # A second derivative that turns the direction by less than rounding over the whole path is none
    sizes[1] = max(sizes[1], sizes[0] / path.length)
    steps = []
    # A knot is known to its rounding, by which a derivative changes as fast as the next one says
    rounding = ROUNDING * np.abs(knots)[:, None]
    for order, size in enumerate(sizes, 1):
        left, right = path.evaluate(knots, order, before), path.evaluate(knots, order, before + 1)
        change = np.maximum(*(np.abs(path.evaluate(knots, order + 1, before + k)) for k in (0, 1)))
        steps.append((np.abs(right - left) - rounding * change).max(axis=1) / size)
    return [
        (float(s), "the direction" if first > STEP else "the curvature")
        for s, first, second in zip(knots, *steps, strict=True)
        if max(first, second) > STEP
    ]
