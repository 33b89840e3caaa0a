"""Printed and measured norms of the published runs of Full Space Parameterization, and what differs."""

from __future__ import annotations

from collections import Counter

import numpy as np

from bench.sheet import Sheet
from wbc.published.ikor.cases import BETWEEN, CONFIGS, NEAR, case, differences, unmatched

COLUMNS = ("run", "values", "rms", "median", "largest", f"beyond {NEAR:g}", "miss [m, rad]", "miss, consistent")


def parts() -> dict[str, Sheet | str]:
    """A row a run, with the reasons of printed norms that are not matched."""
    rows = []
    for trajectory in BETWEEN:
        for config in CONFIGS:
            run, consistent = case(trajectory, config), case(trajectory, config, legacy=False)
            off = np.abs(differences(run, trajectory, config))
            reasons = Counter(row[-1] for row in unmatched(run, trajectory, config))
            numbers = [f"{x:.1e}" for x in (np.sqrt(np.mean(off**2)), np.median(off), off.max())]
            misses = [f"{x:.1e}" for x in (run.errors[-1], consistent.errors[-1])]
            far = ", ".join(f"{count} {why}" for why, count in sorted(reasons.items()))
            rows.append((f"{trajectory} {config}", f"{len(off)}", *numbers, far or "0", *misses))
    return {"runs": Sheet("", COLUMNS, rows)}
