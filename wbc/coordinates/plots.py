"""Pictures of drives: how well each pair was conditioned, what the joints did, what the command lost."""

from __future__ import annotations

import os
import pathlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from wbc import validation
from wbc.errors import RobotFileError, ShapeError
from wbc.style import pyplot
from wbc.validation import Array


@dataclass
class DriveLog:
    """What happened tick by tick.

    Attributes:
        time [s]. q, v: configurations and joint rates. sigma: least singular values of the pairs, in the order of
            ``names``. miss: how far the task's speed was from its command [m/s]. active: the pair in use.
    """

    names: tuple[str, ...] = ()
    time: list[float] = field(default_factory=list)
    q: list[Array] = field(default_factory=list)
    v: list[Array] = field(default_factory=list)
    sigma: list[Array] = field(default_factory=list)
    miss: list[float] = field(default_factory=list)
    active: list[str] = field(default_factory=list)

    def add(self, time: float, q: Array, v: Array, sigma: Array, miss: float, active: str) -> None:
        """One tick."""
        self.time.append(time)
        self.q.append(np.array(q))
        self.v.append(np.array(v))
        self.sigma.append(np.array(sigma))
        self.miss.append(miss)
        self.active.append(active)


def plot_drives(
    path: str | os.PathLike[str], drives: Mapping[str, DriveLog], joint: int, limits: Sequence[float] = ()
) -> pathlib.Path:
    """Four rows of curves over time, a colour a drive: the joint that matters [rad], sigma of the pair in use, the
    fastest joint [rad/s], and what the command lost [m/s]. Returns the file.

    Args:
        joint: index into q of the first row. limits: values of it that are drawn across.

    Raises:
        ShapeError: no drive, or one without ticks. RobotFileError: the file cannot be written.
    """
    drives = validation.mapping("drives", drives, "names to DriveLogs")
    for name, log in drives.items():
        validation.instance(f"drives[{name}]", log, DriveLog, "a DriveLog")
    if not drives or not all(log.time for log in drives.values()):
        raise ShapeError("drives", list(drives), "expected logs with ticks")
    count = min(len(q) for log in drives.values() for q in log.q)
    joint = validation.integer("joint", joint, high=count - 1)
    marks = validation.ordinary_array("limits", limits)
    if marks.ndim != 1:
        raise ShapeError("limits", limits, "expected a row of numbers")
    file = validation.file_path("path", path)
    with pyplot() as plt:
        figure, axes = plt.subplots(4, 1, figsize=(8.5, 9.5), sharex=True, layout="constrained")
        for name, log in drives.items():
            used = [float(s[log.names.index(a)]) for s, a in zip(log.sigma, log.active, strict=True)]
            curves = ([float(q[joint]) for q in log.q], used, [float(np.abs(v).max()) for v in log.v], log.miss)
            for axis, curve in zip(axes, curves, strict=True):
                (line,) = axis.plot(log.time, curve, label=name)
            for k in range(1, len(log.active)):
                if log.active[k] != log.active[k - 1]:
                    axes[1].axvline(log.time[k], color=line.get_color(), linewidth=0.9, linestyle=":")
                    axes[1].annotate(f" {log.active[k]}", (log.time[k], 0.9), xycoords=("data", "axes fraction"))
        for value in marks.tolist():
            axes[0].axhline(value, color="#c0392b", linewidth=0.9, linestyle="--")
        titles = (
            f"joint {joint + 1} [rad]",
            "least singular value of the pair in use",
            "fastest joint [rad/s]",
            "speed of the tip that the command lost [m/s]",
        )
        for axis, title in zip(axes, titles, strict=True):
            axis.set_title(title)
        axes[0].legend()
        axes[-1].set_xlabel("time [s]")
        with validation.writing("path", file, RobotFileError, ValueError):
            file.parent.mkdir(parents=True, exist_ok=True)
            figure.savefig(file)
        plt.close(figure)
    return file
