"""The bench of pairs' ticks."""

from __future__ import annotations

from bench.pair_ticks import pair_ticks
from wbc.coordinates import mode_pairs


def test_every_pair_is_measured() -> None:
    found = pair_ticks("spherical_4r", 40)
    assert list(found) == [pair.name for pair in mode_pairs("spherical_4r", "M1")]
    assert all(0.0 < bare < whole < 1.0 for whole, bare in found.values())
