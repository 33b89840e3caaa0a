"""Colours, settings and panels that all plots share."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc import extras

#: Colours by meaning
BLUE, ORANGE, GREEN, RED, PURPLE, TEAL, GREY = (
    "#1f5fa8",
    "#e07b18",
    "#2e8b57",
    "#c0392b",
    "#7b4fa6",
    "#1f9aa0",
    "#6b7280",
)
INK = "#22272e"
#: For curves that stand side by side, told apart by most people with a colour-vision deficiency
CYCLE = (BLUE, ORANGE, TEAL, PURPLE, GREEN, RED, "#b08900", "#4aa3df", "#8c564b", GREY)

SETTINGS: dict[str, Any] = {
    "figure.dpi": 100,
    "savefig.dpi": 140,
    "figure.facecolor": "white",
    "font.size": 11,
    "axes.titlesize": 11,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelcolor": INK,
    "axes.edgecolor": "#9aa2ad",
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e3e6ea",
    "grid.linewidth": 0.8,
    "text.color": INK,
    "xtick.color": "#4b5563",
    "ytick.color": "#4b5563",
    "lines.linewidth": 1.6,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "legend.fontsize": 10,
}


@contextlib.contextmanager
def pyplot() -> Iterator[Any]:
    """matplotlib.pyplot with these settings, on the back end that draws into files."""
    extras.require("plots", "a plot")
    import matplotlib
    from cycler import cycler

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    settings: Any = {**SETTINGS, "axes.prop_cycle": cycler(color=CYCLE)}
    with plt.rc_context(settings):
        yield plt


def tick_histogram(plt: Any, seconds: NDArray[np.float64], title: str) -> Any:
    """Figure: how often ``controller.step`` took how long, with median and 99th percentile; ``seconds`` (ticks) [s]."""
    micro = 1e6 * seconds
    edges = np.geomspace(max(0.8 * micro.min(), 1e-2), 1.25 * micro.max(), 70)
    figure, panel = plt.subplots(figsize=(9.2, 3.4), layout="constrained")
    panel.hist(micro, bins=edges, color=TEAL, alpha=0.85)
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
    # Labels of all minor ticks would lie on each other
    panel.xaxis.set_minor_formatter(lambda x, _: f"{x:g}" if f"{x:g}"[0] in "25" else "")
    for name, part, colour in (("median", 50, INK), ("p99", 99, RED)):
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
