"""What an operator sees of a motion with more rows than joints: which part of a command can be met, and where."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from wbc import validation
from wbc.coordinates import expressions
from wbc.coordinates.items import FollowRows
from wbc.coordinates.pair import CoordinatePair
from wbc.coordinates.samples import ROUNDING
from wbc.coordinates.scales import scales
from wbc.errors import ShapeError
from wbc.robot import Robot
from wbc.symbolic.evaluation import SingleState
from wbc.symbolic.kinematics import Kinematics
from wbc.symbolic.tracer import Tracer
from wbc.validation import Array

#: Pairs whose functions are cached
KEPT = 64


@dataclass(frozen=True, eq=False)
class MotionCue:
    """What becomes of commanded rates where the constraint is held.

    Attributes:
        asked: rates of the task rows [m/s, rad/s]. met: the nearest ones that the held constraint allows.
        directions: orthonormal directions of task rates that can be had, in scaled rows [free, rows].
        blocked: those that cannot, whatever the joints do [rows - free, rows].
        share: |met| / |asked|, and lost: |asked - met| / |asked|, in scaled rows; 1 and 0 where nothing is asked.
        names: of the rows.
    """

    asked: Array
    met: Array
    directions: Array
    blocked: Array
    share: float
    lost: float
    names: tuple[str, ...]

    @property
    def missing(self) -> Array:
        """asked - met [m/s, rad/s]."""
        return self.asked - self.met

    def __str__(self) -> str:
        """As operators read it: how many directions are left, which, and what of the command that meets."""
        count, rows = len(self.directions), len(self.asked)
        if count == rows:
            return f"all {rows} directions can be had"
        if count == 0:
            return f"none of {rows} directions can be had: the task stands still"
        some = "; ".join(_direction(one, self.names) for one in self.directions[:3]) if count <= 3 else ""
        where = f" along {some}" if some else f", none along {_direction(self.blocked[0], self.names)}"
        return f"{count} of {rows} directions can be had{where}; {100 * self.share:.0f} % of the command is met"


def motion_cue(robot: Robot, pair: CoordinatePair, q: Any, rates: Any) -> MotionCue:
    """Which part of a command an over-determined pair can meet while its constraint is exactly held:

        met = J_T N (S J_T N)^+ S asked,    J_C N = 0,    minimising |S (asked - met)|              [m/s, rad/s]

    N is an orthonormal basis of the null space of J_C, its rank decided at 1e-9 of the largest singular value. S
    divides rows in metres by the robot's characteristic length, as the controller does; a pose is the velocities of
    three points where the pair has a ``metric``.
    For a pair that is not over-determined all is met where it is regular.

    Args:
        rates: of the task rows [m/s, rad/s].

    Source: E. Dupuis, PhD thesis, McGill University, 2001, eqs. 3.39 and B.3 to B.15.

    Raises:
        ShapeError, NotFiniteError, RotationError, UnknownNameError, RangeError: bad pair, configuration or rates.
    """
    if not isinstance(pair, CoordinatePair):
        raise ShapeError("pair", pair, "expected a CoordinatePair")
    pair.counts(robot)
    q = robot.configuration("q", q)
    names = tuple(f"{one} {row.label}" for one in pair.task for row in expressions.labels(robot, one))
    asked = validation.ordinary_array("rates", rates, (len(names),))
    task, spread, held = _function(robot, pair)(q)
    return _cue(task, held, spread, asked, names)


@lru_cache(maxsize=KEPT)
def _function(robot: Robot, pair: CoordinatePair) -> SingleState:
    """q -> (J_T, S, J_C): rows of the task, how they count, and rows of the constraint."""
    kin = Tracer(Kinematics(robot.model))
    task, held = ([expressions.matrix(robot, kin, one) for one in side] for side in (pair.task, pair.constraint))
    length = robot.characteristic_length
    served = FollowRows(pair.task, pair.metric)
    size = [1.0 / row.scale(length) for row in served.rows(robot)]
    scale, columns = scales(robot, pair.constraint, length)
    J_T, J_C = ca.vertcat(*task) @ np.diag(columns), ca.vertcat(ca.SX(0, robot.nv), *held) @ np.diag(columns)
    whole = J_T, np.diag(size) @ served.spread(robot, kin), np.diag(scale) @ J_C if pair.constraint else J_C
    return SingleState(ca.Function("cue", [kin.q], [kin.expand(ca.densify(one)) for one in whole]))


def _cue(task: Array, held: Array, spread: Array, asked: Array, names: tuple[str, ...]) -> MotionCue:
    free = null_space(held)
    U, sigma, _ = np.linalg.svd(spread @ task @ free)
    largest = float(np.linalg.norm(spread @ task, 2)) if task.size else 0.0
    count = int((sigma > ROUNDING * largest).sum())
    wanted = spread @ asked
    reached = U[:, :count] @ (U[:, :count].T @ wanted)
    # Spread rows are no fewer than the task's and independent, so rates come back from them
    met = np.asarray(np.linalg.lstsq(spread, reached, rcond=None)[0], dtype=np.float64)
    size = float(np.linalg.norm(wanted))
    share = float(np.linalg.norm(reached)) / size if size > 0.0 else 1.0
    lost = float(np.linalg.norm(wanted - reached)) / size if size > 0.0 else 0.0
    some, rest = _directions(spread, np.asarray(U, dtype=np.float64), count)
    return MotionCue(asked, met, some, rest, share, lost, names)


def _directions(spread: Array, U: Array, count: int) -> tuple[Array, Array]:
    """Orthonormal bases of what can be had and of what cannot, in the rows as they are scaled to be compared."""
    if spread.shape[0] == spread.shape[1]:
        return U[:, :count].T, U[:, count:].T
    had = np.linalg.lstsq(spread, U[:, :count], rcond=None)[0]
    Q = np.linalg.svd(had)[0]
    return Q[:, :count].T, Q[:, count:].T


def null_space(matrix: Array) -> Array:
    """Orthonormal basis of the null space [columns, dimension]; singular values count from 1e-9 of the largest."""
    if not matrix.size:
        return np.eye(matrix.shape[1])
    _, sigma, right = np.linalg.svd(matrix)
    rank = int((sigma > ROUNDING * sigma[0]).sum()) if sigma[0] > 0.0 else 0
    return np.asarray(right[rank:].T)


def _direction(one: Array, names: tuple[str, ...]) -> str:
    """A direction as its larger parts."""
    one = one * (1.0 if one[np.argmax(np.abs(one))] > 0.0 else -1.0)
    order = [k for k in np.argsort(-np.abs(one)).tolist() if abs(one[k]) >= 0.1]
    return "(" + ", ".join(f"{one[k]:+.2f} {names[k]}" for k in sorted(order)) + ")"
