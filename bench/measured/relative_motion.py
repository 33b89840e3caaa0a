"""The published compensation of relative motion: straight lines of each table, and a hand on a table that moves."""

from __future__ import annotations

import math

import numpy as np

from bench.sheet import Sheet
from wbc.published.relative_motion import INCH, commanded, hold_on_table, line_errors, predicted, tables

ARM = ("4.3", "4.4", "4.5", "4.6", "4.7", "4.8")


def parts() -> dict[str, Sheet | str]:
    """Largest errors of x, y and z in inches."""
    return {"lines": _lines(), "table": _table()}


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


def _table() -> Sheet:
    """2 in at 0.1 Hz and 5 degrees at 0.05 Hz; cycles of 50 ms."""

    def swaying(t: float) -> tuple[np.ndarray, np.ndarray]:
        w, v, turn = 0.2 * math.pi, 0.1 * math.pi, math.radians(5.0)
        moved = np.array([2.0 * INCH * math.sin(w * t), 19.39 * INCH, -40.0 * INCH, turn * math.sin(v * t)])
        return moved, np.array([2.0 * INCH * w * math.cos(w * t), 0.0, 0.0, turn * v * math.cos(v * t)])

    rows, at = [], np.array([0.5, -0.4, 0.3, 0.0]) * INCH
    cases = (("nothing", False, False), ("pose", True, False), ("pose and twist", True, True))
    for name, compensated, feedforward in cases:
        held = hold_on_table(np.zeros(6), swaying, lambda t: at, 20.0, compensated=compensated, feedforward=feedforward)
        off = held.relative - held.commanded
        rows.append((name, f"{np.linalg.norm(off[:, :3], axis=1).max() / INCH:.5f}",
                     f"{math.degrees(np.abs(off[:, 3]).max()):.4f}"))  # fmt: skip
    return Sheet("", ("of the table is added", "position, in", "yaw, degrees"), rows)
