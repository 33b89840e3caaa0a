"""Figures of the parts of the system: the arm that measures, a hand that holds on a table that sways, master and slave.

Lengths that are shown are inches, angles degrees, as in the document.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from wbc import style, validation
from wbc.published.relative_motion import printed as known
from wbc.published.relative_motion.arms import INCH, measured, published_measured
from wbc.published.relative_motion.motion import hold_on_table
from wbc.published.relative_motion.printed import registration, slopes, tables
from wbc.published.relative_motion.recursion import MasterSlave
from wbc.validation import Array

#: A row of a table that is printed, by column
Row = dict[str, float | str]
#: Gimbal, elbow and gripper (q1, q2, q4, q6) [degrees] of which readings are shown where nobody gives any
READINGS = ((10.0, 5.0, -20.0, 0.0), (30.0, 0.0, -60.0, 20.0), (40.0, -25.0, -20.0, 0.0), (-20.0, 15.0, -45.0, 10.0))
#: What is added of the table, and whether hold_on_table compensates and feeds forward
ADDED = {"nothing": (False, False), "pose": (True, False), "pose and twist": (True, True)}
#: Where the operator keeps the hand on the table [m, rad]
KEPT = np.array([0.5, -0.4, 0.3, 0.0]) * INCH
#: How far apart master and slave begin [m]
APART = 2.0 * INCH
#: Cycles in which master and slave meet
CYCLES = 400


def swaying(t: float) -> tuple[Array, Array]:
    """The table's place (x, y, z, alpha) and its rates: 2 in at 0.1 Hz along x and 5 degrees of yaw at 0.05 Hz."""
    w, v, turn = 0.2 * math.pi, 0.1 * math.pi, math.radians(5.0)
    place = np.array([2.0 * INCH * math.sin(w * t), 19.39 * INCH, -40.0 * INCH, turn * math.sin(v * t)])
    return place, np.array([2.0 * INCH * w * math.cos(w * t), 0.0, 0.0, turn * v * math.cos(v * t)])


def measuring(readings: Sequence[Sequence[float]] = READINGS) -> list[Row]:
    """What the measuring arm says of the table at some angles, by its geometry and by the published program.

    Args:
        readings: q1, q2, q4, q6 [readings, 4] in degrees.

    Raises:
        ShapeError, NotFiniteError, RangeError: bad input; angles at which the first link has no azimuth.
    """
    rows: list[Row] = []
    for degrees in validation.ordinary_array("angles", readings, (len(readings), 4)):
        place, published = (read(np.radians(degrees)) for read in (measured, published_measured))
        off = float(np.linalg.norm(published[:3] - place[:3])) / INCH
        shown = dict(zip(("x", "y", "z"), (place[:3] / INCH).tolist(), strict=True))
        turned = math.remainder(published[3] - place[3], 2.0 * math.pi)
        own = {"yaw": math.degrees(place[3]), "published off": off, "yaw off": math.degrees(turned)}
        rows.append({"q1, q2, q4, q6": ", ".join(f"{x:g}" for x in degrees), **shown, **own})
    return rows


def lines_of(names: Sequence[str], solves: int = 32) -> list[Row]:
    """Largest errors of each line of some tables."""
    rows: list[Row] = []
    for name in names:
        command = known.commanded(name) / INCH
        errors = {"measured": known.tables()[name].modified[:, :3] - command}
        errors |= {method: known.predicted(name, method) - command for method in known.METHODS}
        lines = known.line_errors(name, solves)
        for k, size in enumerate(known.tables()[name].commands[1:]):
            worst = {key: float(np.abs(off[k]).max()) for key, off in errors.items()}
            ends: Row = {"line end": float(lines[k, 0]), "line": float(lines[k, 1])}
            rows.append({"table": name, "command": float(size), **worst, **ends})
    return rows


def registering() -> list[Row]:
    """Largest errors of the arm's readings of tables 4.1 and 4.2: as they are, and with what both say of its axes."""
    rows: list[Row] = []
    for axis, name in enumerate(("4.1", "4.2")):
        data, matrix = tables()[name], registration()
        steps = data.commands - data.commands[0]
        moved = data.raw[:, :3] - data.raw[0, :3]
        wanted = np.outer(steps, np.eye(3)[axis])
        registered = moved @ matrix.T
        errors = (float(np.abs(x - wanted).max()) for x in (moved, registered))
        along = float(np.linalg.norm(slopes(name)[0]))
        rows.append({"table": name, "read of an inch": along, **dict(zip(("raw", "registered"), errors, strict=True))})
    return rows


def holding(seconds: float = 20.0, period: float = 0.05) -> list[Row]:
    """Largest errors of a hand on the table that sways, by what is added of the table.

    Raises:
        RangeError: times that are not positive. InfeasibleError: a period in which the hand falls too far behind.
    """
    for name, value in (("seconds", seconds), ("period", period)):
        validation.scalar(name, value, low=0.0, open_low=True, unit="s")
    rows: list[Row] = []
    for name, (compensated, feedforward) in ADDED.items():
        held = hold_on_table(
            np.zeros(6), swaying, lambda t: KEPT, seconds, period, compensated=compensated, feedforward=feedforward
        )
        off = held.relative - held.commanded
        place, yaw = np.linalg.norm(off[:, :3], axis=1).max() / INCH, math.degrees(np.abs(off[:, 3]).max())
        rows.append({"of the table is added": name, "position": float(place), "yaw": yaw})
    return rows


def coupled(arms: MasterSlave, backlash: float, period: float = 0.05) -> list[Row]:
    """How far apart master and slave are, which begin 2 in apart, over tables at rest and swaying, in inches.

    Args:
        backlash: of both arms [in].

    Raises:
        RangeError: a negative backlash, or a period that is not positive.
    """
    validation.scalar("period", period, low=0.0, open_low=True, unit="s")
    rest = np.zeros((CYCLES, 1))
    sway = np.array([swaying(k * period)[0][:1] for k in range(1, CYCLES + 1)]) / INCH
    rows: list[Row] = []
    for table, moved in (("at rest", rest), ("swaying", sway)):
        for play in dict.fromkeys((0.0, float(backlash))):
            master, slave = arms.run(np.array([APART / INCH]), np.zeros(1), moved, play)
            apart = np.abs(master[1:] - (slave[1:] - moved))[:, 0]
            late = float(apart[CYCLES // 2 :].max())
            rows.append(
                {
                    "table": table,
                    "backlash": play,
                    "apart, late": late,
                    "at the end": float(apart[-1]),
                    "b / (2 A)": play / (2.0 * arms.A),
                }
            )
    return rows


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
