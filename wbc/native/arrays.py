"""Numpy's functions that make arrays of memory that is there, for native code; faster than ``frombuffer``."""

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
