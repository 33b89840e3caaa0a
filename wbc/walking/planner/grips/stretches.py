"""Where an arm can have its hand on holds that it may roll on, by compiled code."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Margins, WalkerData
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

    None where there is no compiler, the limb has no closed form, or the roll of one of the holds is not free.

    Args:
        there: what stands around. blocked: what the body meets at the frames ``[n]``, see :class:`Around`.
        shortest: samples of a stretch at least.
    """
    structure, world = there.structure, there.world
    library, data = _for(there, among)
    if library is None or data is None:
        return None
    count = len(frames)
    most = [margins.held_rate * spacing * rate for rate in data.joint_rates[:5]]
    leans = margins.lean_from * margins.held_reach
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
        _keeping(margins.held_reach, margins.held_angle, most, margins.facing, shortest, leans),
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


def postures_at(
    there: Around, arm: int, frames: Array, among: NDArray[np.int64], margins: Margins
) -> NDArray[np.int32] | None:
    """Postures of an arm (its row) on some holds (their rows) from frames of its base ``[n, 4, 4]``, in a cell of a
    detour: row of the frame, of the hold, and branch ``[k, 3]``.

    None as of :func:`stretches`, and where nothing stands around.
    """
    structure, world = there.structure, there.world
    library, data = _for(there, among)
    if library is None or data is None or world is None:
        return None
    table = np.empty((2 * len(frames) * len(among), 3), dtype=np.int32)
    given = [compiled.packed(a) for a in (frames, structure.positions[among], structure.axes[among])]
    where, holds = [compiled.at(a) for a in given], np.ascontiguousarray(among, dtype=np.int64)
    library.grips_at.restype = ctypes.c_long
    found = library.grips_at(
        ctypes.byref(compiled.arm(data)),
        _keeping(margins.cell_reach, margins.cell_angle, [np.inf] * 5, margins.facing, 1, 0.0),
        ctypes.c_double(margins.landing_wrist),
        world.pointer,
        ctypes.c_long(arm),
        ctypes.c_long(len(frames)),
        where[0],
        ctypes.c_long(len(among)),
        *where[1:],
        *(compiled.at(a) for a in (holds, table)),
    )
    out = table[:found]
    out[:, 1] = among[out[:, 1]]
    return out


def _for(there: Around, among: NDArray[np.int64]) -> tuple[ctypes.PyDLL | None, WalkerData | None]:
    """The compiled code and the arm's numbers; None where some holds do not let a hand roll."""
    if not all(there.structure.free_rolls[hold] for hold in among.tolist()):
        return None, None
    return compiled.library(), there.limb.closed_form


def _keeping(
    reach: float, angle: float, most: Sequence[float], facing: float, shortest: int, lean_for: float
) -> compiled.Numbers:
    """Keeping of native/grips.h."""
    numbers = (reach, angle, *most, facing, shortest, lean_for)
    return compiled.doubles([*numbers, TILT_PART, LEAST_TILT, ROUNDING, ALIGNED])
