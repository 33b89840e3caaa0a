"""The compiled inner loops of the planner; where there is no compiler, or another kind of limb, numpy does the same.

They know the PUMA's closed form a second time, which the tests compare. What that buys, in processor time of the demo's
plan: 0.17 s instead of 0.81 s; its grips 25 instead of 55 ms, conflicts of 1300 pairs of grips 5 instead of 10 ms, a
swing 0.04 instead of 0.17 ms, and all curves of a dozen swings in one call.
"""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc.errors import CompileError
from wbc.geometry import HEADERS
from wbc.native import toolchain
from wbc.native.kernel import kernel
from wbc.robots import BodyLimb, WalkerData

_SOURCES = Path(__file__).parent


class ArmNumbers(ctypes.Structure):
    """Arm of native/arm.h."""

    _fields_ = [
        *((name, ctypes.c_double) for name in ("neck", "offset", "upper", "fore", "hand")),
        *((name, ctypes.c_double * 6) for name in ("limits", "rates", "accelerations")),
        *((name, ctypes.c_double) for name in ("elbow", "shoulder")),
    ]


class Table(ctypes.Structure):
    """Grips of native/tracks.h."""

    _fields_ = [(name, ctypes.c_void_p) for name in ("postures", "offset", "first", "last")]


@functools.cache
def arm(data: WalkerData) -> ArmNumbers:
    """An arm's numbers as the compiled code wants them."""
    lengths = data.neck_length, data.shoulder_offset, data.upper_arm_length, data.forearm_length, data.hand_length
    sixes = ((ctypes.c_double * 6)(*v) for v in (data.position_limits, data.joint_rates, data.joint_accelerations))
    return ArmNumbers(*lengths, *sixes, data.elbow_limit, data.shoulder_limit)


#: Numbers in a row
Numbers = ctypes.Array[ctypes.c_double]


def doubles(numbers: Sequence[float]) -> Numbers:
    """Numbers in a row, as the compiled code wants them."""
    return (ctypes.c_double * len(numbers))(*numbers)


def at(array: NDArray[Any]) -> ctypes.c_void_p:
    """Where the numbers of an array lie; it must be contiguous and outlive the call."""
    assert array.flags.c_contiguous
    # Half as long as array.ctypes.data
    return ctypes.c_void_p(array.__array_interface__["data"][0])


def packed(array: Any) -> NDArray[np.float64]:
    """An array of doubles, row by row in memory."""
    return np.ascontiguousarray(array, dtype=np.float64)


@functools.cache
def library() -> ctypes.PyDLL | None:
    """The compiled code; None where it was not compiled ahead and cannot be now, which the log says."""
    try:
        path = kernel(_SOURCES / "planner.c", HEADERS)
    except CompileError as error:
        toolchain.fall_back(toolchain.reason(error))
        return None
    # Not CDLL: a call takes microseconds, giving up the interpreter's lock would cost as much
    return ctypes.PyDLL(str(path))


def library_for(limb: BodyLimb) -> ctypes.PyDLL | None:
    """The compiled code; None also for a limb that it does not know."""
    return None if limb.closed_form is None else library()


def arm_of(limb: BodyLimb) -> Any:
    """Pointer to the numbers of a limb that the compiled code knows."""
    assert limb.closed_form is not None
    return ctypes.byref(arm(limb.closed_form))
