"""Colours, settings and panels that all plots share."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

from wbc import extras

#: Colours by meaning
BLUE = "#1f5fa8"
ORANGE = "#e07b18"
GREEN = "#2e8b57"
RED = "#c0392b"
PURPLE = "#7b4fa6"
TEAL = "#1f9aa0"
GREY = "#6b7280"
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
