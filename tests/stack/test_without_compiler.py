"""Without a C compiler, with one that fails, or with zig's wheel: the same answers, one line in the log."""

from __future__ import annotations

import ctypes
import json
import os
import pathlib
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from tests.stack import small
from tests.stack.fallback import found
from wbc.native import toolchain

#: What happens where a user's own compiler fails
pytestmark = pytest.mark.compiled

ROOT = pathlib.Path(__file__).parents[2]
Here = Callable[..., dict[str, Any]]


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., dict[str, Any]]]:
    """What :mod:`tests.stack.fallback` finds in this process, which forgets what it knows of its compiler."""
    known = (toolchain.compiler, toolchain.missing, toolchain.fall_back)

    def run(cache: pathlib.Path, **environment: str) -> dict[str, Any]:
        monkeypatch.delenv("WBC_CC", raising=False)
        for name, value in {"WBC_CACHE": str(cache), **environment}.items():
            monkeypatch.setenv(name, value)
        for each in known:
            each.cache_clear()
        monkeypatch.setattr(toolchain, "identity", toolchain.identity.__wrapped__)
        return found()

    yield run
    monkeypatch.undo()
    for each in known:
        each.cache_clear()


def in_a_process(cache: pathlib.Path, **environment: str) -> dict[str, Any]:
    """The same in a process of its own, in which importing says nothing."""
    unchosen = {k: v for k, v in os.environ.items() if k != "WBC_CC"}
    done = subprocess.run(
        [sys.executable, "-m", "tests.stack.fallback"],
        cwd=ROOT,
        env={**unchosen, "WBC_CACHE": str(cache), **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return dict(json.loads(done.stdout))


@pytest.fixture(scope="module")
def native() -> list[list[float]]:
    """The script's commands by native ticks."""
    made = [small.stack().compile(backend="native"), small.stack(small.arm(length=0.6)).compile(backend="native")]
    assert [c.backend for c in made] == ["native", "native"]
    return [small.command(c) for c in made]


def check(told: dict[str, object], native: list[list[float]], *texts: str) -> None:
    """All on the virtual machine, the same answers, and one warning that says these texts."""
    assert told["imported"] == [], "import alone says nothing"
    assert told["backends"] == ["vm"] * 3
    assert np.abs(np.subtract(told["commands"], native)).max() < 1e-9
    assert [record[:2] for record in told["records"]] == [["wbc", "WARNING"]]
    for text in (*texts, "virtual machine"):
        assert text in told["records"][0][2]


def test_no_compiler(tmp_path: pathlib.Path, native: list[list[float]]) -> None:
    told = in_a_process(tmp_path, WBC_CC="")
    check(told, native, "no C compiler")
    field, text = told["refused"]
    assert field == "backend"
    assert "no C compiler" in text
    assert "daqp" not in text, "that is there"


def test_compiler_that_does_not_exist(tmp_path: pathlib.Path, native: list[list[float]], here: Here) -> None:
    told = here(tmp_path, WBC_CC="gcc-of-nowhere")
    check(told, native, "no C compiler", "gcc-of-nowhere")
    assert "gcc-of-nowhere" in told["refused"][1]


def test_no_compiler_on_the_path(tmp_path: pathlib.Path, native: list[list[float]], here: Here) -> None:
    check(here(tmp_path, PATH=str(tmp_path)), native, "neither gcc nor cc")


@pytest.mark.parametrize(
    ("script", "texts"),
    [
        pytest.param(
            '#!/bin/sh\nfor i in 1 2 3 4 5 6; do echo "cc: fatal $i" >&2; done\nexit 1\n',
            ("cc: fatal 1", "cc: fatal 2"),
            id="fails",
        ),
        pytest.param("#!/bin/sh\nexit 3\n", ("exit status 3",), id="fails without a word"),
        pytest.param("#!/nowhere/sh\n", ("cannot be started",), id="cannot be started"),
        pytest.param("#!/bin/sh\nprintf '\\377\\376' >&2\nexit 1\n", ("failed",), id="says no text"),
    ],
)
def test_compiler_that_fails(
    script: str, texts: tuple[str, ...], tmp_path: pathlib.Path, native: list[list[float]], here: Here
) -> None:
    compiler = tmp_path / "broken-cc"
    compiler.write_text(script)
    compiler.chmod(0o755)
    told = here(tmp_path / "cache", WBC_CC=str(compiler))
    check(told, native, *texts, str(compiler))
    assert "cc: fatal 5" not in told["records"][0][2], "the first lines only"
    field, text = told["refused"]
    assert field == "compiler"
    for said in texts:
        assert said in text
    left = [p for p in (tmp_path / "cache").iterdir() if p.is_dir()]
    assert len(left) == 2, "two entries for the virtual machine, nothing of the failed builds"


def test_casadi_without_the_solver_library(tmp_path: pathlib.Path, here: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    """A compiler alone is not enough."""
    monkeypatch.setattr(toolchain, "library", lambda: pathlib.Path("/nowhere.a"))
    told = here(tmp_path)
    assert told["backends"] == ["vm"] * 3
    assert "no static daqp library" in told["refused"][1]
    assert "no C compiler" not in told["refused"][1]
    assert len([text for _, _, text in told["records"] if "virtual machine" in text]) == 1


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
