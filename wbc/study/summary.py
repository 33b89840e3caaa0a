"""What is left of a run: results as parquet, a picture, and a summary of the metrics."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from wbc.study.kept import PLOT, SUMMARY, Kept
from wbc.study.plots import save_plot

#: Failed trials that the summary tells of
TOLD = 5


def conclude(kept: Kept) -> dict[str, Any]:
    """Write ``results.parquet``, ``study.png`` and ``summary.json`` of what there is; returns the summary."""
    study, table = kept.study, kept.table()
    trials = list(study.trials())
    dones = [kept.get(trial) for trial in trials]
    failures = [
        f"{t.parameters}, seed {t.seed}: {d.error}" for t, d in zip(trials, dones, strict=True) if d and d.error
    ]
    given = {"trial", "seed", *(name for trial in trials[:1] for name in trial.parameters)}
    metrics = tuple(name for name in table if name not in given)
    summary: dict[str, Any] = {
        "study": study.data(),
        "trials": study.count,
        "finished": sum(done is not None and not done.error for done in dones),
        "failed": len(failures),
        "rows": len(table["trial"]),
        "metrics": {name: _figures(table[name]) for name in metrics},
        "failures": failures[:TOLD],
    }
    kept.save()
    if table["trial"]:
        title = f"{study.content.scenario}: {summary['finished']} of {study.count} trials"
        save_plot(title, table, metrics, study.varied, kept.folder / PLOT)
    (kept.folder / SUMMARY).write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")
    return summary


def _figures(values: list[float | None]) -> dict[str, float]:
    """Mean and spread of the numbers that there are."""
    there = np.array([x for x in values if x is not None], float)
    if not there.size:
        return {"count": 0.0}
    low, middle, high = np.percentile(there, (5.0, 50.0, 95.0)).tolist()
    return {"count": float(there.size), "mean": float(there.mean()), "p5": low, "median": middle, "p95": high}
