"""Compiled functions as built-in functions of Python: a call costs a third of what ctypes takes."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from typing import Any

#: ``METH_NOARGS``, ``METH_O`` and ``METH_FASTCALL``
_NO_ARGUMENTS = 4
#: See _NO_ARGUMENTS
_ONE_ARGUMENT = 8
#: See _NO_ARGUMENTS
_ARGUMENTS = 0x80
#: ``METH_KEYWORDS`` besides
_NAMED_ARGUMENTS = 0x82


class _MethodDef(ctypes.Structure):
    """``PyMethodDef``."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("function", ctypes.c_void_p),
        ("flags", ctypes.c_int),
        ("text", ctypes.c_char_p),
    )


_make = ctypes.pythonapi.PyCFunction_NewEx
_make.restype, _make.argtypes = ctypes.py_object, [ctypes.POINTER(_MethodDef), ctypes.py_object, ctypes.c_void_p]
#: Python keeps the addresses of these
_methods: dict[int, _MethodDef] = {}


def builtin(function: Any, argument: int) -> Callable[[], Any]:
    """A function of no arguments which calls ``PyObject *function(PyObject *argument, PyObject *)`` and holds the lock.

    Args:
        function: of a loaded library that is never unloaded.
    """
    made: Callable[[], Any] = _made(function, argument, _NO_ARGUMENTS)
    return made


def builtin_of_one(function: Any, argument: int) -> Callable[[Any], Any]:
    """The same, of one argument: ``PyObject *function(PyObject *argument, PyObject *)``."""
    made: Callable[[Any], Any] = _made(function, argument, _ONE_ARGUMENT)
    return made


def builtin_of_some(function: Any, argument: int) -> Callable[..., Any]:
    """The same, of any arguments: ``PyObject *function(PyObject *argument, PyObject *const *, Py_ssize_t count)``."""
    made: Callable[..., Any] = _made(function, argument, _ARGUMENTS)
    return made


def builtin_like(method: Any, signature: str, function: Any, argument: object) -> Callable[..., Any]:
    """The same in place of a method, with its name and text; arguments may have names:
    ``PyObject *function(PyObject *argument, PyObject *const *, Py_ssize_t count, PyObject *names)``. It keeps
    ``argument``.
    """
    text = f"{method.__name__}($self, {signature})\n--\n\n{method.__doc__}"
    made: Callable[..., Any] = _made(function, argument, _NAMED_ARGUMENTS, method.__name__, text)
    return made


def _made(function: Any, argument: object, flags: int, name: str = "call", text: str = "") -> Any:
    address = ctypes.cast(function, ctypes.c_void_p).value or 0
    method = _methods.get(address)
    if method is None:
        method = _methods.setdefault(address, _MethodDef(name.encode(), address, flags, text.encode() or None))
    return _make(ctypes.byref(method), argument, None)


def places_of(holder: object, values: Sequence[object]) -> list[int]:
    """Bytes from the address of an object to the slots that hold these values."""
    words = ctypes.cast(id(holder), ctypes.POINTER(ctypes.c_size_t))[: type(holder).__basicsize__ // 8]
    return [8 * words.index(id(value)) for value in values]
