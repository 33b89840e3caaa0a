"""The curves as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

PANELS = {
    "joints": "degrees of freedom", "tasks": "pose tasks (Talos)", "spheres": "spheres against a Panda",
    "sensed": "measured pairs of boxes",
}  # fmt: skip
COLOURS = {"wbc": "#0b6e4f", "pink + daqp": "#c2185b", "mink + daqp": "#1565c0", "placo": "#ef6c00"}


def draw(curves: Sequence[dict[str, Any]], path: Path) -> None:
    """One panel a curve, medians of the tick over what grows, written as PNG."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, len(PANELS), figsize=(13.0, 3.4), sharey=True, layout="constrained")
    for axis, (curve, label) in zip(axes, PANELS.items(), strict=True):
        found = [point for point in curves if point["curve"] == curve]
        for name, colour in COLOURS.items():
            places = [(p["x"], p["contenders"][name]["median"]) for p in found if name in p["contenders"]]
            axis.plot(*zip(*places, strict=True), "o-", color=colour, label=name, markersize=4) if places else None
        axis.set_yscale("log")
        axis.set_xlabel(label)
        axis.set_xlim(left=0.0)
        axis.grid(alpha=0.3, which="major")
    axes[0].set_ylabel("median of one tick [us]")
    axes[0].legend(loc="upper left", fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)
