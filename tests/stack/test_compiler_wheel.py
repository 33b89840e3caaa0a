"""Without gcc, the zig of the ``ziglang`` wheel compiles: here a stand-in that notes its arguments and calls gcc."""

from __future__ import annotations

import ctypes
import os
import pathlib
import shutil
import sys

import pytest

from wbc.native import toolchain

GCC = shutil.which("gcc")


@pytest.fixture
def zig(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> pathlib.Path:
    """A package ``ziglang`` whose zig is gcc, and nothing else on the PATH."""
    if GCC is None:
        pytest.skip("needs gcc")
    wheel = tmp_path / "site" / "ziglang"
    wheel.mkdir(parents=True)
    (wheel / "__init__.py").touch()
    said = tmp_path / "said"
    (wheel / "zig").write_text(f'#!/bin/sh\necho "$@" >> {said}\nshift\nPATH={os.path.dirname(GCC)} exec {GCC} "$@"\n')
    (wheel / "zig").chmod(0o755)
    monkeypatch.setitem(sys.modules, "ziglang", None)
    monkeypatch.delitem(sys.modules, "ziglang")
    monkeypatch.syspath_prepend(str(tmp_path / "site"))
    monkeypatch.delenv("WBC_CC", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    return said


def test_the_wheel_is_found_and_used(
    zig: pathlib.Path, tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = toolchain.compiler.__wrapped__()
    assert found == str(tmp_path / "site" / "ziglang" / "zig")
    monkeypatch.setattr(toolchain, "compiler", lambda: found)
    source = "int wbc_twice(int a) { return 2 * a; }"
    toolchain.compile_kernel({"twice.c": source}, tmp_path / "twice.so")
    assert ctypes.CDLL(str(tmp_path / "twice.so")).wbc_twice(21) == 42
    files = {"rows.c": "int rows(void) { return 1; }", "library.c": "int rows(void); int tick(void) { return rows(); }"}
    toolchain.compile_tick(files, tmp_path / "tick.so")
    assert (tmp_path / "tick.so").exists()
    lines = zig.read_text().splitlines()
    assert all(line.startswith("cc -fno-sanitize=undefined") for line in lines)
    assert "exclude-libs" not in "".join(lines)


def test_gcc_comes_first() -> None:
    if GCC is None:
        pytest.skip("needs gcc")
    assert toolchain._command(GCC) == [GCC]


def test_without_both_the_wheel_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: pathlib.Path) -> None:
    monkeypatch.delenv("WBC_CC", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(toolchain, "_wheel", lambda: None)
    monkeypatch.setattr(toolchain, "compiler", toolchain.compiler.__wrapped__)
    assert "pip install wbc[compiler]" in toolchain.missing.__wrapped__()[0]
