"""The eight measured tables, what each method predicts for them, and the calibration that they allow."""

from __future__ import annotations

import csv
import functools
import pathlib
from dataclasses import dataclass

import numpy as np

from wbc import validation
from wbc.published.relative_motion.arms import INCH, hand
from wbc.published.relative_motion.motion import LevelHand, deviation, straight_line
from wbc.validation import Array

FILE = pathlib.Path(__file__).parent / "data" / "tables.csv"
#: Table -> the axis that is driven; 4.1 and 4.2 have the measuring arm, the others the manipulator
AXIS = {"4.1": 0, "4.2": 1, "4.3": 0, "4.4": 1, "4.5": 2, "4.6": 0, "4.7": 1, "4.8": 2}
#: Tables of the second segment begin where one solve for this increment leads [m]
FIRST = np.array([3.0, -2.0, 1.0]) * INCH
#: Columns of a prediction: how the Jacobian is approximated, about the origin
METHODS = {"order 0": 0, "order 1": 1, "exact": None}


@dataclass(frozen=True, eq=False)
class Measured:
    """One table as it is printed: inches, and the tangent of the yaw.

    Attributes:
        commands: along :data:`AXIS`, row 0 is the start [rows]. raw: x, y, z, tangent [rows, 4].
        modified: raw minus row 0 as printed [rows - 1, 4]. Where there is no tangent it is NaN.
    """

    commands: Array
    raw: Array
    modified: Array


@functools.cache
def tables() -> dict[str, Measured]:
    """All of them, misprints included."""
    rows: dict[str, list[list[float]]] = {}
    with FILE.open(newline="") as stream:
        for row in csv.DictReader(stream):
            rows.setdefault(row.pop("table"), []).append([float(x or "nan") for x in row.values()])
    found = {name: np.array(numbers) for name, numbers in rows.items()}
    return {name: Measured(x[:, 0], x[:, 1:5], x[1:, 5:]) for name, x in found.items()}


def commanded(table: str) -> Array:
    """Increments [m] of a table's rows [rows - 1, 3]."""
    axis = AXIS[validation.one_of("table", table, AXIS)]
    return np.outer(tables()[table].commands[1:] * INCH, np.eye(3)[axis])


def start(table: str) -> Array:
    """Joints from which a table of the manipulator begins: all 0, or one published solve from there."""
    validation.one_of("table", table, [name for name in AXIS if name > "4.2"])
    level, home = LevelHand(published=True), np.zeros(6)
    return home if table < "4.6" else straight_line(level, home, FIRST, 0.0)[-1]


@functools.cache
def predicted(table: str, method: str) -> Array:
    """What an arm without backlash does for each command, by one published solve [rows - 1, 3] in inches.

    ``order 0`` and ``order 1`` are latched at the origin; ``exact`` is latched nowhere.

    Raises:
        UnknownNameError: no such table of the manipulator, or method.
    """
    order = METHODS[validation.one_of("method", method, METHODS)]
    level, q = LevelHand(order, published=True), start(table)
    lines = [straight_line(level, q, step, 0.0, latched=np.zeros(6)) for step in commanded(table)]
    return np.array([hand(line[-1])[0] - hand(q)[0] for line in lines]) / INCH


def residuals(table: str, method: str) -> Array:
    """Measured minus predicted [rows - 1, 3] in inches."""
    return np.asarray(tables()[table].modified[:, :3] - predicted(table, method))


def line_errors(table: str, solves: int = 32) -> Array:
    """The exact method along a table's commands: error of the end, farthest from the line [rows - 1, 2] in inches."""
    q, out = start(table), []
    for step in commanded(table):
        end, way = deviation(straight_line(LevelHand(), q, step, 0.0, solves=solves, feedback=True, divisions=2), step)
        out.append((np.abs(end).max(), way))
    return np.array(out) / INCH


def slopes(table: str) -> tuple[Array, Array]:
    """Least-squares line of a table's raw x, y, z over the command: slope [3], residuals [rows, 3]."""
    data = tables()[table]
    design = np.column_stack((np.ones(len(data.commands)), data.commands))
    found = np.linalg.lstsq(design, data.raw[:, :3], rcond=None)[0]
    return found[1], np.asarray(data.raw[:, :3] - design @ found)


def registration() -> Array:
    """C [3, 3] from displacements as the measuring arm sees them to those of the table, by tables 4.1 and 4.2:

        C = [slope_x | slope_y | their unit normal]^-1

    The document calibrates in one pose and knows neither scale nor directions of the axes.
    """
    x, y = slopes("4.1")[0], slopes("4.2")[0]
    normal = np.cross(x, y)
    return np.asarray(np.linalg.inv(np.column_stack((x, y, normal / np.linalg.norm(normal)))))
