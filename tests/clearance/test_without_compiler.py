"""The C that proves clearances, where it cannot be had: the error says why, and what brings it."""

from __future__ import annotations

import ctypes
from pathlib import Path

import pytest

from wbc.clearance import native as clearance
from wbc.errors import CompileError
from wbc.native import kernel, toolchain
from wbc.proximity import native as proximity


@pytest.fixture(autouse=True)
def nothing_ahead(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No library was compiled when wbc was installed, and none is in the cache."""
    monkeypatch.setattr(kernel, "AHEAD", tmp_path / "ahead")
    monkeypatch.setenv("WBC_CACHE", str(tmp_path / "cache"))


@pytest.mark.parametrize("module", [clearance, proximity], ids=["clearance", "proximity"])
def test_no_compiler(module: object, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(toolchain, "compiler", lambda: None)
    with pytest.raises(CompileError, match=r"no C compiler found.*install gcc or wbc\[compiler\].*make wheel"):
        module.library.__wrapped__()  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("module", "name"), [(clearance, "_SweepStruct"), (proximity, "_SceneStruct")], ids=["clearance", "proximity"]
)
def test_a_library_of_another_layout_is_refused(module: object, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    more = type(name, (getattr(module, name),), {"_fields_": [("more", ctypes.c_int)]})
    monkeypatch.setattr(module, name, more)
    with pytest.raises(CompileError, match="bytes"):
        module.library.__wrapped__()  # type: ignore[attr-defined]
