"""Printed and measured norms of the published runs of Full Space Parameterization, and every row that differs."""

from __future__ import annotations

import numpy as np

from bench.sheet import Sheet
from wbc.published.ikor.cases import BETWEEN, CONFIGS, NEAR, case, differences, printed, unmatched

COLUMNS = (
    "run", "values", "rms", "median", "largest", f"beyond {NEAR:g}", "first: printed, measured", "last",
    "miss [m, rad]", "miss, consistent",
)  # fmt: skip


def parts() -> dict[str, Sheet | str]:
    """A row a run; a row for every printed norm that is not matched."""
    rows, far = [], []
    for trajectory in BETWEEN:
        for config in CONFIGS:
            run, consistent = case(trajectory, config), case(trajectory, config, legacy=False)
            off, table = np.abs(differences(run, trajectory, config)), printed()[trajectory, config]
            ends = np.flatnonzero(np.isfinite(table.fsp))[[0, -1]]
            pairs = [f"{table.fsp[k]:.6f}, {run.norms[int(table.steps[k]) - 1]:.6f}" for k in ends]
            differ = unmatched(run, trajectory, config)
            numbers = [f"{x:.1e}" for x in (np.sqrt(np.mean(off**2)), np.median(off), off.max())]
            name = f"{trajectory} {config}"
            misses = [f"{x:.1e}" for x in (run.errors[-1], consistent.errors[-1])]
            rows.append((name, f"{len(off)}", *numbers, f"{len(differ)}", *pairs, *misses))
            far += [(name, f"{step}", f"{a:.6f}", f"{b:.6f}", f"{x:+.1e}", why) for step, a, b, x, why in differ]
    columns = ("run", "step", "printed", "measured", "ln(measured / printed)", "why")
    return {"runs": Sheet("", COLUMNS, rows), "differ": Sheet("", columns, far)}
