"""Plots of logs: curves over time with their limits, and how long ticks took."""

from __future__ import annotations

import math
import pathlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc import style
from wbc.validation import Array


@dataclass(frozen=True, eq=False)
class LogPanel:
    """Curves over the same times.

    Attributes:
        unit: at its left, of the curves. curves: (one value a tick, colour, name in the legend or "").
        low, high: limits, which are shaded where they are near. title: above it.
    """

    unit: str
    curves: Sequence[tuple[Array, str, str]]
    low: float = -math.inf
    high: float = math.inf
    title: str = ""


def save_each(
    draws: Mapping[str, Callable[[Any], Any]], folder: pathlib.Path, progress: Callable[[str], None] | None = None
) -> list[pathlib.Path]:
    """Write plots as PNG; returns the files.

    Args:
        draws: name of a file -> (pyplot) -> figure. progress: is told each that is done.
    """
    files = []
    with style.pyplot() as plt:
        for name, draw in draws.items():
            figure = draw(plt)
            files.append(folder / f"{name}.png")
            figure.savefig(files[-1])
            plt.close(figure)
            if progress is not None:
                progress(name)
    return files


def over_time(plt: Any, t: Array, panels: Sequence[LogPanel], title: str, columns: int = 1) -> Any:
    """Figure of panels one under the other, or side by side in some columns; ``t`` [s]."""
    rows, wide = math.ceil(len(panels) / columns), {1: 9.2, 2: 4.6}.get(columns, 3.4)
    size = wide * columns, (1.9 if columns == 1 else 1.6) * rows + 0.8
    figure, axes = plt.subplots(rows, columns, figsize=size, sharex=True, layout="constrained", squeeze=False)
    for axis, panel in zip(axes.flat, panels, strict=False):
        for values, colour, name in panel.curves:
            axis.plot(t, values, color=colour, lw=1.1 if len(panel.curves) > 1 else 1.6, label=name or None)
        _limit(axis, np.concatenate([values for values, _, _ in panel.curves]), panel.low, panel.high)
        axis.set_title(panel.title, fontsize=10)
        axis.set_ylabel(panel.unit)
        axis.margins(x=0.01)
    for axis in axes.flat[len(panels) :]:
        axis.set_visible(False)
    for axis in axes.flat[max(0, len(panels) - columns) : len(panels)]:
        axis.xaxis.set_tick_params(labelbottom=True)
    figure.supxlabel("time [s]", fontsize=11, color=style.INK)
    names = axes.flat[0].get_legend_handles_labels()[1]
    if names:
        axes.flat[columns - 1].legend(loc="lower right", ncols=len(names), bbox_to_anchor=(1.0, 1.12))
    figure.suptitle(title, x=0.01, ha="left", fontweight="bold", fontsize=13)
    return figure


def _limit(axis: Any, values: Array, low: float, high: float) -> None:
    """Show limits where both are finite, or within the curves' range."""
    bottom, top = float(np.nanmin(values)), float(np.nanmax(values))
    free = not math.isfinite(low) and not math.isfinite(high)
    # Noise of a joint that stands is not blown up to the height of the panel
    pad = 0.12 * (top - bottom if free and top > bottom else max(top - bottom, 1e-3))
    if math.isfinite(low) and math.isfinite(high):
        bottom, top = min(bottom, low), max(top, high)
        pad = 0.06 * (top - bottom)
    elif free and bottom >= 0.0:
        bottom = pad
    axis.set_ylim(bottom - pad, top + pad)
    for edge, end in ((low, bottom - pad), (high, top + pad)):
        if math.isfinite(edge):
            axis.axhspan(*sorted((edge, end)), color=style.RED, alpha=0.12, lw=0)
            axis.axhline(edge, color=style.RED, lw=1.0)


def tick_histogram(plt: Any, seconds: Array, title: str) -> Any:
    """Figure: how often ``controller.step`` took how long, with median and 99th percentile; ``seconds`` (ticks) [s]."""
    micro = 1e6 * seconds
    edges = np.geomspace(max(0.8 * micro.min(), 1e-2), 1.25 * micro.max(), 70)
    figure, panel = plt.subplots(figsize=(9.2, 3.4), layout="constrained")
    panel.hist(micro, bins=edges, color=style.TEAL, alpha=0.85)
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
    # Labels of all minor ticks would lie on each other
    panel.xaxis.set_minor_formatter(lambda x, _: f"{x:g}" if f"{x:g}"[0] in "25" else "")
    for name, part, colour in (("median", 50, style.INK), ("p99", 99, style.RED)):
        value = float(np.percentile(micro, part))
        panel.axvline(value, color=colour, lw=1.4)
        panel.annotate(
            f"{name} {value:.1f} us",
            (value, 1.0),
            (4, -2),
            ("data", "axes fraction"),
            "offset points",
            va="top",
            color=colour,
        )
    panel.set_xlabel("time of controller.step [us]")
    panel.set_ylabel("ticks")
    panel.set_title(title, fontsize=13)
    return figure
