"""What native code needs to read numpy's arrays, and to make some of memory that is there, without numpy's checks."""

from __future__ import annotations

import ctypes
import importlib

import numpy as np

#: Places in numpy's table of functions, which keeps its order: PyArray_NewFromDescr
_NEW_FROM_DESCR = 94
#: PyArray_SetBaseObject
_SET_BASE_OBJECT = 282

_pointer = ctypes.pythonapi.PyCapsule_GetPointer
_pointer.restype, _pointer.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
_table = ctypes.cast(
    _pointer(importlib.import_module("numpy._core._multiarray_umath")._ARRAY_API, None), ctypes.POINTER(ctypes.c_void_p)
)
_FLOAT = np.dtype(np.float64)

#: Addresses that a ``wbc_part`` of ``native/builtins.h`` begins with; the objects live as long as numpy
ARRAY_MAKERS = (_table[_NEW_FROM_DESCR] or 0, _table[_SET_BASE_OBJECT] or 0, id(np.ndarray), id(_FLOAT))


def _as_known() -> bool:
    """Whether arrays begin in memory as ``wbc_array`` of ``native/builtins.h`` says."""
    array, numbers = np.zeros((2, 3)), ctypes.POINTER(ctypes.c_size_t)
    words = ctypes.cast(id(array), numbers)
    known = id(np.ndarray), array.ctypes.data, array.ndim
    if (words[1], words[2], words[3] & 0xFFFFFFFF) != known or words[7] != id(_FLOAT):
        return False
    return words[8] & 0xFFFFFFFF == array.flags.num and ctypes.cast(words[4], numbers)[:2] == [2, 3]


#: Types of arrays and of doubles, for code that reads arrays without asking numpy; zeros where it has to ask
PLAIN_ARRAYS = (id(np.ndarray), id(_FLOAT)) if _as_known() else (0, 0)
