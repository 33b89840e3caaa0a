"""Trials of the loop from seeds: a handful here, hundreds with ``make soak REPEATS=30``; the checker finds nothing."""

from __future__ import annotations

import pytest

from tests.climb.trials import KINDS, wrong
from tests.repeats import repeats

#: Seeds of each kind that are tried first: the quick ones
FIRST = {"drive": (0, 2), "resume": (3, 15), "vanish": (0, 23), "stop": (6, 0),
         "layout": (0, 9), "structure": (1, 2), "six_arms": (1, 2), "other": (1, 2)}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_is_violated(kind: str) -> None:
    for seed in (*FIRST[kind], *range(100, 100 + repeats(1)))[: repeats(1)]:
        record = KINDS[kind](seed)
        assert not wrong(kind, record), (seed, record)
