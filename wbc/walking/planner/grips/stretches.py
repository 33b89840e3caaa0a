"""Where an arm can have its hand on holds that it may roll on, by compiled code."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wbc.validation import Array
from wbc.walking.arms.angles import ALIGNED
from wbc.walking.arms.puma import ROUNDING, ArmKinematics
from wbc.walking.holds.structure import Structure
from wbc.walking.native import compiled
from wbc.walking.planner.grips.tilt import LEAST_TILT, TILT_PART

#: hold, branch, first and last sample, reason of the end, postures
Stretch = tuple[int, int, int, int, int, Array]


@dataclass(frozen=True)
class Keeping:
    """What is kept of limits: part of rates, angle [rad], reach [m], cosine between approach and body, samples of a
    stretch, and the reach that hands lean for [m].
    """

    rate_part: float
    angle_room: float
    reach_room: float
    facing: float
    shortest: int
    lean_for: float


def stretches(
    kinematics: ArmKinematics,
    frames: Array,
    structure: Structure,
    among: NDArray[np.int64],
    spacing: float,
    keep: Keeping,
) -> list[Stretch] | None:
    """Stretches of an arm, whose base has the frames ``[n, 4, 4]``, on some holds (their rows).

    None where there is no compiler, or the roll of a hold is not free.
    """
    library = compiled.library()
    if library is None or not all(structure.free_rolls[hold] for hold in among.tolist()):
        return None
    count, data = len(frames), kinematics.data
    most = [keep.rate_part * spacing * rate for rate in data.joint_rates[:5]]
    numbers = [keep.reach_room, keep.angle_room, *most, keep.facing, keep.shortest, keep.lean_for]
    given = [
        compiled.packed(a)
        for a in (
            frames,
            structure.positions[among],
            structure.axes[among],
            structure.tilts[among],
            np.empty(12 * count),
        )
    ]
    table = np.empty((2 * count * len(among) // keep.shortest + 1, 6), dtype=np.int64)
    rows = np.empty((2 * count * len(among), 6))
    where = [compiled.at(a) for a in (*given, table, rows)]
    library.grips_along.restype = ctypes.c_long
    found = library.grips_along(
        ctypes.byref(compiled.arm(data)),
        compiled.doubles([*numbers, TILT_PART, LEAST_TILT, ROUNDING, ALIGNED]),
        ctypes.c_long(count),
        where[0],
        ctypes.c_long(len(among)),
        *where[1:],
    )
    return [
        (int(among[hold]), branch, first, last, reason, rows[row : row + last - first + 1].copy())
        for hold, branch, first, last, reason, row in table[:found].tolist()
    ]
