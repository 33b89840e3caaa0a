"""The least singular value of a small matrix, in C where there is a compiler."""

from __future__ import annotations

import ctypes
import functools
from pathlib import Path

import numpy as np

from wbc.errors import CompileError
from wbc.native import toolchain
from wbc.native.kernel import kernel
from wbc.native.library import load_library
from wbc.validation import Array

_SOURCES = Path(__file__).parent / "native"


class LeastSingular:
    """sigma_min(M) of one matrix after another, by one-sided Jacobi rotations, or by numpy without a compiler.

    Args:
        native: False: numpy in any case.

    Attributes:
        compiled: in C.
    """

    def __init__(self, *, native: bool = True) -> None:
        self._call = _compiled() if native else None
        self.compiled = self._call is not None

    def __call__(self, matrix: Array) -> float:
        """The least of the min(rows, columns) singular values."""
        if self._call is None:
            return float(np.linalg.svd(matrix, compute_uv=False)[-1])
        M = np.ascontiguousarray(matrix)
        found: float = self._call(M.ctypes.data, M.shape[0], M.shape[1], None, None)
        return found


@functools.cache
def _compiled() -> ctypes._NamedFuncPointer | None:
    try:
        function = load_library(kernel(_SOURCES / "singular.c")).least_singular
    except CompileError as error:
        toolchain.fall_back(toolchain.reason(error))
        return None
    function.restype = ctypes.c_double
    function.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p]
    return function
