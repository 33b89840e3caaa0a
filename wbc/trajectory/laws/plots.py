"""A picture of a law: its derivatives over time, its limits, and where it comes nearest to them."""

from __future__ import annotations

import math
import os
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from wbc import style, validation
from wbc.errors import LawFileError, ShapeError
from wbc.rotations import continuous_quaternions, quaternion
from wbc.trajectory.laws.certificate import ORDERS, LawPieces, Worst
from wbc.trajectory.laws.law import Law
from wbc.validation import Array

#: Points of every curve, at least
POINTS = 1500

#: Limits are in view where a curve comes to more than this share of them
NEAR = 0.3

_PER = {"position": "", "velocity": "/s", "acceleration": "/s²", "jerk": "/s³"}


@dataclass(frozen=True, eq=False)
class Panel:
    """Curves of one quantity, times x curves, with their limits, and the worst time among them, if it is here."""

    title: str
    unit: str
    names: Sequence[str]
    values: Array
    lower: Array | None = None
    upper: Array | None = None
    worst: Worst | None = None
    first: int = 0


def plot(law: Law, file: str | os.PathLike[str], names: Sequence[str] | None = None, title: str = "Law") -> None:
    """Draw a law into a file: position, velocity, acceleration, and jerk where accelerations do not jump.

    Limits are dashed; a ring marks where the certificate says that a quantity comes nearest to its limit, or goes
    farthest beyond. Poses are drawn in two columns: the origin, and the orientation (as a quaternion x, y, z, w).

    Args:
        file: its ending says the format, as in matplotlib (png, svg, pdf). names: of the joints; numbers by default.

    Raises:
        ShapeError: another number of names. LawFileError: the file cannot be written.
    """
    validation.instance("law", law, Law, "a Law")
    file = validation.file_path("file", file)
    validation.instance("title", title, str, "a string")
    if names is not None and len(validation.strings("names", names)) != law.dof:
        raise ShapeError("names", names, f"expected {law.dof} names")
    pieces = LawPieces.of(law.path, law.timing)
    share = np.linspace(0.0, 1.0, max(2, math.ceil(POINTS / len(pieces.start))))
    times = (pieces.start[:, None] + pieces.span[:, None] * share).ravel()
    columns = _pose_panels(law, pieces, share) if law.space == "poses" else [_joint_panels(law, pieces, share, names)]
    rows = max(len(column) for column in columns)
    with style.pyplot() as plt:
        size = (8.6 if len(columns) == 1 else 13.0, 1.0 + 2.25 * rows)
        figure, axes = plt.subplots(rows, len(columns), figsize=size, sharex=True, layout="constrained", squeeze=False)
        for column, panels in zip(axes.T, columns, strict=True):
            for axis, panel in zip(column, panels, strict=True):
                _draw(axis, times, panel)
            _legend(column[0], panels[0])
        figure.supxlabel("time [s]", fontsize=11, color=style.INK)
        # A line of this size holds so many letters
        words = textwrap.fill(f"{title}: {_summary(law)}", int(8.2 * size[0]))
        figure.suptitle(words, x=0.01, ha="left", fontweight="bold", fontsize=13)
        try:
            figure.savefig(file)
        except (OSError, ValueError) as error:
            raise LawFileError("file", str(FilePath(file)), f"cannot be written: {error}") from error
        finally:
            plt.close(figure)


def _summary(law: Law) -> str:
    certificate = law.certificate
    parts = [f"{law.duration:.4g} s"]
    if certificate.limited and certificate.ratio < np.inf:
        parts.append(f"at most {_percent(certificate.ratio)} of its limits")
    parts += [
        f"{name} {_percent(w.ratio)}"
        for name, w in certificate.worst.items()
        if name not in ORDERS and w.ratio < np.inf
    ]
    if "jerk" in certificate.worst and certificate.worst["jerk"].kind == "unbounded":
        parts.append("accelerations jump")
    return ", ".join(parts)


def _percent(ratio: float) -> str:
    return "beyond all bounds" if np.isinf(ratio) else f"{100.0 * ratio:.4g} %"


def _orders(law: Law) -> list[tuple[str, int]]:
    """Names and orders of what is drawn."""
    jumps = "jerk" in law.certificate.worst and law.certificate.worst["jerk"].kind == "unbounded"
    return [(name, order) for name, order in ORDERS.items() if not (name == "jerk" and jumps)]


def _joint_panels(law: Law, pieces: LawPieces, share: Array, names: Sequence[str] | None) -> list[Panel]:
    labels = [f"joint {k}" for k in range(law.dof)] if names is None else list(names)
    panels = []
    for name, order in _orders(law):
        values = pieces.at(law.path, law.timing, order, share).reshape(-1, law.dof)
        lower, upper = _limits(law, name)
        worst = law.certificate.worst.get(name)
        panels.append(Panel(name, f"rad{_PER[name]} or m{_PER[name]}", labels, values, lower, upper, worst))
    return panels


def _pose_panels(law: Law, pieces: LawPieces, share: Array) -> list[list[Panel]]:
    origin, turning = [], []
    for name, order in _orders(law):
        values = pieces.at(law.path, law.timing, order, share)
        if order == 0:
            poses = values.reshape(-1, 4, 4)
            origin.append(Panel("position", "m", "xyz", poses[:, :3, 3]))
            turns = continuous_quaternions(np.array([quaternion(pose[:3, :3]) for pose in poses]))
            turning.append(Panel("orientation", "quaternion", "xyzw", turns))
            continue
        six = values.reshape(-1, 6)
        lower, upper = _limits(law, name)
        worst = law.certificate.worst.get(name)
        for first, panels, unit, word in ((0, origin, "m", "linear"), (3, turning, "rad", "angular")):
            part = slice(first, first + 3)
            here = worst if worst is not None and first <= worst.joint < first + 3 else None
            below, above = (None if bound is None else bound[part] for bound in (lower, upper))
            panel = Panel(f"{word} {name}", f"{unit}{_PER[name]}", "xyz", six[:, part], below, above, here, first)
            panels.append(panel)
    return [origin, turning]


def _limits(law: Law, name: str) -> tuple[Array | None, Array | None]:
    if name == "position":
        return law.limits.lower, law.limits.upper
    size = getattr(law.limits, name)
    return (None, None) if size is None else (-size, size)


def _draw(axis: Any, times: Array, panel: Panel) -> None:
    for k, label in enumerate(panel.names):
        axis.plot(times, panel.values[:, k], color=_colour(k), label=label)
    low, high = float(panel.values.min()), float(panel.values.max())
    margin = 0.08 * (high - low) or 0.1 * max(abs(high), 1e-9)
    bottom, top = low - margin, high + margin
    for bounds in (panel.lower, panel.upper):
        if bounds is None:
            continue
        for k in range(len(panel.names)):
            same = bool((bounds == bounds[0]).all())
            if not np.isfinite(bounds[k]) or (same and k > 0):
                continue
            axis.axhline(bounds[k], color=style.INK if same else _colour(k), lw=1.1, ls="--", zorder=1.5)
            extreme = panel.values[:, k].min() if bounds[k] < 0.0 else panel.values[:, k].max()
            if extreme / bounds[k] > NEAR if bounds[k] else True:
                bottom, top = min(bottom, bounds[k] - margin), max(top, bounds[k] + margin)
    axis.set_ylim(bottom, top)
    axis.set_xlim(times[0], times[-1])
    axis.set_title(panel.title)
    axis.set_ylabel(panel.unit)
    if panel.worst is not None:
        _mark(axis, times, panel, panel.worst)


def _mark(axis: Any, times: Array, panel: Panel, worst: Worst) -> None:
    """A ring where the quantity comes nearest to its limit, and words beside the title."""
    k = worst.joint - panel.first
    if worst.ratio < np.inf and panel.upper is not None and panel.lower is not None:
        near = np.flatnonzero(np.abs(times - worst.time) <= 2.0 * times[-1] / len(times))
        values = panel.values[near, k]
        nearest = near[int(np.maximum(values - panel.upper[k], panel.lower[k] - values).argmax())]
        axis.plot(worst.time, panel.values[nearest, k], "o", ms=9, mfc="none", mec=style.INK, mew=1.6, clip_on=False)
    text = f"{_percent(worst.ratio)} of the limit, {panel.names[k]} at {worst.time:.4g} s ({worst.kind})"
    colour = style.RED if worst.ratio > 1.0 + 1e-6 else style.GREY
    axis.set_title(text, loc="right", fontsize=9.5, fontweight="normal", color=colour)


def _legend(axis: Any, panel: Panel) -> None:
    axis.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), fontsize=9, handlelength=1.2)


def _colour(k: int) -> str:
    return style.CYCLE[k % len(style.CYCLE)]
