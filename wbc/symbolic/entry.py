"""A CasADi function as C code calls it: an address, and how much memory it asks for."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from wbc.native.compiled_function import function_library
from wbc.native.library import load_library
from wbc.symbolic.evaluation import SingleState

_NUMBERS = ctypes.POINTER(ctypes.POINTER(ctypes.c_double))
_FUNCTION = ctypes.CFUNCTYPE(ctypes.c_int, _NUMBERS, _NUMBERS, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int)


class CEntry:
    """``int f(const double **arg, double **res, long long *iw, double *w, int mem)`` of a function of CasADi: compiled,
    or without a compiler one that calls CasADi's virtual machine. Results whose address is 0 are left out.

    Attributes:
        address: of f, which lives as long as this. integers, reals: sizes of iw and w.

    Args:
        function: of vectors, with dense outputs.
    """

    def __init__(self, function: ca.Function) -> None:
        self._code: Any
        if (library := function_library(function)) is not None:
            self._code = load_library(library)[function.name()]
            self.integers, self.reals = int(function.sz_iw()), int(function.sz_w())
        else:
            given = function.sx_in()
            joined = ca.Function("joined", given, [ca.vertcat(*map(ca.vec, function.call(given)))])
            sizes = [function.numel_out(k) for k in range(function.n_out())]
            self._code = _FUNCTION(_on_machine(SingleState(joined), sizes))
            self.integers = self.reals = 1
        self.address: int = ctypes.cast(self._code, ctypes.c_void_p).value or 0


def _on_machine(state: SingleState, sizes: list[int]) -> Callable[..., int]:
    parts = np.split(state.output, np.cumsum(sizes)[:-1])

    def call(given: Any, out: Any, _iw: int, _w: int, _memory: int) -> int:
        for k, array in enumerate(state.inputs):
            array[:] = given[k][: len(array)]
        state.run()
        for k, part in enumerate(parts):
            if out[k] and len(part):
                np.ctypeslib.as_array(out[k], part.shape)[:] = part
        return 0

    return call
