"""The exported tick's timing: the same commands as in Python, and counters where there are some."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from bench import prepare, report
from bench.code import counting, run, tables
from bench.harness import Plan


def test_the_exported_tick_is_timed_on_the_path_of_the_python_tick(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    prepare.panda(tmp_path / "panda")
    monkeypatch.setattr(run, "BUILDS", {"exported C": ("TICK_FLAGS=-O0", "ROWS_FLAGS=-O0")})
    monkeypatch.setattr(run, "per_pass", lambda *given: ("valgrind", {"instructions": 400.0 * 1234.0}))
    measured = run.measure(Plan(sys.executable, None, tmp_path, rounds=1), "panda", lambda text: None)
    own, native, call = measured["rows"]
    assert (own["not solved"], own["counts"]) == (0.0, {"instructions": 1234.0})
    assert own["difference"] < 1e-9
    assert measured["ticks"] == prepare.TICKS * run.ROUNDS
    for row in (own, native, call):
        assert 0.0 < row["ns"]["median"] <= row["ns"]["p99.9"] <= row["ns"]["max"]
    sheet = tables.sheet(measured)
    assert [row[0] for row in sheet.rows][1:] == ["Python: the native call alone", "Python: controller.step(q)"]
    assert sheet.rows[0][7:9] == ("1234", "-")
    about = dict.fromkeys(("processor", "cores", "load"), "")
    assert "| 1234 |" in report.export_page({"machine": about, "code": {"panda": measured}})


def tool(folder: Path, name: str, text: str) -> None:
    """A program of that name that prints text; ``ROUNDS`` in it becomes ten thousand times its last argument."""
    path = folder / name
    path.write_text(f"#!/bin/sh\nfor last; do :; done\necho '{text}' | sed \"s/ROUNDS/${{last}}0000/\" >&2\n")
    path.chmod(0o755)


def test_counters_are_taken_in_order_and_what_a_pass_adds_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    tool(tmp_path, "valgrind", "==1== I refs:      ROUNDS,000")
    tool(tmp_path, "perf", "<not supported>,,cycles:u,0\n<not supported>,,instructions:u,0")
    # rounds 1 and 4, two passes each: (40 000 000 - 10 000 000) / 6
    assert counting.per_pass("x", "y", tmp_path, 3) == ("valgrind", {"instructions": 5e6})
    tool(tmp_path, "perf", "ROUNDS,,cycles:u,100.00,,\n77,,instructions:u,100.00,,")
    assert counting.per_pass("x", "y", tmp_path, 3) == ("perf stat", {"cycles": 5e3, "instructions": 0.0})
    tool(tmp_path, "perf", "")
    tool(tmp_path, "valgrind", "vex: unhandled instruction")
    assert counting.per_pass("x", "y", tmp_path, 3) == ("none", {})
