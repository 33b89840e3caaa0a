"""The published runs: what is known of their trajectories, and the norms that are printed."""

from __future__ import annotations

import csv
import functools
import math
import pathlib
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wbc import validation
from wbc.published.ikor.driver import CourseRun, Driver
from wbc.published.ikor.legacy import QUARTER, legacy_hermies
from wbc.published.ikor.lines import Trajectory, euler_angles, rotation_of, straight
from wbc.published.ikor.machines import ArmMachine, hermies
from wbc.published.ikor.settings import AXES, Settings
from wbc.validation import Array

FILE = pathlib.Path(__file__).with_name("norms.csv")
#: Joints at home [degrees], where the yaw is 180 or -180
HOME = (0, 180, 0, 0, 0, 90, 0)
#: Trajectory -> (steps, joints at the start, at the end [degrees], yaw at home [degrees]). The report prints none: its
#: norms give the joints to a hundredth of a degree, all of them are whole degrees, and nothing else is fitted
BETWEEN = {
    "1": (195, HOME, (39, -126, 0, 0, -28, 90, 196), -180),
    "2": (234, (125, -126, 0, 0, -28, 90, 196), HOME, 180),
    "3": (241, HOME, (0, -136, 0, 34, 63, 109, 47), 180),
}
CONFIGS = ("3x7", "3x10", "6x7", "6x10")


@dataclass(frozen=True, eq=False)
class Printed:
    """Norms of one run that are legible: steps from 1, by FSP and by the pseudo-inverse."""

    steps: Array
    fsp: Array
    pseudo_inverse: Array


@functools.cache
def printed() -> dict[tuple[str, str], Printed]:
    """(trajectory, configuration) -> what is printed; NaN for one of two that is not legible."""
    rows: dict[tuple[str, str], list[tuple[float, ...]]] = {}
    with FILE.open() as stream:
        for row in csv.DictReader(stream):
            numbers = (float(row[name] or "nan") for name in ("step", "fsp", "pseudo_inverse"))
            rows.setdefault((row["trajectory"], row["config"]), []).append(tuple(numbers))
    return {key: Printed(*np.array(found).T) for key, found in rows.items()}


def route(machine: ArmMachine, trajectory: str) -> Trajectory:
    """A published trajectory: a line in equal steps, and equal steps of yaw, pitch and roll of the hand."""
    steps, first, last, home_yaw = BETWEEN[validation.one_of("trajectory", trajectory, BETWEEN)]
    places, angles = [], []
    for degrees in (first, last):
        q = np.concatenate((np.radians(degrees), np.zeros(machine.joints - 7)))
        place, rotation = machine.place(q)
        euler = euler_angles(rotation)
        if degrees is HOME:
            euler[0] = math.radians(home_yaw)
        places.append(place)
        angles.append(euler)
    start = np.concatenate((np.radians(first), np.zeros(machine.joints - 7)))
    way, turn = (ends[1] - ends[0] for ends in (places, angles))
    return straight(machine, way / steps, steps, start, turn / steps)


def case(trajectory: str, config: str, *, legacy: bool = True, spheres: Any = (), **settings: Any) -> CourseRun:
    """A published run again: legacy with the two defects of the printed norms, else with consistent kinematics;
    ``spheres`` and fields of :class:`Settings` beside those of the configuration, as it was not published.

    Raises:
        UnknownNameError: a run that is not known. WbcError: settings that are none.
    """
    validation.one_of("config", config, CONFIGS)
    base = "none" if config.endswith("x7") else "holonomic"
    machine: ArmMachine = legacy_hermies(base)
    path = route(machine, trajectory)
    if not legacy:
        machine = hermies(base)
        assert path.euler is not None
        path = replace(path, euler=np.array([euler_angles(rotation_of(e) @ QUARTER.T) for e in path.euler]))
    return Driver(machine, Settings(rows=AXES[: int(config[0])], euler=legacy, **settings), spheres).run(path)


def differences(run: CourseRun, trajectory: str, config: str) -> Array:
    """ln(measured / printed) at the legible steps."""
    found = printed()[trajectory, config]
    good = np.isfinite(found.fsp)
    return np.asarray(np.log(run.norms[found.steps[good].astype(int) - 1] / found.fsp[good]))
