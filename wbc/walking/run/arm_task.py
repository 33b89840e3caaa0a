"""What one hand is to do in arm mode, as a user types it:

hold ID                                  go to a hold and close
poses FILE                               through poses, a table with columns x, y, z, ax, ay, az, rx, ry, rz
rate vx,vy,vz,wx,wy,wz for SECONDS       a twist in the structure's axes [m/s, rad/s]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import pinocchio as pin

from wbc.errors import ShapeError
from wbc.walking.holds.hold import frame_of
from wbc.walking.modes.commands import read_numbers

Kind = Literal["hold", "poses", "rate"]
#: Columns of a file of poses: origin [m], z axis, and a direction whose part across it is the x axis
COLUMNS = ("x", "y", "z", "ax", "ay", "az", "rx", "ry", "rz")


@dataclass(frozen=True)
class ArmTask:
    """What a hand is to do.

    Attributes:
        kind: to a hold, through poses, or by a twist for a time. text: as it was asked for.
        hold: its id. poses: positions [m] and quaternions x, y, z, w. twist: [m/s, rad/s]. seconds: [s].
    """

    kind: Kind
    text: str
    hold: str = ""
    poses: tuple[tuple[float, ...], ...] = ()
    twist: tuple[float, ...] = ()
    seconds: float = 0.0


def arm_task(text: str) -> ArmTask:
    """A task from what a user types; whether there is such a hold is not asked here.

    Raises:
        ShapeError: it is none. NumberTableError, RangeError: a file of poses.
    """
    kind, _, rest = text.strip().partition(" ")
    rest = rest.strip()
    if kind == "hold" and rest:
        return ArmTask("hold", text, hold=rest)
    if kind == "poses" and rest:
        rows = read_numbers(rest, COLUMNS)
        poses = (frame_of(f"row {k + 1}", row[:3], row[3:6], row[6:]) for k, row in enumerate(rows))
        return ArmTask("poses", text, poses=tuple(tuple(pin.SE3ToXYZQUAT(pose).tolist()) for pose in poses))
    if kind == "rate":
        numbers, _, seconds = rest.partition(" for ")
        try:
            twist, duration = tuple(float(part) for part in numbers.split(",")), float(seconds)
        except ValueError as error:
            raise ShapeError("do", text, "expected 'rate vx,vy,vz,wx,wy,wz for SECONDS'") from error
        if len(twist) != 6 or not np.isfinite([*twist, duration]).all() or duration <= 0.0:
            raise ShapeError("do", text, "expected six rates and a time above 0")
        return ArmTask("rate", text, twist=twist, seconds=duration)
    raise ShapeError("do", text, "expected 'hold ID', 'poses FILE' or 'rate vx,vy,vz,wx,wy,wz for SECONDS'")
