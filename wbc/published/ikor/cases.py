"""The published runs: what is known of their trajectories, and the norms that are printed."""

from __future__ import annotations

import csv
import functools
import pathlib
from dataclasses import dataclass, replace

import numpy as np

from wbc import validation
from wbc.published.ikor.driver import AXES, Driver, Method, Run, Settings, euler_angles, rotation_of, straight
from wbc.published.ikor.legacy import QUARTER, legacy_hermies
from wbc.published.ikor.machines import Machine, hermies
from wbc.validation import Array

FILE = pathlib.Path(__file__).with_name("norms.csv")
#: Trajectory -> (steps, metres a step). The report prints neither: three numbers fitted to the norms of each, from home
KNOWN = {
    "1": (195, (0.00109315, -0.00329651, -0.00428364)),
    "3": (241, (0.00251716, 0.00050234, -0.00371982)),
}
#: Turn of yaw, pitch and roll a step [rad]: three numbers fitted to 6x7 of each; 6x10 has none of its own
TURNS = {"1": (0.00349193, 0.00232499, 0.01754320), "3": (-0.01130479, 0.00264447, 0.01750863)}
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


def case(trajectory: str, config: str, *, legacy: bool = True, method: Method = Method.FSP) -> Run:
    """A published run again: legacy with the two defects of the printed norms, else with consistent kinematics.

    Raises:
        UnknownNameError: a run that is not known.
    """
    steps, step = KNOWN[validation.one_of("trajectory", trajectory, KNOWN)]
    base = "none" if validation.one_of("config", config, CONFIGS).endswith("x7") else "holonomic"
    machine: Machine = legacy_hermies(base)
    path = straight(machine, step, steps, turn=TURNS[trajectory])
    if not legacy:
        machine = hermies(base)
        assert path.euler is not None
        path = replace(path, euler=np.array([euler_angles(rotation_of(e) @ QUARTER.T) for e in path.euler]))
    return Driver(machine, Settings(method, AXES[: int(config[0])], euler=legacy)).run(path)


def differences(run: Run, trajectory: str, config: str) -> Array:
    """ln(measured / printed) at the legible steps."""
    found = printed()[trajectory, config]
    good = np.isfinite(found.fsp)
    return np.asarray(np.log(run.norms[found.steps[good].astype(int) - 1] / found.fsp[good]))
