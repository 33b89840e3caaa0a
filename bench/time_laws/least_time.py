"""Laws of least time and jerk-limited laws through waypoints, a record for each problem."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

import wbc.robots
from bench.time_laws import raw
from wbc.errors import WbcError
from wbc.trajectory import Law, MotionLimits, spline_path, time_optimal
from wbc.trajectory.least_time.checks import TorqueCheck
from wbc.validation import Array

Record = dict[str, Any]

#: Grid points of toppra beside which durations are compared
REFERENCE = 6401


def random_problem(rng: np.random.Generator, count: int) -> tuple[Array, Array, Array]:
    """Waypoints of 7 joints, velocity and acceleration limits: the problem of toppra's own examples."""
    return rng.standard_normal((count, 7)), rng.uniform(10.0, 30.0, 7), rng.uniform(10.0, 20.0, 7)


@dataclass(frozen=True, eq=False)
class Problem:
    """Waypoints, evenly over s in [0, 1] as in toppra's examples, and limits."""

    waypoints: Array
    velocity: Array
    acceleration: Array

    def spline(self) -> Any:
        """toppra's."""
        return raw.spline(np.linspace(0.0, 1.0, len(self.waypoints)), self.waypoints)

    def theirs(self, points: int | None, **how: Any) -> tuple[Any, Any, Any]:
        """toppra's trajectory or None, its instance, its path."""
        path = self.spline()
        return *raw.solve(raw.rate_limits(self.velocity, self.acceleration), path, points, **how), path

    def law(self, trajectory: Any, instance: Any, path: Any) -> Law | None:
        """toppra's trajectory as a law; None where there is none, or one without end."""
        if trajectory is None or not (np.isfinite(trajectory.duration) and trajectory.duration > 0.0):
            return None
        limits = MotionLimits(velocity=self.velocity, acceleration=self.acceleration)
        return raw.law_of(trajectory, instance, path, limits)

    def ours(self) -> Law:
        """A law along the same spline, with what a user reads of it."""
        law = time_optimal(raw.polynomial(self.spline()), self.velocity, self.acceleration)
        law.certificate  # noqa: B018 (it is made when it is first read)
        return law


def random_set(rng: np.random.Generator, count: int) -> Iterator[Record]:
    """Raw toppra with its defaults, raw toppra at its best, and ours along the same splines."""
    for number in (5, 10):
        for _ in range(count):
            problem = Problem(*random_problem(rng, number))
            record: Record = {"waypoints": number}
            for name, points, how in (("default", None, raw.DEFAULT), ("constant", 1001, raw.CONSTANT)):
                spent, made = timed(partial(problem.theirs, points, **how))
                record[name] = {"ms": spent, **judged(problem.law(*made))}
            spent, law = timed(problem.ours)
            record["ours"] = {"ms": spent, **judged(law)}
            reference = problem.theirs(REFERENCE, **raw.CONSTANT)[0]
            record["reference"] = None if reference is None else float(reference.duration)
            yield record


def timed(make: Callable[[], Any]) -> tuple[float, Any]:
    """(least of two wall times [ms], what was made)."""
    spent = []
    for _ in range(2):
        begin = time.perf_counter()
        made = make()
        spent.append(1e3 * (time.perf_counter() - begin))
    return min(spent), made


def judged(law: Law | None) -> Record:
    """Duration and largest share of velocity and acceleration limits, exact."""
    if law is None:
        return {"duration": None, "ratio": None}
    worst = law.certificate.worst
    assert {worst[name].kind for name in ("velocity", "acceleration")} == {"exact"}
    return {"duration": law.duration, "ratio": max(worst[name].ratio for name in ("velocity", "acceleration"))}


def small_moves(rng: np.random.Generator, count: int) -> Iterator[Record]:
    """Straight moves of 6 joints between two waypoints: raw toppra over s in [0, 1], and ours."""
    for exponent in range(2, 9):
        for _ in range(count):
            way = rng.standard_normal(6)
            start = rng.uniform(-1.0, 1.0, 6)
            waypoints = np.stack([start, start + 10.0**-exponent * way / np.linalg.norm(way)])
            problem = Problem(waypoints, rng.uniform(1.0, 3.0, 6), rng.uniform(2.0, 10.0, 6))
            try:
                law = time_optimal(spline_path(waypoints), problem.velocity, problem.acceleration, intervals=100)
            except WbcError:
                law = None
            yield {"exponent": exponent, "raw": judged(problem.law(*problem.theirs(101))), "ours": judged(law)}


def torques(rng: np.random.Generator, count: int) -> Iterator[Record]:
    """Random paths of a UR5 within its torques and velocities; inverse dynamics by Pinocchio on both sides."""
    robot = wbc.robots.load("ur5")
    data = robot.model.createData()
    velocity, effort = robot.limits.velocity, robot.limits.effort
    check = TorqueCheck(robot, effort)

    def dynamics(q: Array, v: Array, a: Array) -> Array:
        return np.array(pin.rnea(robot.model, data, q, v, a))

    for _ in range(count):
        waypoints = robot.neutral + rng.uniform(-1.0, 1.0, (5, robot.nv))
        path = raw.spline(np.linspace(0.0, 1.0, 5), waypoints)
        record: Record = {}
        for name, scheme, points, how in (
            ("default", None, None, raw.DEFAULT),
            ("collocation", "Collocation", 201, raw.CONSTANT),
            ("interpolation", "Interpolation", 201, raw.CONSTANT),
        ):
            asked = [*raw.rate_limits(velocity), raw.torque_limits(dynamics, effort, scheme)]
            spent, (found, instance) = timed(partial(raw.solve, asked, path, points, **how))
            limits = MotionLimits(velocity=velocity)
            law = None if found is None else raw.law_of(found, instance, path, limits, (check,))
            record[name] = {"ms": spent, **_torque(law)}
        spent, law = timed(partial(time_optimal, raw.polynomial(path), velocity, torque=effort, robot=robot))
        record["ours"] = {"ms": spent, **_torque(law)}
        yield record


def _torque(law: Law | None) -> Record:
    """Largest share of the torque limits that was seen, and its bound with what may lie between samples."""
    if law is None:
        return {"duration": None, "seen": None, "bound": None}
    worst = law.certificate.worst["torque"]
    return {"duration": law.duration, "seen": worst.ratio - worst.between, "bound": worst.ratio}
