"""Both Jacobians of a published set at a configuration, in numbers."""

from __future__ import annotations

from wbc.analysis import published_sets
from wbc.analysis.jacobians.numeric import NumericRows
from wbc.validation import Array


def jacobians(name: str, chosen: str, q: Array) -> tuple[Array, Array]:
    """J_T of the task, and J_R of the task with the constraints that are called ``chosen``."""
    sets = published_sets(name)
    numeric = NumericRows(sets.robot)
    return numeric.value(sets.task, q), numeric.value((*sets.task, *sets.sets[chosen]), q)
