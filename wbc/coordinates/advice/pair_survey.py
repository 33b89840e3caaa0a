"""How well the best of some pairs is conditioned at random configurations, and what asking for it takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from wbc import validation
from wbc.coordinates.advice.adviser import Adviser
from wbc.coordinates.pair import CoordinatePair
from wbc.coordinates.samples import states_of
from wbc.errors import RangeError
from wbc.robot import Robot
from wbc.validation import Array

#: Ticks that a time is the median of
TICKS = 500


@dataclass(frozen=True, eq=False)
class PairSurvey:
    """The best pair at each of N configurations.

    Attributes:
        states: configurations [N, nq]. ratios: sigma_min of the best pair over that of its task alone [N].
        tasks: sigma_min of that task [N]. best: name of the pair at each.
    """

    states: Array
    ratios: Array
    tasks: Array
    best: tuple[str, ...]

    @property
    def worst(self) -> int:
        """Number of the configuration with the smallest ratio."""
        return int(np.argmin(self.ratios))

    def quantile(self, part: float) -> float:
        """The ratio that a part of the configurations is below."""
        return float(np.quantile(self.ratios, validation.scalar("part", part, low=0.0, high=1.0)))


def survey_pairs(robot: Robot, pairs: Sequence[CoordinatePair], count: int, *, seed: int = 0) -> PairSurvey:
    """max over pairs of sigma_min(D_r [J_T; J_C] D_c) / sigma_min(D_r J_T D_c) at random configurations [1].

    Every joint is uniform within its limits, or over a turn where it has none.

    Args:
        count: configurations, at least one.

    Raises:
        ShapeError, DuplicateNameError, RangeError, UnknownNameError: bad pairs or count; a task that has no rank.
    """
    if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1:
        raise RangeError("count", count, "expected a whole number of at least 1")
    adviser = Adviser(robot, pairs, exact=False)
    states = states_of(robot, count, validation.integer("seed", seed))
    names = list(adviser.pairs)
    ratios, tasks, best = np.empty(count), np.empty(count), []
    for k, q in enumerate(states):
        sigma, task = adviser.singular_values(q)
        if not task.all():
            raise RangeError(
                "pairs", names[int(np.argmin(task))], "its task has dependent rows at a random configuration"
            )
        found = sigma / task
        at = int(np.argmax(found))
        ratios[k], tasks[k] = found[at], task[at]
        best.append(names[at])
    return PairSurvey(states, ratios, tasks, tuple(best))


def advice_time(adviser: Adviser, *, seed: int = 0) -> float:
    """Median time of :meth:`Adviser.sigmas`, what a control loop asks for in a tick [s]."""
    validation.instance("adviser", adviser, Adviser, "an Adviser")
    spent = []
    for q in states_of(adviser.robot, TICKS, validation.integer("seed", seed)):
        began = perf_counter()
        adviser.sigmas(q)
        spent.append(perf_counter() - began)
    return float(np.median(spent))
