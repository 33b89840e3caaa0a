"""Sets of coordinates that complete the rows of a task: which can take an arm's redundancy up, and which do it best."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import combinations
from math import comb

import numpy as np

from wbc.coordinates import expressions
from wbc.coordinates.arms.arm_parts import Held
from wbc.coordinates.rows import Coordinate
from wbc.coordinates.samples import ROUNDING, rank, states_of
from wbc.coordinates.scales import scales
from wbc.robot import Robot
from wbc.symbolic.evaluation import SingleState
from wbc.validation import Array

#: Random configurations at which the rank of a set is looked at
SET_STATES = 48
#: Sets that are returned at most
SETS = 6
#: Subsets that are looked at, at most
SUBSETS = 600
#: A further set has to better the best pair by this factor, as the geometric mean over the configurations
GAIN = 1.05
#: Part of a task's least singular value that counts as none, where logarithms are taken
NOTHING = 1e-4


class Sampled:
    """Scaled rates of coordinates by the rates of some joints, at random configurations.

    Args:
        joints: names. every: coordinates of which rows are wanted.
    """

    def __init__(self, robot: Robot, joints: Sequence[str], every: Held) -> None:
        self._robot = robot
        self._every = tuple(dict.fromkeys(every))
        self._columns = [robot.dofs(name).start for name in joints]

    @cached_property
    def _rows(self) -> dict[Coordinate, Array]:
        robot = self._robot
        states = states_of(robot, SET_STATES)
        rates = SingleState(expressions.rate_function(robot, self._every))
        own, dofs = scales(robot, self._every)
        whole = (own[:, None] * np.array([rates(q)[0] for q in states]) * dofs)[:, :, self._columns]
        out, start = {}, 0
        for one in self._every:
            count = len(expressions.labels(robot, one))
            out[one] = whole[:, start : start + count]
            start += count
        return out

    def stacked(self, some: Held) -> Array:
        """Rows of some coordinates, one below the other [states, rows, joints]."""
        return np.concatenate([self._rows[one] for one in some], axis=1)

    def kept(self, task: Coordinate, held: Held) -> Array:
        """Part of the task's least singular value that is left with held rows [states]; 0 where rows are too few."""
        J = self.stacked((task, *held))
        if J.shape[1] < J.shape[2]:
            return np.zeros(len(J))
        alone = np.linalg.svd(self._rows[task], compute_uv=False)
        least, most = alone[:, -1], alone[:, 0]
        both = np.linalg.svd(J, compute_uv=False)[:, -1]
        return np.where(least > ROUNDING * most, both / np.maximum(least, ROUNDING * most), 0.0)

    def completes(self, task: Coordinate, held: Held) -> bool:
        """Task and held rows have full column rank almost everywhere."""
        J = self.stacked((task, *held))
        return rank(J) == int(J.shape[2])


def single_sets(sampled: Sampled, task: Coordinate, pool: Held) -> tuple[Held, ...]:
    """Single coordinates that complete a task almost everywhere, in their order."""
    return tuple((one,) for one in dict.fromkeys(pool) if sampled.completes(task, (one,)))


def sets_of(sampled: Sampled, task: Coordinate, pool: Held, size: int) -> tuple[Held, ...]:
    """Sets of ``size`` coordinates that complete a task, at most :data:`SETS` of them.

    One after another is taken that most raises the geometric mean over the configurations of what the best set keeps
    of the task's least singular value, until none raises it by :data:`GAIN`. Of more than :data:`SUBSETS` sets as many
    at random are looked at.
    """
    pool = tuple(dict.fromkeys(pool))
    if comb(len(pool), size) <= SUBSETS:
        subsets = list(combinations(range(len(pool)), size))
    else:
        rng = np.random.default_rng(0)
        drawn = (tuple(sorted(rng.choice(len(pool), size, replace=False).tolist())) for _ in range(SUBSETS))
        subsets = list(dict.fromkeys(drawn))
    sets = [tuple(pool[k] for k in some) for some in subsets]
    kept = np.array([np.clip(sampled.kept(task, held), NOTHING, None) for held in sets])
    chosen: list[int] = []
    best = np.full(kept.shape[1], NOTHING) if len(kept) else np.zeros(0)
    while len(chosen) < min(SETS, len(sets)):
        means = np.log(np.maximum(kept, best)).mean(axis=1) - np.log(best).mean()
        k = int(np.argmax(means))
        if means[k] < np.log(GAIN) or not sampled.completes(task, sets[k]):
            break
        chosen.append(k)
        best = np.maximum(best, kept[k])
    return tuple(sets[k] for k in chosen)
