"""The compiled library may be deleted or written over while it is in use: what is loaded is a copy of its own."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.soak.faults import corrupt, delete
from tests.stack import small
from wbc.controller import core_of
from wbc.native.library import load_library


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cache")
    folder.chmod(0o700)
    return folder


def test_a_lost_library_changes_nothing(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WBC_CACHE", str(cache))
    controller = small.stack().compile(backend="native")
    (library,) = cache.glob("*/tick.so")
    assert core_of(controller).tick._library._name != str(library)
    before = small.command(controller)
    content = library.read_bytes()
    library.parent.chmod(0o700)
    library.chmod(0o600)
    corrupt(library)
    assert library.read_bytes() != content
    assert small.command(controller) == before
    assert small.command(controller.clone()) == before
    delete(library)
    assert small.command(controller) == before
    assert small.command(controller.clone()) == before
    assert controller.step((0.1, 0.2)).explain().status == "solved"
    # compiling again finds the damage and builds anew
    assert small.command(small.stack().compile(backend="native")) == before
    # no copy is left behind
    assert [path.name for path in cache.iterdir() if path.name.startswith(".loading")] == []


def test_equal_libraries_are_loaded_once(cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WBC_CACHE", str(cache))
    small.stack().compile(backend="native")
    (library,) = cache.glob("*/tick.so")
    copy = tmp_path / "copy.so"
    copy.write_bytes(library.read_bytes())
    assert load_library(copy) is load_library(library)
