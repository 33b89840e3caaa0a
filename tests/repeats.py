"""How often a test repeats a property on random cases: enough to notice a wrong formula, which mutations show."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterable
from typing import Any

#: ``make test REPEATS=3`` tries three times as many cases
MORE = float(os.environ.get("WBC_REPEATS", "1"))
#: From so many repeats on, all combinations of parameters are tried
ALL = 3.0


def repeats(count: int) -> int:
    """So many random cases, or as many more as are asked for."""
    return max(1, round(count * MORE))


def covering(*axes: Iterable[Any]) -> list[tuple[Any, ...]]:
    """Combinations of parameters for ``pytest.mark.parametrize``: every value of two axes at least once, every pair of
    values of more axes; with ``REPEATS=3`` all combinations.
    """
    values = [list(axis) for axis in axes]
    places = list(itertools.product(*(range(len(axis)) for axis in values)))
    if MORE >= ALL:
        return [tuple(axis[k] for axis, k in zip(values, place, strict=True)) for place in places]
    if len(values) <= 2:
        most = max(len(axis) for axis in values)
        return [tuple(axis[k % len(axis)] for axis in values) for k in range(most)]
    pairs = {place: set(itertools.combinations(enumerate(place), 2)) for place in places}
    left, chosen = set().union(*pairs.values()), list[tuple[int, ...]]()
    while left:
        best = max(places, key=lambda place: len(pairs[place] & left))
        chosen.append(best)
        left -= pairs[best]
    return [tuple(axis[k] for axis, k in zip(values, place, strict=True)) for place in sorted(chosen)]
