"""A run's folder never holds half of a file, and an earlier run's files until there are new ones."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from wbc.cli.console import OutputError
from wbc.cli.folders import filled, run_folder

FILES = ("log.json", "plot-*.png")


def test_whoever_is_killed_leaves_whole_files(tmp_path: Path) -> None:
    with filled(tmp_path) as fresh:
        (fresh / "log.json").write_text("{}")
        (fresh / "plot-7.png").write_text("old")
    with pytest.raises(OutputError, match=r"there is a run in this folder \(log\.json\)"):
        run_folder(tmp_path, "run", FILES)
    folder = run_folder(tmp_path, "run", FILES, True, clear=False)
    child = os.fork()
    if not child:
        try:
            with filled(folder, FILES) as fresh, (fresh / "log.json").open("w") as stream:
                stream.write('{"half": ')
                stream.flush()
                os.kill(os.getpid(), signal.SIGKILL)
        finally:
            os._exit(1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGKILL
    assert (folder / "log.json").read_text() == "{}"
    assert (folder / "plot-7.png").exists()
    with filled(folder, FILES) as fresh:
        (fresh / "log.json").write_text('{"whole": 1}')
    assert [file.name for file in folder.iterdir()] == ["log.json"]
    assert (folder / "log.json").read_text() == '{"whole": 1}'


def test_an_error_while_writing_leaves_what_was_there(tmp_path: Path) -> None:
    (tmp_path / "log.json").write_text("{}")
    with pytest.raises(ZeroDivisionError), filled(tmp_path, FILES) as fresh:
        (fresh / "log.json").write_text(f"{1 / 0}")
    assert [file.name for file in tmp_path.iterdir()] == ["log.json"]
    assert not [file.name for file in run_folder(tmp_path, "run", FILES, True).iterdir()]
