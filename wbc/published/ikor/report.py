"""Files of runs: norms, errors and clearances of all steps, as a table and as a picture beside the printed norms."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from wbc import style
from wbc.published.ikor.cases import Printed, differences
from wbc.published.ikor.driver import CourseRun


def times(run: CourseRun) -> dict[str, float | None]:
    """Median and longest time of a step [ms]."""
    spent = 1e3 * np.asarray(run.seconds) if len(run.seconds) else None
    median, longest = (None, None) if spent is None else (float(np.median(spent)), float(spent.max()))
    return {"median_step_ms": median, "longest_step_ms": longest}


def figures_of(run: CourseRun) -> dict[str, Any]:
    """A run in numbers, None for what it does not have."""
    some = len(run.norms) > 0
    clear = float(run.clearance.min()) if some else np.inf
    return {
        "code": int(run.code),
        "stop": str(run.stop),
        "message": run.message,
        "steps": len(run.norms),
        "last_error": float(run.errors[-1]) if len(run.errors) else None,
        "largest_norm": float(run.norms.max()) if some else None,
        "clearance": clear if clear < np.inf else None,
        **times(run),
        "steps_with_constraints": sum(map(bool, run.acted)),
        "given_up": sum(map(bool, run.given_up)),
    }


def beside(run: CourseRun, printed: Printed, trajectory: str, config: str) -> tuple[dict[str, Any], list[str]]:
    """Figures of a published run, and its cells of a table beside what is printed."""
    figures = {"stop": str(run.stop), "message": run.message, "steps": len(run.norms), **times(run)}
    if run.code:
        return figures, [f"{len(run.norms)} steps: {run.stop}"]
    off = differences(run, trajectory, config)
    ends = np.flatnonzero(np.isfinite(printed.fsp))[[0, -1]]
    cells = [f"{x:.6f}" for k in ends for x in (printed.fsp[k], run.norms[int(printed.steps[k]) - 1])]
    rms, worst = float(np.sqrt(np.mean(off**2))), float(np.abs(off).max())
    figures |= {"values": len(off), "rms": rms, "largest": worst, "last_error": float(run.errors[-1])}
    return figures, [str(len(off)), f"{rms:.1e}", f"{worst:.1e}", *cells]


def save_norms(folder: Path, runs: Mapping[str, tuple[CourseRun, Printed | None]]) -> None:
    """``norms.csv`` and ``norms.png`` of runs by name, each with what is printed of it or None."""
    with (folder / "norms.csv").open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["run", "step", "norm", "error", "clearance"])
        for key, (run, _) in runs.items():
            for k, row in enumerate(zip(run.norms, run.errors, run.clearance, strict=True), 1):
                writer.writerow([key, k, *(repr(float(x)) for x in row)])
    with style.pyplot() as plt:
        high, wide = (2, len(runs) // 2) if len(runs) > 4 else (1, len(runs))
        size = 3.2 * max(2, wide), 3.2 * high
        figure, panels = plt.subplots(high, wide, figsize=size, layout="constrained", squeeze=False)
        for panel, (key, (run, printed)) in zip(panels.flat, runs.items(), strict=True):
            panel.plot(range(1, len(run.norms) + 1), run.norms, lw=1.6, label="measured")
            if printed is not None:
                panel.plot(printed.steps, printed.fsp, ".", ms=4, color="black", label="printed")
            panel.set_yscale("log")
            panel.set_title(key, fontsize=11)
            panel.set_xlabel("step")
        panels[0][0].set_ylabel("norm [deg$^2$]")
        panels[0][0].legend()
        figure.savefig(folder / "norms.png")
        plt.close(figure)
