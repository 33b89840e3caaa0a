"""The exported tick's timing: the same commands as in Python."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench import prepare, report
from bench.code import run


def test_the_exported_tick_is_timed_on_the_path_of_the_python_tick(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    prepare.panda(tmp_path / "panda")
    monkeypatch.setattr(run, "BUILDS", {"exported C": ("TICK_FLAGS=-O0", "ROWS_FLAGS=-O0")})
    monkeypatch.setattr(run, "instructions", lambda *given: 400.0 * 1234.0)
    measured = run.measure(tmp_path / "panda", 1, lambda text: None)
    own, native, call = measured["rows"]
    assert (own["not solved"], own["counts"]) == (0.0, {"instructions": 1234.0})
    assert own["difference"] < 1e-9
    assert measured["ticks"] == prepare.TICKS * run.ROUNDS
    for row in (own, native, call):
        assert 0.0 < row["ns"]["median"] <= row["ns"]["p99.9"] <= row["ns"]["max"]
    sheet = run.sheet(measured)
    assert [row[0] for row in sheet.rows][1:] == ["Python: the native call alone", "Python: controller.step(q)"]
    assert sheet.rows[0][5] == "1234"
    about = dict.fromkeys(("processor", "cores", "load"), "")
    assert "| 1234 |" in report.export_page({"machine": about, "code": {"panda": measured}})


def test_instructions_are_what_a_pass_adds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    text = "for last; do :; done\necho '==1== I refs:      ROUNDS,000' | sed \"s/ROUNDS/${last}0000/\" >&2\n"
    (tmp_path / "valgrind").write_text(f"#!/bin/sh\n{text}")
    (tmp_path / "valgrind").chmod(0o755)
    assert run.instructions("x", tmp_path) == 1e7
    (tmp_path / "valgrind").write_text("#!/bin/sh\necho 'vex: unhandled instruction' >&2\n")
    assert run.instructions("x", tmp_path) is None
