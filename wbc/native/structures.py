"""Structures of C headers for Python, which reads them there instead of stating them again."""

from __future__ import annotations

import ctypes
import re
from pathlib import Path
from typing import Any

from wbc.errors import CompileError

#: Types of numbers in C
_NUMBERS: dict[str, Any] = {
    "int": ctypes.c_int,
    "unsigned": ctypes.c_uint,
    "long": ctypes.c_long,
    "long long": ctypes.c_longlong,
    "unsigned long long": ctypes.c_ulonglong,
    "signed char": ctypes.c_byte,
    "double": ctypes.c_double,
}
_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_CONSTANT = re.compile(r"^#define (\w+) (\d+) *$", re.MULTILINE)
_FUNCTION = re.compile(r"typedef [^;{]*\(\*(\w+)\)\(")
_STRUCTURE = re.compile(r"typedef struct(?: \w+)? \{([^}]*)\} (\w+);")
_FIELDS = re.compile(r"(?:const )?((?:(?:un)?signed )?(?:long )?(?:long|\w+)) (.+)", re.DOTALL)


class CStructures:
    """Structures and whole numbers that C files define.

    Attributes:
        constants: of ``#define NAME number``.

    Args:
        headers: C files.
    """

    def __init__(self, *headers: Path) -> None:
        text = _COMMENT.sub("", "\n".join(header.read_text(encoding="utf-8") for header in headers))
        self.constants = {name: int(number) for name, number in _CONSTANT.findall(text)}
        self._fields = {name: fields for fields, name in _STRUCTURE.findall(text)}
        self._types = _NUMBERS | dict.fromkeys(_FUNCTION.findall(text), ctypes.c_void_p)

    def structure(self, name: str) -> Any:
        """The ``ctypes.Structure`` of that name; pointers are addresses.

        Raises:
            CompileError: the files define none, or a field is of a type that they do not define.
        """
        if name not in self._types:
            if name not in self._fields:
                raise CompileError("structure", name, f"not among {', '.join(sorted({*self._types, *self._fields}))}")
            fields = [field for line in self._fields[name].split(";") if line.strip() for field in self._declared(line)]
            self._types[name] = type(name, (ctypes.Structure,), {"_fields_": fields})
        return self._types[name]

    def _declared(self, line: str) -> list[tuple[str, Any]]:
        """(name, type) of what a line declares, as ``const double *low, size[3]``."""
        match = _FIELDS.fullmatch(" ".join(line.split()))
        assert match is not None
        fields = []
        for declared in match[2].split(","):
            name, *sizes = declared.replace("]", "").split("[")
            kind = ctypes.c_void_p if "*" in name else self.structure(match[1])
            for size in reversed(sizes):
                kind *= int(self.constants.get(size, 0) or size)
            fields.append((name.strip(" *"), kind))
        return fields
