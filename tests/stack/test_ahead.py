"""Hand-written C that is compiled when wbc is installed: what it is, what a build needs, where it is looked for."""

from __future__ import annotations

import ctypes
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.stack.machines import KINDS, shown
from wbc.errors import CompileError, UnknownNameError
from wbc.native import kernel, targets, toolchain
from wbc.stack import ahead, generic

WBC = Path(kernel.__file__).parents[1]
TEXTS = {"answer.c": '#include "number.h"\nint answer(void) { return NUMBER; }\n', "number.h": "#define NUMBER 42\n"}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Nothing is compiled yet, neither ahead nor into the cache."""
    monkeypatch.setattr(kernel, "AHEAD", tmp_path / "ahead")
    monkeypatch.setenv("WBC_CACHE", str(tmp_path / "cache"))
    return tmp_path


def answer(library: Path) -> int:
    return int(ctypes.CDLL(str(library)).answer())


def test_every_kernel_is_compiled_ahead() -> None:
    asked = [re.findall(r'\bkernel\(\w+ / "(\w+\.c)"', path.read_text()) for path in WBC.rglob("*.py")]
    assert sorted(name for names in asked for name in names) == sorted(Path(name).name for name in ahead.KERNELS)
    assert all((WBC / name).is_file() for name in ahead.KERNELS)


def test_a_build_needs_no_package_but_casadi_and_platformdirs() -> None:
    """Those of ``[build-system]``; casadi brings numpy."""
    script = f"import sys; sys.path[:0] = {sys.path!r}; import wbc.stack.ahead; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-S", "-c", script], capture_output=True, text=True, check=True)
    packages = {name.split(".")[0] for name in done.stdout.split()}
    assert "casadi" in packages
    assert not packages & {"pinocchio", "scipy", "daqp", "coal", "osqp", "typer", "rich", "matplotlib", "hpp"}


def test_texts_are_a_file_and_what_it_includes(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "a.c").write_text('#include "b.h"\n#include <math.h>\n')
    (tmp_path / "b.h").write_text('#include "c.h"\n')
    (tmp_path / "there" / "c.h").write_text('#include "b.h"\n')
    assert list(kernel.texts_of(tmp_path / "a.c", tmp_path / "there")) == ["a.c", "b.h", "c.h"]


def test_what_was_compiled_ahead_is_taken(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """At once where any code will do; else only for want of a compiler; and only if it is of these texts."""
    kernel.AHEAD.mkdir()
    toolchain.compile_kernel(TEXTS, kernel.ahead(TEXTS), target=targets.HERE)
    own = kernel.library(TEXTS, toolchain.compile_kernel, at_once=False)
    assert own.parents[1] == folder / "cache"
    assert kernel.library(TEXTS, toolchain.compile_kernel, at_once=True) == kernel.ahead(TEXTS)
    monkeypatch.setattr(toolchain, "compiler", lambda: None)
    found = kernel.library(TEXTS, toolchain.compile_kernel)
    assert found == kernel.ahead(TEXTS)
    assert answer(found) == answer(own) == 42
    with pytest.raises(CompileError, match="no C compiler"):
        kernel.library({**TEXTS, "number.h": "#define NUMBER 43\n"}, toolchain.compile_kernel, at_once=True)


def test_a_build_makes_what_is_missing_and_removes_what_is_old(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Path] = []

    def compile_to(texts: Mapping[str, str], output: Path, target: targets.Target) -> None:
        assert target == targets.HERE
        made.append(output)
        output.touch()

    for name in ("compile_generic", "compile_kernel"):
        monkeypatch.setattr(toolchain, name, compile_to)
    kernel.AHEAD.mkdir()
    (kernel.AHEAD / "old.so").touch()
    built = ahead.build()
    assert sorted(made) == built == sorted(kernel.AHEAD.iterdir())
    assert len(built) == len(generic.variants()) + len(ahead.KERNELS)
    assert ahead.build() == built
    assert len(made) == len(built), "nothing is compiled twice"
    monkeypatch.setattr(toolchain, "missing", lambda: ("no C compiler",))
    with pytest.raises(CompileError, match="no C compiler"):
        ahead.build()


@pytest.mark.parametrize(
    ("name", "suffix"), [("linux-aarch64", "so"), ("macos-arm64", "dylib"), ("windows-x86-64", "dll")]
)
def test_libraries_of_other_machines_have_other_names_and_need_zig(
    name: str, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = targets.OTHERS[name]
    assert kernel.ahead(TEXTS, target).suffix == f".{suffix}"
    assert kernel.ahead(TEXTS, target).stem != kernel.ahead(TEXTS).stem
    monkeypatch.setattr(toolchain, "_wheel", lambda: None)
    monkeypatch.setattr(toolchain, "_on_path", lambda program: None if program == "zig" else f"/usr/bin/{program}")
    with pytest.raises(CompileError, match=f"no zig for {target.triple}"):
        ahead.build(target)


def test_a_platform_that_is_not_known_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="linux-aarch64"):
        targets.with_solver("linux-arm64", tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_library_shows_its_names(tmp_path: Path) -> None:
    toolchain.compile_kernel(TEXTS, tmp_path / "answer.so", target=targets.HERE)
    kind, names = shown((tmp_path / "answer.so").read_bytes())
    assert kind == KINDS[targets.HERE.system, targets.HERE.machine]
    assert {name for name in names if not name.startswith("_")} == {"answer"}
