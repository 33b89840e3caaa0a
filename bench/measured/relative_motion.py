"""The published compensation of relative motion: straight lines of each table, and a hand on a table that moves."""

from __future__ import annotations

import numpy as np

from bench.sheet import Sheet
from wbc.published.relative_motion import INCH, commanded, line_errors, predicted, tables
from wbc.published.relative_motion.studies import Row, holding

ARM = ("4.3", "4.4", "4.5", "4.6", "4.7", "4.8")


def parts() -> dict[str, Sheet | str]:
    """Largest errors of x, y and z in inches."""
    return {
        "lines": _lines(),
        "table": _sheet(holding()),
    }


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


def _sheet(rows: list[Row]) -> Sheet:
    def text(x: float | str) -> str:
        return x if isinstance(x, str) else f"{x:.1g}" if 0.0 < abs(x) < 1e-3 else f"{x:.3f}"

    return Sheet("", tuple(rows[0]), [tuple(map(text, row.values())) for row in rows])
