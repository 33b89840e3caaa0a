"""The published straight lines as a picture."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from wbc import style
from wbc.published.relative_motion import printed as known
from wbc.published.relative_motion.arms import INCH
from wbc.validation import Array


def plot_lines(file: Path, measured: Mapping[str, Array]) -> None:
    """Errors of x, y and z over the command: points as measured, lines by one solve."""
    with style.pyplot() as plt:
        high, wide = (2, 3) if len(measured) > 1 else (1, 1)
        size = (3.6 * wide + 1.2, 2.9 * high)
        figure, panels = plt.subplots(high, wide, figsize=size, layout="constrained", squeeze=False)
        for panel, (name, points) in zip(panels.flat, measured.items(), strict=True):
            sizes, wanted = known.tables()[name].commands[1:], known.commanded(name) / INCH
            for axis, colour in enumerate((style.BLUE, style.ORANGE, style.TEAL)):
                label = "xyz"[axis]
                panel.plot(sizes, (points - wanted)[:, axis], "o", ms=4, color=colour, label=f"{label} measured")
                for method, look in (("order 0", "-"), ("order 1", "--")):
                    off = (known.predicted(name, method) - wanted)[:, axis]
                    panel.plot(sizes, off, look, lw=1.2, color=colour, label=f"{label} {method}")
            panel.set_title(f"{name}: along {'xyz'[known.AXIS[name]]}")
            panel.set_xlabel("command [in]")
            panel.set_ylim(-0.85, 0.6)
            panel.set_xticks(np.arange(0, np.ceil(sizes[-1]) + 1))
        panels[0][0].set_ylabel("error [in]")
        figure.legend(*panels[0][0].get_legend_handles_labels(), loc="outside right center", fontsize=8)
        figure.savefig(file)
        plt.close(figure)
