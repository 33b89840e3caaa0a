"""Self-motion as a picture: joints along each piece, limits, and the windows in which all hold."""

from __future__ import annotations

import pathlib
from collections.abc import Sequence

import numpy as np

from wbc import style
from wbc.explore.explorer import Piece
from wbc.robot import Robot


def save_pieces(robot: Robot, pieces: Sequence[Piece], file: pathlib.Path, best: np.ndarray | None = None) -> None:
    """A panel a piece: coordinates over the length of the curve as shares of their ranges; shaded where a limit or
    margin does not hold; a line at the best configuration.
    """
    shown = list(pieces)[:4]
    at = np.flatnonzero(robot.position_index >= 0)
    index = robot.position_index[at]
    low, high = robot.limits.position_lower[at], robot.limits.position_upper[at]
    low, high = np.where(np.isfinite(low), low, -np.pi), np.where(np.isfinite(high), high, np.pi)
    with style.pyplot() as plt:
        figure, panels = plt.subplots(1, len(shown), figsize=(3.6 * max(2, len(shown)), 3.8), layout="constrained",
                                      squeeze=False, sharey=True)  # fmt: skip
        for number, (panel, piece) in enumerate(zip(panels[0], shown, strict=True), 1):
            steps = np.linalg.norm(np.diff(piece.q, axis=0), axis=1)
            length = np.concatenate(([0.0], np.cumsum(steps)))
            for k, name in enumerate(np.array(robot.dof_names)[at]):
                share = (2.0 * piece.q[:, index[k]] - low[k] - high[k]) / (high[k] - low[k])
                panel.plot(length, share, lw=1.4, label=str(name))
            broken = np.array([bool(text) for text in piece.broken])
            panel.fill_between(length, -1.3, 1.3, where=broken, color="0.85", lw=0, step="mid")
            panel.axhline(-1.0, color="black", lw=0.8, ls=":")
            panel.axhline(1.0, color="black", lw=0.8, ls=":")
            if best is not None:
                near = np.linalg.norm(piece.q - best, axis=1)
                if near.min() < 1e-9:
                    panel.axvline(length[int(near.argmin())], color="black", lw=1.2)
            panel.set_ylim(-1.3, 1.3)
            how = "closed" if piece.closed else f"{piece.ends[0]}\nto {piece.ends[1]}"
            panel.set_title(f"piece {number}: {how}", fontsize=10)
            panel.set_xlabel("length of the curve [rad, m]")
        panels[0][0].set_ylabel("coordinate, -1 and 1 at its limits")
        panels[0][-1].legend(fontsize=7, loc="upper right")
        figure.savefig(file)
        plt.close(figure)
