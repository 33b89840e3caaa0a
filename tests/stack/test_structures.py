"""Structures are read from C headers as a compiler lays them out."""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import Any

import pytest

from wbc.errors import CompileError
from wbc.native.structures import CStructures

HEADER = """
#define ROWS 3
#define SHARE 0.5
typedef int (*reader)(const double **in, double **out);
typedef struct {
    double x; /* of a; b */
    unsigned *name;
} inner_t;
/* typedef struct { int none; } hidden_t; */
typedef struct outer {
    reader read;
    int count[2], rows[ROWS][2], *more;
    const inner_t inner,
        *others; /* behind it */
    unsigned long long bits;
    unsigned flag;
} outer_t;
typedef struct { odd_t odd; } wrong_t;
"""


def layout(structure: Any) -> list[tuple[str, int, int]]:
    """(name, offset, size) of the fields."""
    names = [field[0] for field in structure._fields_]
    return [(name, getattr(structure, name).offset, getattr(structure, name).size) for name in names]


def test_fields_are_laid_out_as_in_c(tmp_path: Path) -> None:
    """Arrays, pointers, functions and structures within; comments say nothing."""
    (tmp_path / "header.h").write_text(HEADER)
    header = CStructures(tmp_path / "header.h")
    outer, inner = header.structure("outer_t"), header.structure("inner_t")

    class Inner(ctypes.Structure):
        _fields_ = [("x", ctypes.c_double), ("name", ctypes.c_void_p)]

    class Outer(ctypes.Structure):
        _fields_ = [
            ("read", ctypes.c_void_p),
            ("count", ctypes.c_int * 2),
            ("rows", (ctypes.c_int * 2) * 3),
            ("more", ctypes.c_void_p),
            ("inner", Inner),
            ("others", ctypes.c_void_p),
            ("bits", ctypes.c_ulonglong),
            ("flag", ctypes.c_uint),
        ]

    assert layout(outer) == layout(Outer)
    assert layout(inner) == layout(Inner)
    assert ctypes.sizeof(outer) == ctypes.sizeof(Outer)
    assert header.constants == {"ROWS": 3}
    assert outer(count=(4, 5)).count[1] == 5
    for name, says in (("hidden_t", "hidden_t"), ("wrong_t", "odd_t")):
        with pytest.raises(CompileError, match=says):
            header.structure(name)
