"""The compiled subdivision of joint space: boxes in, boxes that are left out."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc.analysis.algebra.trig_form import TrigForm
from wbc.errors import RangeError
from wbc.native.kernel import kernel
from wbc.native.structures import CStructures
from wbc.validation import Array

_SOURCES = Path(__file__).parent / "native"
#: Sizes of native/form.h: rows, columns, joints, waves
_MOST = {"rows": 24, "columns": 16, "joints": 16, "waves": 1024}
#: Boxes that wait inside one call, beyond those given to it
_ROOM = 2000
#: Undecided boxes that are kept
_KEPT = 64


_STRUCTURES = CStructures(_SOURCES / "form.h", _SOURCES / "subdivide.c")
_Form, _Proofs, _Totals = map(_STRUCTURES.structure, ("Form", "Proofs", "Totals"))


@dataclass(frozen=True)
class Counts:
    """What became of boxes: how many, and what part of the whole volume.

    Attributes:
        boxes: looked at. regular: proved to have full rank. tube: proved to be in the tube. undecided: too narrow.
    """

    boxes: float = 0.0
    regular: float = 0.0
    tube: float = 0.0
    undecided: float = 0.0
    regular_part: float = 0.0
    tube_part: float = 0.0
    undecided_part: float = 0.0

    def __add__(self, other: Counts) -> Counts:
        return Counts(*(getattr(self, f.name) + getattr(other, f.name) for f in fields(self)))


class BoxSearch:
    """Subdivision with two tests: full column rank of M, or sigma_min(J) < eps, on a whole box.

    A box is a row: centre, half widths, and 1 where it is known to be outside the tube.

    Args:
        proofs: alternatives that prove full rank of M: forms that must all have it, such as (M,).
            task: J, or None with ``eps`` = 0. smallest: width at which a box is left [rad]. volume: of all.

    Raises:
        RangeError: a matrix larger than the compiled code allows. CompileError: no C compiler, or it fails.
    """

    def __init__(
        self, proofs: Sequence[Sequence[TrigForm]], task: TrigForm | None, eps: float, smallest: float, volume: float
    ) -> None:
        forms = [form for proof in proofs for form in proof]
        self.joints = forms[0].waves.shape[1]
        self._keep: list[NDArray[Any]] = [np.cumsum([len(proof) for proof in proofs]).astype(np.int32)]
        self._forms = (_Form * len(forms))(*map(self._form, forms))
        self._proofs = _Proofs(len(proofs), self._keep[0].ctypes.data, ctypes.addressof(self._forms))
        self._task = self._form(task if task is not None else forms[0])
        self._numbers = eps if task is not None else 0.0, smallest, volume
        self._run = _library().subdivide

    def run(self, boxes: Array, budget: int) -> tuple[Counts, Array, Array]:
        """(counts, boxes that are left, some undecided ones) after at most ``budget`` boxes. Can run in threads."""
        width = 2 * self.joints + 1
        stack = np.empty((len(boxes) + _ROOM, width))
        stack[: len(boxes)] = boxes
        kept, totals = np.empty((_KEPT, width)), _Totals(pending=len(boxes))
        eps, smallest, volume = self._numbers
        self._run(
            ctypes.byref(self._proofs),
            ctypes.byref(self._task),
            ctypes.c_double(eps),
            ctypes.c_double(smallest),
            ctypes.c_double(volume),
            ctypes.c_long(budget),
            ctypes.c_void_p(stack.ctypes.data),
            ctypes.c_long(len(stack)),
            ctypes.c_void_p(kept.ctypes.data),
            ctypes.c_long(_KEPT),
            ctypes.byref(totals),
        )
        counts = Counts(*(getattr(totals, f.name) for f in fields(Counts)))
        return counts, stack[: totals.pending].copy(), kept[: totals.kept].copy()

    def _form(self, form: TrigForm) -> Any:
        sizes = dict(zip(_MOST, (*form.shape, form.waves.shape[1], len(form.waves)), strict=True))
        for name, most in _MOST.items():
            if sizes[name] > most:
                raise RangeError(name, sizes[name], f"subdivision takes at most {most}")
        entries, waves = np.nonzero(np.abs(form.cosine) + np.abs(form.sine))
        start = np.searchsorted(entries, np.arange(form.cosine.shape[0] + 1))
        arrays: list[NDArray[Any]] = [
            np.ascontiguousarray(form.waves),
            start.astype(np.int32),
            waves.astype(np.int32),
            form.cosine[entries, waves],
            form.sine[entries, waves],
        ]
        self._keep += arrays
        pointers = [array.ctypes.data for array in arrays]
        return _Form(*form.shape, form.waves.shape[1], len(form.waves), len(entries), *pointers)


@functools.cache
def _library() -> ctypes.CDLL:
    """The compiled code, from the cache."""
    library = ctypes.CDLL(str(kernel(_SOURCES / "subdivide.c")))
    library.subdivide.restype = ctypes.c_int
    return library
