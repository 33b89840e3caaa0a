"""The published compensation of relative motion: straight lines of each table."""

from __future__ import annotations

import numpy as np

from bench.sheet import Sheet
from wbc.published.relative_motion import INCH, commanded, line_errors, predicted, tables

ARM = ("4.3", "4.4", "4.5", "4.6", "4.7", "4.8")


def parts() -> dict[str, Sheet | str]:
    """Largest errors of x, y and z in inches."""
    return {"lines": _lines()}


def _lines() -> Sheet:
    rows = []
    for name in ARM:
        wanted = commanded(name) / INCH
        off = [tables()[name].modified[:, :3] - wanted, *(predicted(name, m) - wanted for m in ("order 0", "order 1"))]
        line = line_errors(name)
        last = [np.abs(one).max() for one in off]
        rows.append((name, *(f"{x:.3f}" for x in last), f"{line[:, 0].max():.1g}", f"{line[:, 1].max():.1g}"))
    columns = ("table", "measured", "order 0", "order 1", "exact, end", "exact, way")
    return Sheet("", columns, rows)
