"""A path that was planned: straight pieces, or points on what equality rows leave, and smooth laws of motion on it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import InfeasibleError
from wbc.plan.coordinates import PlanningCoordinates
from wbc.plan.native import NativePlanner
from wbc.stack.declaration import Declaration
from wbc.tasks import FrameVelocityLimit
from wbc.trajectory import Law, PolynomialPath, blend_path, jerk_limited_along, spline_path, standing_path, time_optimal
from wbc.trajectory.paths.joint_paths import joint_polyline
from wbc.validation import Array

#: Corners are rounded by this at most [rad, or characteristic lengths], then by half as much, until the path is proven
ROUNDED = 0.1
#: and by no less than this: then the law rests at the corners
LEAST_ROUNDED = 1e-4
#: Equality rows hold within this on a path [rad, m], where points between its points may be projected
KEPT = 1e-6
#: Samples may be off by this part of it, as rows are off by more between them
SEEN = 0.9
#: Points of a path that are nearer to another one are none of its smooth path [rad or m]
CLOSE = 1e-3
#: Rounds at most in which points are added to a smooth path
PASSES = 20
#: Points of a smooth path at most
MOST_POINTS = 4000
#: Samples between two points of a smooth path at which rows are looked at
SAMPLES = 5
#: Joints whose acceleration nothing limits reach their full speed in this time [s]
RAMP = 0.25
#: and those with jerk limits their full acceleration in this [s]
JERK_RAMP = 0.05
#: Speed of joints without a limit [rad/s, or characteristic lengths per second]
UNLIMITED = 1.0


@dataclass(frozen=True, eq=False)
class PlannedPath:
    """A path between configurations, on which all hard rows of the stack hold.

    Attributes:
        coordinates: in which it was planned; the laws are of these.
        corners: points that the search left [corners, n].
        length: sum of the distances of corners [rad, or characteristic lengths].
        seconds: what planning took [s].
        shortening: processor time that went into making paths shorter [s].
        nodes: of the two trees of the last search.
    """

    coordinates: PlanningCoordinates = field(repr=False)
    native: NativePlanner = field(repr=False)
    stack: Declaration = field(repr=False)
    corners: Array = field(repr=False)
    length: float
    seconds: float
    shortening: float
    nodes: tuple[int, int]

    @cached_property
    def points(self) -> Array:
        """Straight between them the path is clear, and equality rows hold within 1e-6: as near to each other as these
        want it [points, n].

        Raises:
            InfeasibleError: points on the rows are not clear, or there are none.
        """
        points = self.corners
        while self.native.path_rows.equalities:
            middle = 0.5 * (points[:-1] + points[1:])
            off = np.flatnonzero([self.native.broken(x) > SEEN * KEPT for x in middle])
            if not off.size:
                if len(points) > len(self.corners) and (fault := self.fault(joint_polyline(points))) is not None:
                    raise InfeasibleError("path", *fault)
                break
            if len(points) > MOST_POINTS:
                raise InfeasibleError("path", len(points), "the rows bend too much for straight pieces between points")
            points = np.insert(points, off + 1, [self._onto_rows(middle[k]) for k in off], axis=0)
        return points

    def _onto_rows(self, x: Array) -> Array:
        projected = self.native.projected(x)
        if projected is None:
            raise InfeasibleError("path", x.tolist(), "a point between two of the path finds no way onto the rows")
        return projected

    @property
    def q(self) -> Array:
        """The configurations of :attr:`points` [points, nq]."""
        return self.coordinates.configuration(self.points)

    @cached_property
    def smooth(self) -> PolynomialPath:
        """The path with rounded corners, or a spline through more points where equality rows hold, proven clear again.

        Raises:
            InfeasibleError: a spline that keeps the equality rows is not clear.
        """
        if len(self.corners) < 2 or self.length == 0.0:
            return standing_path(self.corners[0])
        rolling = self.coordinates.rolling
        runs = [self.corners] if rolling is None else rolling.runs(self.corners)
        smoothed = self._spline if self.native.path_rows.equalities else self._rounded
        return PolynomialPath.joined([smoothed(run) for run in runs])

    def _rounded(self, points: Array) -> PolynomialPath:
        deviation = ROUNDED
        while deviation >= LEAST_ROUNDED:
            path = blend_path(points, deviation)
            if self.fault(path) is None:
                return path
            deviation *= 0.5
        return joint_polyline(points)

    def _spline(self, points: Array) -> PolynomialPath:
        why = ""
        # A spline swings where two points are much closer to each other than to the others
        far = np.linalg.norm(np.diff(points, axis=0), axis=1) > CLOSE
        points = points[np.r_[True, far[:-1] & far[1:], True]]
        for _ in range(PASSES):
            if len(points) >= MOST_POINTS:
                break
            path = spline_path(points)
            middle = 0.5 * (path.knots[:-1] + path.knots[1:])
            if len(path.knots) != len(points):
                points = path.evaluate(path.knots)
            off = np.array([self.native.broken(x) for x in path.evaluate(middle)])
            bad = off > SEEN * KEPT
            if not bad.any():
                fault = self.fault(path)
                if fault is None:
                    return path
                why, bad = fault[1], np.ones(len(bad), dtype=bool)
            more = np.flatnonzero(bad)
            between = [self._onto_rows(0.5 * (points[k] + points[k + 1])) for k in more]
            points = np.insert(points, more + 1, between, axis=0)
        raise InfeasibleError(
            "path", len(points), f"no spline keeps the rows and is clear: {why or 'the rows bend too much'}"
        )

    def fault(self, path: PolynomialPath) -> tuple[float, str] | None:
        """(how far, what) of the worst thing that a path breaks; None: nothing. Bodies, and limits of polynomials, are
        proven; rows are looked at in samples.
        """
        nearest = self.native.scene.violation(path)
        if nearest is not None:
            return nearest.distance, str(nearest)
        controls = path.hull()
        low, high = controls.min(axis=(0, 2)), controls.max(axis=(0, 2))
        beyond = np.maximum(self.native.low - low, high - self.native.high)
        if beyond.max() > 1e-9:
            k = int(beyond.argmax())
            return float(beyond[k]), f"{self.coordinates.names[k]} leaves its limits"
        if self.native.path_rows.count:
            share = (np.arange(SAMPLES) + 0.5) / SAMPLES
            s = (path.knots[:-1, None] + share * np.diff(path.knots)[:, None]).ravel()
            off = [self.native.broken(x) for x in path.evaluate(s)]
            if max(off) > SEEN * KEPT:
                return max(off), f"a row is broken at s = {s[int(np.argmax(off))]:.4g}"
        return None

    def law(self, velocity: Any = None, acceleration: Any = None, jerk: Any = None) -> Law:
        """The fastest law along :attr:`smooth`, from rest to rest, of the coordinates, with its certificate.

        Args:
            velocity, acceleration: limits [n], or one for all; default: the robot's, and where it has none such that
                full speed is reached in 0.25 s.
            jerk: None: unbounded, by :func:`wbc.trajectory.time_optimal`; a number, or ``True`` for full acceleration
                in 0.05 s: by :func:`wbc.trajectory.jerk_limited_along`.

        Raises:
            as these two. InfeasibleError: as :attr:`smooth`.
        """
        fast, brisk = self.motion_limits()
        fast = fast if velocity is None else np.broadcast_to(validation.real_array("velocity", velocity), fast.shape)
        if acceleration is not None:
            brisk = np.broadcast_to(validation.real_array("acceleration", acceleration), fast.shape)
        path = self.smooth
        if jerk is None:
            law = time_optimal(path, fast, brisk)
        else:
            jerks = brisk / JERK_RAMP if jerk is True else jerk
            law = jerk_limited_along(path, velocity=fast, acceleration=brisk, jerk=jerks, stops=True)
        slower = self._slower(law)
        return law.scaled(slower) if slower > 1.0 else law

    def motion_limits(self) -> tuple[Array, Array]:
        """Speeds and accelerations of the coordinates [n]."""
        coordinates, robot = self.coordinates, self.stack.robot
        limits = robot.coupled(robot.limits)
        fast, brisk = coordinates.rates(limits.velocity), coordinates.rates(limits.acceleration)
        fast = np.where(np.isfinite(fast), fast, UNLIMITED * coordinates.scale)
        return fast, np.where(np.isfinite(brisk), brisk, fast / RAMP)

    def _slower(self, law: Law) -> float:
        """By what a law is too fast for the limits of frames' speeds, sampled."""
        limits = [e.item for e in self.stack.constraints if isinstance(e.item, FrameVelocityLimit)]
        if not limits:
            return 1.0
        robot, (q, v) = self.stack.robot, self.configurations(law, np.linspace(0.0, law.duration, 500))
        most = 1.0
        for item in limits:
            for configuration, rate in zip(q, v, strict=True):
                twist = robot.jacobian(configuration, item.frame) @ rate
                for part, limit in ((twist[:3], item.linear), (twist[3:], item.angular)):
                    if limit is not None:
                        most = max(most, float(np.max(np.abs(part) / np.asarray(limit))))
        return most

    def configurations(self, law: Law, t: Any) -> tuple[Array, Array]:
        """(q, v) of a law of the coordinates at a time or at several [s]."""
        state = law.at(t)
        x = np.asarray(state.position)
        return self.coordinates.configuration(x), self.coordinates.velocity(x, np.asarray(state.velocity))
