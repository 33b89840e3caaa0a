"""Self-motion as a picture: joints along each piece and against each other, with the windows in which limits hold."""

from __future__ import annotations

import pathlib
from collections.abc import Sequence

import numpy as np

from wbc import style
from wbc.explore.explorer import Piece
from wbc.robot import Robot

#: Colour of windows in which a joint is beyond its limits
LIMIT = "0.8"
#: Colour of windows in which a margin does not hold, as of an obstacle
MARGIN = "tab:orange"


def save_pieces(robot: Robot, pieces: Sequence[Piece], file: pathlib.Path, best: np.ndarray | None = None) -> None:
    """A column a piece. Above: coordinates over the length of the curve as shares of their ranges; windows of limits
    and margins shaded; a line at the best configuration. Below: the curve in the two coordinates that move most.
    """
    shown, at = list(pieces)[:4], np.flatnonzero(robot.position_index >= 0)
    names, index = np.array(robot.dof_names)[at], robot.position_index[at]
    low, high = robot.limits.position_lower[at], robot.limits.position_upper[at]
    low, high = np.where(np.isfinite(low), low, -np.pi), np.where(np.isfinite(high), high, np.pi)
    turns = np.array(robot.dof_units)[at] == "rad"
    with style.pyplot() as plt:
        figure, panels = plt.subplots(2, len(shown), figsize=(4.2 * max(2, len(shown)), 6.6), layout="constrained",
                                      squeeze=False)  # fmt: skip
        for number, (panel, plane, piece) in enumerate(zip(*panels, shown, strict=True), 1):
            q, middle = piece.q[:, index].copy(), 0.5 * (low + high)
            q[:, turns] = middle[turns] + (q[:, turns] - middle[turns] + np.pi) % (2.0 * np.pi) - np.pi
            # A line ends where a joint has turned once round
            q[1:][np.abs(np.diff(q, axis=0)) > np.pi] = np.nan
            length = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(piece.q, axis=0), axis=1))))
            panel.plot(length, (2.0 * q - low - high) / (high - low), lw=1.4, label=names)
            first, second = np.sort(np.argsort(np.ptp(piece.q[:, index], axis=0))[-2:]) if len(at) > 1 else (0, 0)
            plane.plot(q[:, first], q[:, second], lw=1.4, color="black", label="within all limits")
            for a, b, what in piece.windows:
                colour = MARGIN if "/" in what else LIMIT
                panel.axvspan(length[max(a - 1, 0)], length[b], color=colour, alpha=0.5, lw=0, label=f"_{what}")
                plane.plot(q[max(a - 1, 0) : b + 1, first], q[max(a - 1, 0) : b + 1, second], lw=5, color=colour,
                           alpha=0.8, label="_", solid_capstyle="butt")  # fmt: skip
            for colour, what in ((LIMIT, "beyond a joint limit"), (MARGIN, "a margin does not hold")):
                plane.plot([], [], lw=5, color=colour, label=what)
            for k, draw in ((first, plane.axvline), (second, plane.axhline)):
                for limit in (low[k], high[k]):
                    if np.nanmin(q[:, k]) <= limit <= np.nanmax(q[:, k]):
                        draw(limit, color="black", lw=0.8, ls=":")
            panel.hlines((-1.0, 1.0), 0.0, length[-1], color="black", lw=0.8, ls=":")
            near = np.abs(np.nan_to_num(q, nan=1e3) - (np.inf if best is None else best[index])).max(axis=1)
            if near.min() < 1e-9:
                panel.axvline(length[near.argmin()], color="black", lw=1.2)
                plane.plot(*q[near.argmin(), [first, second]], "o", color="black", label="farthest from limits")
            how = "closed" if piece.closed else f"{piece.ends[0]}\nto {piece.ends[1]}"
            panel.set(ylim=(-1.3, 1.3), xlabel="length of the curve [rad, m]")
            panel.set_title(f"piece {number}: {how}", fontsize=10)
            plane.set(xlabel=f"{names[first]} [{robot.dof_units[at[first]]}]",
                      ylabel=f"{names[second]} [{robot.dof_units[at[second]]}]")  # fmt: skip
        panels[0][0].set_ylabel("coordinate, -1 and 1 at its limits")
        panels[0][-1].legend(fontsize=7, loc="upper right")
        panels[1][0].legend(fontsize=7)
        figure.savefig(file)
        plt.close(figure)
