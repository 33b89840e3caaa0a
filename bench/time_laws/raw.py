"""toppra and ruckig as their own documentation uses them, and their output as laws that our certificate can judge."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
import ruckig
import toppra
from toppra import algorithm, constraint
from toppra.constraint import DiscretizationType

from wbc.trajectory import Law, MotionLimits, PolynomialPath, Timing
from wbc.validation import Array

# Every refusal of toppra would be a line on the terminal
logging.getLogger("toppra").setLevel(logging.CRITICAL)

#: What toppra does when it is not told otherwise: an automatic grid, output as a spline
DEFAULT: dict[str, Any] = {}
#: Constant accelerations between the points of a grid, with limits at both ends of every interval
CONSTANT = {"parametrizer": "ParametrizeConstAccel"}
SCHEMES = {"Collocation": DiscretizationType.Collocation, "Interpolation": DiscretizationType.Interpolation}


def both(limit: Any) -> Array:
    """Limits as toppra wants them."""
    size = np.asarray(limit, dtype=np.float64)
    return np.column_stack([-size, size])


def spline(places: Any, waypoints: Any) -> Any:
    """toppra's spline through waypoints, with its default ends."""
    return toppra.SplineInterpolator(places, np.asarray(waypoints, dtype=np.float64))


def polynomial(path: Any) -> PolynomialPath:
    """The same spline as a path of ours; of a straight line between two points, too."""
    if hasattr(path, "cspl") and hasattr(path.cspl, "c"):
        return PolynomialPath(path.cspl.x, path.cspl.c)
    start, end = path.path_interval
    return PolynomialPath([start, end], [path([start], 1), path([start], 0)])


def rate_limits(velocity: Any, acceleration: Any = None) -> list[Any]:
    """toppra's constraints, that of accelerations with its default scheme, Interpolation."""
    asked = [constraint.JointVelocityConstraint(both(velocity))]
    return asked if acceleration is None else [*asked, constraint.JointAccelerationConstraint(both(acceleration))]


def torque_limits(dynamics: Any, torque: Array, scheme: str | None = None) -> Any:
    """toppra's constraint, its default scheme being Collocation."""
    how = {} if scheme is None else {"discretization_scheme": SCHEMES[scheme]}
    return constraint.JointTorqueConstraint(dynamics, both(torque), np.zeros(len(torque)), **how)


def solve(limits: list[Any], path: Any, points: int | None = None, **how: Any) -> Any:
    """(trajectory or None, instance) of toppra on a grid of so many points, or its own grid."""
    grid = None if points is None else np.linspace(*path.path_interval, points)
    instance = algorithm.TOPPRA(limits, path, gridpoints=grid, **how)
    return instance.compute_trajectory(0, 0), instance


def law_of(trajectory: Any, instance: Any, path: Any, limits: MotionLimits, checks: tuple[Any, ...] = ()) -> Law:
    """toppra's output as a law: polynomials either way, so that what it does between grid points is known exactly."""
    if hasattr(trajectory, "cspl"):
        own = polynomial(trajectory)
        return Law(own, Timing.identity(float(own.knots[-1])), limits, checks)
    data = instance.problem_data
    return Law(polynomial(path), Timing.accelerations(data.gridpoints, data.sd_vec), limits, checks)


def state_to_state(arguments: dict[str, Array]) -> Any:
    """ruckig's input for the arguments of ``jerk_limited``."""
    asked: Any = ruckig.InputParameter(len(arguments["start"]))
    for ours, theirs in (("start", "current"), ("target", "target")):
        for suffix, part in (("", "position"), ("_velocity", "velocity"), ("_acceleration", "acceleration")):
            if ours + suffix in arguments:
                setattr(asked, f"{theirs}_{part}", arguments[ours + suffix])
    for part in ("velocity", "acceleration", "jerk"):
        setattr(asked, f"max_{part}", arguments[part])
    return asked


def calculate(asked: Any) -> Any:
    """ruckig's trajectory, None where it raises."""
    answer = ruckig.Trajectory(asked.degrees_of_freedom)
    try:
        ruckig.Ruckig(asked.degrees_of_freedom).calculate(asked, answer)
    except ruckig.RuckigError:
        return None
    return answer
