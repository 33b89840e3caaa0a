"""The smallest sets of constraint coordinates that always suffice, by search over subsets.

A set suffices if the rows of task and set together have rank m wherever the task has full rank. A subset is rejected
by a witness, a configuration where the task keeps its rank and the rows do not. Witnesses are looked for where joints
are at multiples of 90 degrees, at random places, and by Newton's method on sigma(q) = 0 from there; what is left is
certified by :func:`wbc.analysis.analyse`, or stays "screened".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from math import pi
from typing import Any

import numpy as np

from wbc import validation
from wbc.analysis import ExactModel, analyse
from wbc.coordinates import expressions
from wbc.coordinates.advice.determinant_places import LARGE
from wbc.coordinates.control.conditioning import Conditioning
from wbc.coordinates.rows import Coordinate, coordinates
from wbc.errors import RangeError, WbcError
from wbc.robot import Robot
from wbc.robot.robot import checked_robot
from wbc.validation import Array

#: A singular value of the task below this part of the median of its least ones is zero. Parts of what is usual for this
#: task of this arm do not depend on the arm's size or on the scale of rows.
ZERO = 1e-8
#: Part of the same median that the task's least singular value keeps where a configuration serves as a witness
KEPT = 1e-2
#: Random configurations of the screen
STATES = 2000
#: The nearest to a loss of rank, from which Newton's method starts
STARTS = 60
#: Steps of Newton's method
STEPS = 30
SCREENED = "screened"


@dataclass(frozen=True, eq=False)
class CompleteSet:
    """A set of constraint coordinates that suffices.

    Attributes:
        constraint: the coordinates. verdict: ``strict`` or ``loose`` as :func:`wbc.analysis.analyse` has it, or
            ``screened``: no witness was found, and nothing is proved.
        least: smallest ratio of the least singular values, rows over task, that the screen met where the task keeps a
            hundredth of its median.
    """

    constraint: tuple[Coordinate, ...]
    verdict: str
    least: float


def smallest_complete_sets(
    robot: Robot,
    task: Coordinate | Sequence[Coordinate],
    candidates: Sequence[Coordinate],
    *,
    certify: bool = True,
    seed: int = 0,
) -> tuple[CompleteSet, ...]:
    """All sets of the fewest candidates that suffice; empty if even all together do not.

    Args:
        certify: prove what the screen leaves, where the analysis takes the robot (seconds each).

    Raises:
        ShapeError, UnknownNameError, RangeError: bad rows; too few candidates for the joints.
    """
    wanted, given = coordinates("task", task), coordinates("candidates", candidates)
    checked_robot(robot)
    for one in (*wanted, *given):
        expressions.check(robot, "candidates", one)
    if validation.flag("certify", certify) and robot.nv > LARGE:
        raise RangeError("certify", certify, f"exact analysis takes up to {LARGE} joints; say certify=False")
    states = _states(robot, seed)
    if robot.nq != robot.nv:
        raise RangeError("robot", robot.name, "joints with one coordinate each are needed")
    found: list[CompleteSet] = []
    for size in range(1, len(given) + 1):
        subsets = list(combinations(given, size))
        screen = Conditioning(robot, [wanted, *((*wanted, *s) for s in subsets)], backend="auto")
        every = screen.many(states)
        task_sigma, *others = (np.linalg.svd(J, compute_uv=False)[:, -1] for J in every)
        usual = float(np.median(task_sigma))
        regular = task_sigma > KEPT * usual
        for k, (subset, sigma) in enumerate(zip(subsets, others, strict=True), start=1):
            if (
                every[k].shape[1] < robot.nv
                or (sigma[regular] < ZERO * usual).any()
                or _hunted(screen, k, np.asarray(states[regular]), np.asarray(sigma[regular], dtype=np.float64), usual)
            ):
                continue
            ratio = float((sigma[regular] / task_sigma[regular]).min())
            verdict = _certified(robot, wanted, subset) if certify else SCREENED
            if verdict in ("strict", "loose", SCREENED):
                found.append(CompleteSet(subset, verdict, ratio))
        if found:
            break
    return tuple(found)


def _states(robot: Robot, seed: int) -> Array:
    """Half at random; half with some joints at multiples of 90 degrees."""
    rng = np.random.default_rng(validation.integer("seed", seed))
    q = rng.uniform(-pi, pi, (STATES, robot.nq))
    special = rng.integers(-1, 3, q.shape) * (pi / 2)
    chosen = rng.random(q.shape) < rng.uniform(0.2, 0.9, (STATES, 1))
    chosen[::2] = False
    return np.where(chosen, special, q)


def _hunted(screen: Conditioning, group: int, states: Array, sigma: Array, usual: float) -> bool:
    """Newton's method on sigma = 0 from the states where it is least; a zero with a regular task is a witness."""
    order = np.argsort(sigma)
    for start in states[np.concatenate((order[: STARTS // 2], order[:: max(1, len(order) // (STARTS // 2))]))]:
        q = start.copy()
        for _ in range(STEPS):
            values, slopes, _ = screen.slopes(q)
            steep = float(slopes[group] @ slopes[group])
            if values[group] < ZERO * usual or steep < (ZERO * usual) ** 2 or values[0] < KEPT * usual:
                break
            step = -values[group] / steep * slopes[group]
            q = q + step * min(1.0, 0.3 / float(np.linalg.norm(step)))
        if values[group] < ZERO * usual and values[0] > KEPT * usual:
            return True
    return False


def _certified(robot: Robot, task: tuple[Coordinate, ...], subset: tuple[Coordinate, ...]) -> str:
    """The verdict of exact analysis; ``screened`` where it does not take the rows or the robot."""
    rows: Any = (task, subset)  # those that it does not take are refused
    try:
        return analyse(ExactModel(robot), *rows).verdict
    except WbcError:
        return SCREENED
