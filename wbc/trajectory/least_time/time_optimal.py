"""Laws that take the least time along a path within velocities, accelerations, torques and speeds of frames."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import BoundsError, InfeasibleError, RangeError, ShapeError
from wbc.robot.robot import Robot
from wbc.trajectory.laws.certificate import TOLERANCE, Check, certify
from wbc.trajectory.laws.law import Law
from wbc.trajectory.laws.limits import MotionLimits, for_all
from wbc.trajectory.laws.timing import Timing
from wbc.trajectory.least_time.checks import Force, FrameSpeed, Inequality, PoseSpeed, TorqueCheck
from wbc.trajectory.least_time.fastest import FastestTask
from wbc.trajectory.least_time.repair import repaired
from wbc.trajectory.paths.joint_paths import spline_path, standing_path
from wbc.trajectory.paths.path import JoinedPath, Path
from wbc.validation import Array, bound_text

#: Parts into which a path may be cut at most
MOST_INTERVALS = 100_000.0
#: Duration of a law that has nowhere to go, unless another one is asked for [s]
STANDING = 1e-3


def time_optimal(
    path: Any,
    velocity: Any = None,
    acceleration: Any = None,
    torque: Any = None,
    cartesian_speed: Mapping[str, float] | None = None,
    *,
    limits: MotionLimits | None = None,
    robot: Robot | None = None,
    inequality: Any = None,
    start_speed: float = 0.0,
    end_speed: float = 0.0,
    duration: float | None = None,
    intervals: int | None = None,
) -> Law:
    """The fastest law along a path:

        min T  such that  |dq/dt| <= velocity, |d2q/dt2| <= acceleration, |tau| <= torque, |v_frame| <= cartesian_speed

    with a constant path acceleration on each interval of a grid (TOPP-RA), satisfying its limits between the points
    of the grid too. ``law.certificate`` is exact for velocity and acceleration along polynomial paths, at most
    1 + 1e-6, and sampled for the rest. The acceleration steps, so jerk is unbounded. Where the tangent of the path
    jumps, the law stops. A path that goes nowhere gives a law that stands for ``duration``, or for 1 ms.

    Args:
        path: a :class:`Path`, or m x n waypoints, which become :func:`spline_path`.
        velocity, acceleration: a positive number, or one for each joint (for poses: three linear, three angular), inf
            for none [rad/s, m/s; per s more].
        torque: likewise, needs ``robot`` and a path of its nv coordinates [N m or N]. Gravity and armature count,
            friction in the joints does not.
        cartesian_speed: frame name -> largest speed of its origin [m/s], needs ``robot``; along a path of poses
            ``linear`` [m/s] and ``angular`` [rad/s].
        limits: more limits; the arguments above go before them. Positions are checked before anything else.
        robot: whose torques and frames are meant.
        inequality: (function, F, g), or name -> (function, F, g), with F w <= g for w = function(q, dq/dt, d2q/dt2)
            that is affine in d2q/dt2 and quadratic in dq/dt: contact wrenches.
        start_speed, end_speed: of the path coordinate, ds/dt >= 0 [rad/s or m/s], so that dq/dt = q' ds/dt; of splines
            and functions q' is only near 1 in size.
        duration: a longer time than the least, from rest to rest [s].
        intervals: of the grid; by default 125 for each piece of the path and at least 500.

    Raises:
        ShapeError, NotFiniteError, UnknownNameError: of other shapes, not finite, no such frame.
        RangeError: limits not positive, speeds negative, nothing that limits the acceleration, a jerk limit.
        BoundsError: the path leaves ``limits.lower`` to ``limits.upper``.
        InfeasibleError: standing still exceeds forces, the end speeds cannot be had (with the largest that works), or
            ``duration`` is too short.

    Source: H. Pham, Q.-C. Pham, A new approach to time-optimal path parameterization based on reachability analysis,
    IEEE T-RO 34, 2018.
    """
    curve = path if isinstance(path, Path) else spline_path(path)
    kept = _limits(curve, limits, velocity, acceleration)
    speeds, forces = _checks(curve, robot, torque, cartesian_speed, inequality)
    start = validation.scalar("start_speed", start_speed, low=0.0)
    end = validation.scalar("end_speed", end_speed, low=0.0)
    task = FastestTask(curve, kept, speeds, forces, start, end)
    longer = None if duration is None else validation.scalar("duration", duration, low=0.0, open_low=True, unit="s")
    if longer is not None and not task.rests:
        raise RangeError("duration", duration, "a duration can only be requested from rest to rest")
    count = None if intervals is None else validation.scalar("intervals", intervals, low=2.0, high=MOST_INTERVALS)
    if count is not None and count != int(count):
        raise RangeError("intervals", intervals, "expected a whole number")
    _within_positions(curve, kept)
    law = _law(task, None if count is None else int(count), longer)
    if longer is None:
        return law
    if longer < law.duration * (1.0 - 1e-12):
        raise InfeasibleError(
            "duration", duration, f"the shortest that satisfies the limits is {bound_text(law.duration, 1, 9)} s"
        )
    return law.scaled(longer / law.duration)


def _law(task: FastestTask, intervals: int | None, duration: float | None) -> Law:
    if isinstance(task.path, JoinedPath):
        # Between the two coordinates there is no path, so the law rests where they meet
        first = _law(replace(task, path=task.path.first, end=0.0), intervals, None)
        return first.then(_law(replace(task, path=task.path.second, start=0.0), intervals, None))
    if _stands(task.path):
        return _standing(task, duration)
    return repaired(task, intervals)


def _stands(path: Path) -> bool:
    """Whether a path goes nowhere."""
    if path.degree == 0:
        return True
    s = path.knots[:-1, None] + np.diff(path.knots)[:, None] * np.linspace(0.0, 1.0, 9)
    return not path.evaluate(s.ravel(), 1, np.repeat(np.arange(len(s)), 9)).any()


def _standing(task: FastestTask, duration: float | None) -> Law:
    """A law that stays where its path is."""
    for name in ("start", "end"):
        if getattr(task, name) > 0.0:
            raise InfeasibleError(
                f"{name}_speed", getattr(task, name), "the path goes nowhere: the largest that works is 0"
            )
    path, start = task.path, float(task.path.knots[0])
    if path.space == "joints":
        path, start = standing_path(path.evaluate(path.knots[:1])[0]), 0.0
    law = Law(path, Timing([0.0, duration or STANDING], [[start]]), task.limits, task.checks)
    if not law.certificate.satisfied and task.forces:
        worst = max((law.certificate.worst[f.name] for f in task.forces), key=lambda w: w.ratio)
        raise InfeasibleError("path", worst.ratio, f"standing still exceeds limits, at joint or row {worst.joint}")
    return law


def _limits(path: Path, limits: MotionLimits | None, velocity: Any, acceleration: Any) -> MotionLimits:
    """Limits with numbers spread over the joints."""
    out = MotionLimits.given(limits, path.dof)
    if out.jerk is not None and np.isfinite(out.jerk).any():
        raise RangeError("limits.jerk", out.jerk, "laws of least time step in acceleration, see jerk_limited")
    own = {"velocity": velocity, "acceleration": acceleration}
    return replace(out, **{k: _spread(k, v, path.dof) for k, v in own.items() if v is not None})


def _spread(name: str, value: Any, count: int) -> Array:
    """A positive number, or one for each joint, as one for each joint; inf is no limit."""
    out = for_all(name, value, count)
    if not (out >= validation.SMALLEST).all():
        raise RangeError(name, value, f"limits must be positive numbers, at least {validation.SMALLEST:g}")
    return out


def _checks(
    path: Path, robot: Robot | None, torque: Any, speed: Mapping[str, float] | None, inequality: Any
) -> tuple[tuple[Check, ...], tuple[Force, ...]]:
    """Checks of speeds, and of forces."""
    if speed is not None:
        speed = validation.mapping("cartesian_speed", speed, "frames or parts to speeds")
    speeds: list[Check] = []
    forces: list[Force] = []
    if speed and path.space == "poses":
        speeds.append(PoseSpeed(dict(speed)))
    elif speed:
        speeds.append(FrameSpeed(_robot("cartesian_speed", path, robot), dict(speed)))
    if torque is not None:
        owner = _robot("torque", path, robot)
        forces.append(TorqueCheck(owner, _spread("torque", torque, owner.nv)))
    if inequality is not None:
        named = inequality if isinstance(inequality, Mapping) else {"inequality": inequality}
        for name, parts in named.items():
            if not isinstance(parts, tuple) or len(parts) != 3 or not callable(parts[0]):
                raise ShapeError(name, parts, "expected (function, F, g)")
            forces.append(Inequality(*parts, name=name))
    return tuple(speeds), tuple(forces)


def _robot(name: str, path: Path, robot: Robot | None) -> Robot:
    if robot is None:
        raise ShapeError("robot", None, f"{name} needs one")
    validation.instance("robot", robot, Robot, "a wbc Robot, see wbc.robots.load")
    if path.space != "joints" or path.dof != robot.nv:
        raise ShapeError("path", path.dof, f"{name} needs a path of the robot's {robot.nv} coordinates")
    return robot


def _within_positions(path: Path, limits: MotionLimits) -> None:
    """Refuses paths that leave the position limits."""
    if limits.lower is None or isinstance(path, JoinedPath):
        if isinstance(path, JoinedPath):
            _within_positions(path.first, limits)
            _within_positions(path.second, limits)
        return
    begin = float(path.knots[0])
    worst = certify(path, Timing.identity(path.length, begin), MotionLimits(limits.lower, limits.upper)).worst
    if "position" in worst and worst["position"].ratio > 1.0 + TOLERANCE:
        joint, where = worst["position"].joint, begin + worst["position"].time
        there = path.evaluate(np.array([where]))[0, joint]
        raise BoundsError("path", float(there), f"joint {joint} is beyond its position limits at s = {where:.6g}")
