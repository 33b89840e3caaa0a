"""What drives a body: twists over time, from a file, from texts or from keys."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from wbc import validation
from wbc.archives import open_npz
from wbc.clearance import CylinderInside, EndlessCylinder
from wbc.climb.scene import ClimbScene
from wbc.errors import RangeError, ShapeError
from wbc.multibody import pin
from wbc.track.path_file import csv_rows, rows_of
from wbc.validation import Array

#: Columns of a file that have to be there: time [s] and speeds along the body's axes [m/s]
LINEAR = ("t", "vx", "vy", "vz")
#: Columns that are all there, or none: turn rates about the body's axes [rad/s]
ANGULAR = ("wx", "wy", "wz")
#: "NUMBERS for SECONDS"
_RATES = re.compile(r"\s*([^\s]+)\s+for\s+(\S+)\s*")


class TwistSource(Protocol):
    """Twists over time."""

    def at(self, time: float) -> Array | None:
        """(linear; angular) ``(6)`` at a time since the beginning [m/s, rad/s]; None: it is over."""


@dataclass(frozen=True, eq=False)
class TwistTable:
    """Twists that last until the next one, zero before the first; at the last time it is over.

    Attributes:
        times: rising ``(n)`` [s]. twists: ``(n, 6)`` [m/s, rad/s].

    Raises:
        ShapeError, NotFiniteError: other arrays. RangeError: fewer than two rows, or times that do not rise from 0 on.
    """

    times: Array
    twists: Array

    def __post_init__(self) -> None:
        times = validation.real_array("TwistTable.times", self.times)
        if times.ndim != 1 or len(times) < 2 or times[0] < 0.0 or (np.diff(times) <= 0.0).any():
            raise RangeError("TwistTable.times", times.tolist(), "expected two times or more that rise from 0 on")
        object.__setattr__(self, "times", times)
        twists = validation.real_array("TwistTable.twists", self.twists, (len(times), 6))
        object.__setattr__(self, "twists", twists)

    def at(self, time: float) -> Array | None:
        """As of :class:`TwistSource`."""
        if time >= self.times[-1] - 1e-9:
            return None
        row = int(np.searchsorted(self.times, time + 1e-9, side="right")) - 1
        return np.zeros(6) if row < 0 else np.array(self.twists[row])


def read_twists(path: str | Path) -> TwistTable:
    """A CSV or npz file with t, vx, vy, vz [s, m/s] and, where the body turns, wx, wy, wz [rad/s].

    Raises:
        PathFileError: it cannot be read. UnknownNameError, ShapeError, NotFiniteError, RangeError: what is in it; the
            line is named.
    """
    file = Path(path)
    given = rows_of("rates", file, lambda text: csv_rows(file, text, LINEAR, ANGULAR), _from_npz)
    rows = np.array([validation.real_array(f"{file.name} {label}", row) for label, row in given])
    twists = np.zeros((len(rows), 6))
    twists[:, : rows.shape[1] - 1] = rows[:, 1:]
    return TwistTable(rows[:, 0], twists)


def twist_of(field: str, text: str) -> tuple[Array, float]:
    """A twist and for how long [s], from "VX,VY,VZ,WX,WY,WZ for SECONDS".

    Raises:
        ShapeError: another text.
    """
    parts = _RATES.fullmatch(text)
    try:
        if parts is None:
            raise ValueError
        numbers, seconds = np.array([float(part) for part in parts[1].split(",")]), float(parts[2])
    except ValueError:
        raise ShapeError(field, text, "expected 'VX,VY,VZ,WX,WY,WZ for SECONDS'") from None
    if len(numbers) != 6 or not np.isfinite([*numbers, seconds]).all() or not seconds > 0.0:
        raise ShapeError(field, text, "expected six finite rates and a time above 0 s")
    return numbers, seconds


def twists_of(texts: Sequence[str]) -> TwistTable:
    """Twists one after the other, each as of :func:`twist_of`.

    Raises:
        ShapeError: other texts.
    """
    given = [twist_of("rate", text) for text in texts]
    times = np.cumsum([0.0, *(seconds for _, seconds in given)])
    return TwistTable(times, np.vstack([*(twist for twist, _ in given), np.zeros(6)]))


def round_surface(scene: ClimbScene, pose: pin.SE3, twist: Array) -> Array:
    """A twist of a body, which turns as well as the cylinder that it goes round does under it: with the foot r of its
    origin over the axis and its speed v, by r x v / r^2 more. The same where the scene has no cylinder without end.

    Args:
        pose: of the body in the world. twist: along its axes ``(6)`` [m/s, rad/s].
    """
    nearest, over = np.inf, None
    for body in scene.bodies.values():
        if isinstance(body.shape, (EndlessCylinder, CylinderInside)):
            axis = body.placement.rotation[:, 2]
            away = pose.translation - body.placement.translation
            away = away - (away @ axis) * axis
            height = abs(float(np.linalg.norm(away)) - body.shape.radius)
            if height < nearest and away.any():
                nearest, over = height, (axis, away)
    if over is None:
        return twist
    axis, away = over
    speed = pose.rotation @ twist[:3]
    turn = np.cross(away, speed - (speed @ axis) * axis) / (away @ away)
    return np.concatenate([twist[:3], twist[3:] + pose.rotation.T @ turn])


def _from_npz(file: Path) -> list[tuple[str, Array]]:
    with open_npz(file) as data:
        names = [*LINEAR, *(ANGULAR if set(ANGULAR) & set(data.files) else ())]
        for name in names:
            validation.one_of("rates", name, data.files)
        arrays = [validation.real_array(name, data[name], finite=False) for name in names]
    for name, array in zip(names, arrays, strict=True):
        validation.real_array(name, array, (len(arrays[0]),))
    return [(f"row {k}", row) for k, row in enumerate(np.stack(arrays, axis=1))]
