"""Where an arm can have its hand on holds that it may roll on, by compiled code."""

from __future__ import annotations

import ctypes

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Margins
from wbc.validation import Array
from wbc.walking.arms.angles import ALIGNED
from wbc.walking.arms.puma import ROUNDING
from wbc.walking.native import compiled
from wbc.walking.planner.around import Around
from wbc.walking.planner.grips.tilt import LEAST_TILT, TILT_PART

#: hold, branch, first and last sample, reason of the end, postures
Stretch = tuple[int, int, int, int, int, Array]


def stretches(
    there: Around,
    arm: int,
    frames: Array,
    blocked: NDArray[np.int64],
    among: NDArray[np.int64],
    spacing: float,
    margins: Margins,
    shortest: int,
) -> list[Stretch] | None:
    """Stretches of an arm (its row), whose base has the frames ``[n, 4, 4]``, on some holds (their rows).

    None where there is no compiler, the limb has no closed form, or the roll of a hold is not free.

    Args:
        there: what stands around. blocked: what the body meets at the frames ``[n]``, see :class:`Around`.
        shortest: samples of a stretch at least.
    """
    structure, limb, world = there.structure, there.limb, there.world
    library, data = compiled.library(), limb.closed_form
    if library is None or data is None or not all(structure.free_rolls[hold] for hold in among.tolist()):
        return None
    count = len(frames)
    most = [margins.held_rate * spacing * rate for rate in data.joint_rates[:5]]
    numbers = [margins.held_reach, margins.held_angle, *most, margins.facing, shortest]
    numbers.append(margins.lean_from * margins.held_reach)
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
    table = np.empty((2 * count * len(among) // shortest + 1, 6), dtype=np.int64)
    rows = np.empty((2 * count * len(among), 6))
    where = [compiled.at(a) for a in given]
    whole = [np.ascontiguousarray(a, dtype=np.int64) for a in (among, blocked)]
    library.grips_along.restype = ctypes.c_long
    found = library.grips_along(
        ctypes.byref(compiled.arm(data)),
        compiled.doubles([*numbers, TILT_PART, LEAST_TILT, ROUNDING, ALIGNED]),
        None if world is None else world.pointer,
        ctypes.c_long(arm),
        ctypes.c_long(count),
        where[0],
        ctypes.c_long(len(among)),
        *where[1:4],
        *(compiled.at(a) for a in whole),
        where[4],
        *(compiled.at(a) for a in (table, rows)),
    )
    return [
        (int(among[hold]), branch, first, last, reason, rows[row : row + last - first + 1].copy())
        for hold, branch, first, last, reason, row in table[:found].tolist()
    ]
