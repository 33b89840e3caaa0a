"""Folders, values and archives that an export refuses, and the fetch of the solver's source, without a network."""

from __future__ import annotations

import functools
import gzip
import http.server
import io
import os
import subprocess
import sys
import tarfile
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.export.cases import panda
from tests.stack import small
from wbc.api import Controller
from wbc.errors import RangeError, SolverError
from wbc.export import ExportError, solver_code
from wbc.export.solver_code import ARCHIVE, SolverSourceError


@pytest.fixture
def arm() -> Controller:
    c = small.stack().compile(backend="vm")
    c.reset(small.Q)
    return c


def archive() -> bytes:
    """An archive that is laid out as the solver's is."""
    files = {
        "LICENSE": "MIT",
        "setup.py": "raise SystemExit",
        "csrc/include/api.h": "/* api */",
        "csrc/include/CMakeLists.txt": "",
        "csrc/src/daqp.c": "int x;",
        "../../outside.c": "int y;",
    }
    raw = io.BytesIO()
    with tarfile.open(fileobj=raw, mode="w") as tar:
        for name, text in files.items():
            info = tarfile.TarInfo(f"daqp-0/{name}")
            info.size = len(text)
            tar.addfile(info, io.BytesIO(text.encode()))
    return gzip.compress(raw.getvalue(), mtime=0)


@pytest.fixture
def pinned(monkeypatch: pytest.MonkeyPatch) -> bytes:
    """The archive, with its hash as the pinned one."""
    import hashlib

    data = archive()
    monkeypatch.setattr(solver_code, "SHA256", hashlib.sha256(data).hexdigest())
    return data


@pytest.fixture
def index(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A package index on this machine; its files are in the folder."""
    place = tmp_path / "index"
    (place / "simple" / "daqp").mkdir(parents=True)

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *arguments: Any) -> None:
            """Nothing."""

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=str(place)))
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    monkeypatch.setenv("PIP_INDEX_URL", f"http://127.0.0.1:{server.server_address[1]}/simple/")
    yield place
    server.shutdown()
    thread.join()
    server.server_close()


def fill(index: Path, data: bytes) -> None:
    (index / "files").mkdir()
    (index / "files" / ARCHIVE).write_bytes(data)
    page = f'<a href="x-{ARCHIVE}">no</a><a href="../../files/{ARCHIVE}#sha256=0">{ARCHIVE}</a>'
    (index / "simple" / "daqp" / "index.html").write_text(page)


def test_the_source_is_fetched_and_laid_out(arm: Controller, index: Path, pinned: bytes, tmp_path: Path) -> None:
    fill(index, pinned)
    folder = arm.export(tmp_path / "out", solver_source=True, states=5)
    files = sorted(p.relative_to(folder).as_posix() for p in (folder / "daqp").rglob("*") if p.is_file())
    assert files == ["daqp/LICENSE", "daqp/include/daqp/api.h", "daqp/src/daqp.c"]
    assert "daqp/src/*.c" in (folder / "Makefile").read_text()
    assert "${DAQP}" in (folder / "CMakeLists.txt").read_text()
    assert not list(tmp_path.rglob("outside.c"))


def test_an_archive_on_disk_needs_no_index(arm: Controller, pinned: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.tar.gz").write_bytes(pinned)
    folder = arm.export(tmp_path / "out", solver_source=tmp_path / "a.tar.gz", states=5)
    assert (folder / "daqp" / "src" / "daqp.c").is_file()
    with pytest.raises(SolverSourceError, match=r"cannot be read: No such file.*none"):
        arm.export(tmp_path / "two", solver_source=tmp_path / "none.tar.gz", states=5)


def test_another_archive_is_refused(arm: Controller, index: Path, tmp_path: Path) -> None:
    fill(index, archive())
    with pytest.raises(SolverSourceError, match=f"not {ARCHIVE}"):
        arm.export(tmp_path / "out", solver_source=True, states=5)
    assert not (tmp_path / "out").exists()


def test_an_index_without_it_or_without_an_answer_is_named(
    arm: Controller, index: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(SolverSourceError, match=f"has no {ARCHIVE}"):
        arm.export(tmp_path / "out", solver_source=True, states=5)
    for address in ("http://127.0.0.1:9/simple", "no address"):
        monkeypatch.setenv("PIP_INDEX_URL", address)
        with pytest.raises(SolverSourceError, match="cannot be fetched"):
            arm.export(tmp_path / "out", solver_source=True, states=5)
    assert not (tmp_path / "out").exists()


def test_folders_that_hold_something(arm: Controller, tmp_path: Path) -> None:
    folder = arm.export(tmp_path / "out", states=5)
    with pytest.raises(ExportError, match="is not empty"):
        arm.export(folder, states=5)
    (folder / "mine.txt").write_text("x")
    arm.export(folder, overwrite=True, states=7)
    assert "7 states" in (folder / "README.txt").read_text()
    assert not (folder / "mine.txt").exists()
    other = tmp_path / "other"
    other.mkdir()
    arm.export(other, states=5)
    thesis = tmp_path / "thesis"
    thesis.mkdir()
    (thesis / "thesis.tex").write_text("x")
    with pytest.raises(ExportError, match="something else than an export"):
        arm.export(thesis, overwrite=True, states=5)
    with pytest.raises(ExportError, match="is a file"):
        arm.export(thesis / "thesis.tex", overwrite=True, states=5)
    assert (thesis / "thesis.tex").read_text() == "x"
    assert {p.name for p in tmp_path.iterdir()} == {"out", "other", "thesis"}


def test_folders_that_cannot_be_written(arm: Controller, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    for place in (tmp_path / "file" / "out", Path("/proc/out"), Path("/dev/null/out")):
        with pytest.raises(ExportError, match=r"cannot be (written|read)"):
            arm.export(place, states=5)


@pytest.mark.parametrize("states", [0, -1, 2.5, True, "3"])
def test_bad_numbers_of_states(arm: Controller, states: Any, tmp_path: Path) -> None:
    with pytest.raises(RangeError, match="states"):
        arm.export(tmp_path / "out", states=states)
    assert not (tmp_path / "out").exists()


def test_values_that_wait_for_a_configuration(tmp_path: Path) -> None:
    with pytest.raises(SolverError, match=r"hand\.target.*first configuration"):
        panda("vm").stack.compile(backend="vm").export(tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_an_export_changes_nothing(arm: Controller, tmp_path: Path) -> None:
    one = arm.clone()
    arm.export(tmp_path / "out", states=50)
    assert (arm.step(small.Q).v == one.step(small.Q).v).all()


def test_no_compiler_is_needed(tmp_path: Path) -> None:
    code = (
        "from tests.stack import small\n"
        "c = small.stack().compile()\n"
        "c.reset(small.Q)\n"
        f"print(c.backend, c.export({str(tmp_path / 'out')!r}, states=5))\n"
    )
    root = Path(__file__).parents[2]
    environment = {**os.environ, "WBC_CC": "", "PYTHONPATH": str(root)}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, env=environment, cwd=root
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["vm", str(tmp_path / "out")]
    assert (tmp_path / "out" / "wbc_tick.h").is_file()
