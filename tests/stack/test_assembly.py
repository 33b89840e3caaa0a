"""Rows that the tests assemble have the bits of those that gcc makes."""

from __future__ import annotations

import ctypes
import itertools
import subprocess
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from tests.assembly import assembled
from wbc.native import toolchain

#: Signs, sizes and what is no number; the sign of a NaN is nobody's
NUMBERS = (0.0, -0.0, 1.0, -2.5, 3e-300, 1e300, np.inf, -np.inf, np.nan)


def everything() -> ca.Function:
    """All operations that expressions of this package have, and constants of every form."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    parts = [x + y, x - y, x * y, x / y, -x, ca.sqrt(x), x**2, ca.fabs(x), ca.fmax(x, y), ca.fmin(x, y)]
    parts += [x < y, x <= y, ca.eq(x, y), ca.ne(x, y), ca.logic_not(x), ca.logic_and(x, y), ca.logic_or(x, y)]
    parts += [ca.if_else(x < y, x, y), ca.sin(x), ca.cos(x), ca.atan2(x, y), ca.acos(x), ca.exp(x), ca.floor(x)]
    parts += [2.0 * x, x - 0.1, 1e-12 + x, ca.SX(0.7), ca.SX(-1e-30), ca.SX.inf(), -ca.SX.inf(), ca.SX(3)]
    return ca.Function("rows", [x, y], [ca.vertcat(*parts), ca.vertcat(y, x)])


def library(place: Path, source: str, text: str) -> ctypes.CDLL:
    (place / source).write_text(text)
    compiler = toolchain.compiler()
    assert compiler is not None
    flags = ["-O0", "-w", "-fPIC", "-ffp-contract=off", "-shared", source, "-lm", "-o", f"{source}.so"]
    subprocess.run([compiler, *flags], cwd=place, check=True)
    return ctypes.CDLL(str(place / f"{source}.so"))


def test_every_operation_has_the_bits_of_gcc(tmp_path: Path) -> None:
    generator = ca.CodeGenerator("rows.c", {"with_header": False})
    generator.add(everything())
    text = str(generator.dump())
    assembly = assembled(text)
    if assembly is None:
        pytest.skip("another processor: the tests' rows are compiled")
    both = library(tmp_path, "rows.c", text), library(tmp_path, "rows.s", assembly.replace(".hidden", "#"))
    count = everything().nnz_out(0)
    for pair in itertools.product((*NUMBERS, None), NUMBERS):
        out = []
        for each in both:
            # What is not given is zero, and what is not asked for is not written
            given = [None if x is None else np.array([x]) for x in pair]
            found = np.zeros(count)
            arg = (ctypes.c_void_p * 2)(*(None if x is None else x.ctypes.data for x in given))
            res = (ctypes.c_void_p * 2)(found.ctypes.data, None)
            assert each.rows(arg, res, None, None, 0) == 0
            out.append(np.where(np.isnan(found), np.nan, found).tobytes())
        assert out[0] == out[1], pair


def test_what_is_not_known_is_left_to_the_compiler() -> None:
    generator = ca.CodeGenerator("rows.c", {"with_header": False})
    x = ca.SX.sym("x")
    generator.add(ca.Function("rows", [x], [ca.erf(x)]))
    assert assembled(str(generator.dump())) is None
