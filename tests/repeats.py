"""How often a test repeats a property on random cases: enough to notice a wrong formula, which mutations show."""

from __future__ import annotations

import os

#: ``make test REPEATS=3`` tries three times as many cases
MORE = float(os.environ.get("WBC_REPEATS", "1"))


def repeats(count: int) -> int:
    """So many random cases, or as many more as are asked for."""
    return max(1, round(count * MORE))
