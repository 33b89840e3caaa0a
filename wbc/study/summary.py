"""What is left of a run: results as parquet, a picture, and a summary of the metrics."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from wbc.study.kept import PLOT, SUMMARY, Kept
from wbc.style import BLUE, CYCLE, pyplot

#: Failed trials that the summary tells of
TOLD = 5
#: Cells of a map along each axis, at least and at most
CELLS = (8, 40)
#: Results for each cell of a map
EACH = 8
#: Bars of a histogram
BARS = 30
#: Metrics that are drawn, at most
PANELS = 4
#: Groups of trials that are drawn, at most
GROUPS = 4


def save_plot(
    title: str, table: dict[str, list[Any]], metrics: tuple[str, ...], varied: tuple[str, ...], path: Path
) -> None:
    """Draw a table of results; ``varied`` are the parameters of several values, or the seed's column."""
    places = all(name in metrics for name in "xyz")
    drawn = tuple(name for name in metrics if not (places and name in "xyz"))[:PANELS]
    groups = _groups(table, varied[0] if varied else None)
    with pyplot() as plt:
        rows = len(groups) if places else 1
        size = (4.6 * max(1, len(drawn)), 3.6 * rows)
        figure, panels = plt.subplots(rows, max(1, len(drawn)), figsize=size, squeeze=False, layout="constrained")
        for column, name in enumerate(drawn):
            if places:
                for row, (text, chosen) in enumerate(groups):
                    _map(figure, panels[row, column], table, name, text, chosen)
            elif varied:
                _over(panels[0, column], table, name, varied)
            else:
                values = _numbers(table, name)
                panels[0, column].hist(values[np.isfinite(values)], bins=BARS, color=BLUE)
                panels[0, column].set(xlabel=name, ylabel="rows")
        figure.suptitle(title)
        figure.savefig(path)
        plt.close(figure)


def _numbers(table: dict[str, list[Any]], name: str) -> np.ndarray:
    return np.array([np.nan if x is None else x for x in table[name]], float)


def _groups(table: dict[str, list[Any]], name: str | None) -> list[tuple[str, np.ndarray]]:
    """Rows by the values of a parameter."""
    if name is None:
        return [("", np.ones(len(table["trial"]), bool))]
    values = list(dict.fromkeys(table[name]))[:GROUPS]
    return [(f"{name} = {value}", np.array([x == value for x in table[name]])) for value in values]


def _map(figure: Any, panel: Any, table: dict[str, list[Any]], name: str, text: str, chosen: np.ndarray) -> None:
    """Mean over the distance from the upright axis and the height."""
    x, y, z, value = (_numbers(table, column)[chosen] for column in ("x", "y", "z", name))
    fine = np.isfinite(value)
    far = np.hypot(x, y)[fine]
    cells = int(np.clip(np.sqrt(len(far) / EACH), *CELLS))
    count, *edges = np.histogram2d(far, z[fine], bins=cells)
    total = np.histogram2d(far, z[fine], bins=edges, weights=value[fine])[0]
    mean = np.divide(total, count, out=np.full_like(total, np.nan), where=count > 0)
    shown = panel.pcolormesh(*edges, mean.T, cmap="viridis")
    figure.colorbar(shown, ax=panel, label=f"mean of {name}")
    panel.set(xlabel="distance from the upright axis [m]", ylabel="height [m]", title=text, aspect="equal")
    panel.grid(False)
    panel.locator_params(nbins=5)


def _over(panel: Any, table: dict[str, list[Any]], name: str, varied: tuple[str, ...]) -> None:
    """Mean over the first parameter, a curve for each value of the second one; bars: from the 10th to the 90th part."""
    by = varied[0]
    values = list(dict.fromkeys(table[by]))
    numeric = all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in values)
    at = np.array(values, float) if numeric else np.arange(len(values), dtype=float)
    y = _numbers(table, name)
    for k, (text, chosen) in enumerate(_groups(table, varied[1] if len(varied) > 1 else None)):
        parts = [y[chosen & np.array([x == value for x in table[by]]) & np.isfinite(y)] for value in values]
        there = [part.size > 0 for part in parts]
        means, low, high = (
            np.array([figure(part) for part in parts if part.size])
            for figure in (np.mean, lambda p: np.percentile(p, 10), lambda p: np.percentile(p, 90))
        )
        spread = np.maximum(0.0, [means - low, high - means])
        style = "o-" if numeric else "o"
        panel.errorbar(at[there], means, yerr=spread, fmt=style, color=CYCLE[k % len(CYCLE)], label=text, capsize=3)
        if text:
            panel.legend()
    if not numeric:
        panel.set_xticks(at, [str(value) for value in values])
    panel.set(xlabel=by, ylabel=name)


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
