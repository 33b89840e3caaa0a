"""What a path is worth: clear by Coal at ten times the resolution, within limits, from start to goal, and how long."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin

from bench.plan.peers import STEP
from bench.plan.problems import Problem
from tests.plan.scenes import CoalJudge
from wbc.plan import MotionPlanner

#: A body may be so far in another one: what a proof of clearance leaves open [m]
ALLOWED = 1e-4


def fault(problem: Problem, planner: MotionPlanner, path: Any) -> str:
    """What a path breaks; empty: nothing."""
    points, judge = np.array(path), CoalJudge(planner.stack)
    if np.abs(points[0] - problem.start).max() > 1e-6 or np.abs(points[-1] - problem.goal).max() > 1e-6:
        return "other ends"
    if (points < problem.low - 1e-9).any() or (points > problem.high + 1e-9).any():
        return "beyond limits"
    for one, other in pairwise(points):
        count = int(np.ceil(np.linalg.norm(other - one) / (0.1 * STEP))) + 1
        for share in np.linspace(0.0, 1.0, count + 1):
            q = planner.coordinates.configuration(one + share * (other - one))
            # Distances take longer, and are asked for where bodies touch
            if not pin.computeCollisions(judge.model, judge.data, judge.bodies, judge.geometry, q, True):
                continue
            pin.computeDistances(judge.model, judge.data, judge.bodies, judge.geometry, q)
            least = min(result.min_distance for result in judge.geometry.distanceResults)
            if least < -ALLOWED:
                return f"{1e3 * least:.2f} mm in a body"
    return ""


def length(path: Any) -> float:
    """Sum of the distances of points [rad]."""
    return float(np.linalg.norm(np.diff(np.array(path), axis=0), axis=1).sum())
