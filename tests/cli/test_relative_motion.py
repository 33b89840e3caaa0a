"""``wbc published relative-motion``: what it prints, writes and refuses."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from wbc.cli.app import app

RUN = CliRunner(env={"COLUMNS": "200"})


def test_a_table_row_by_row(tmp_path: Path) -> None:
    words = ["published", "relative-motion", "--table", "4.6", "--solves", "8", "--out", str(tmp_path)]
    done = RUN.invoke(app, words)
    assert done.exit_code == 0, done.output
    last = done.output.splitlines()[5].split()
    assert last[:5] == ["4.6", "4.000", "0.480", "0.497", "0.197"]
    assert "x, y, z [in]" in done.output
    largest = json.loads((tmp_path / "summary.json").read_text())["inches"]["4.6"]
    assert largest["order 0"] > 0.49
    assert largest["line end"] < 0.005
    with (tmp_path / "tables.csv").open() as stream:
        assert [row["command"] for row in csv.DictReader(stream)] == ["0.5", "1.0", "2.0", "3.0", "4.0"]
    assert (tmp_path / "tables.png").stat().st_size > 5000
    again = RUN.invoke(app, words)
    assert again.exit_code == 2
    assert "--force" in again.output


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        (("measuring", "--angles", "40,-25,-20,0"), ["40, -25, -20, 0", "0.658"]),
        (("holding", "--seconds", "2"), ["pose and twist", "cycles of 50 ms"]),
        (("master-slave", "--backlash", "0.1", "--share", "0.5"), ["swaying", "0.100", "A = 0.5"]),
    ],
)
def test_parts_of_the_system(words: tuple[str, ...], shown: list[str], tmp_path: Path) -> None:
    done = RUN.invoke(app, ["published", "relative-motion", *words, "--out", str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert all(text in done.output for text in shown)
    with (tmp_path / f"{words[0]}.csv").open() as stream:
        assert len(list(csv.DictReader(stream))) in (1, 3, 4)
    assert words[0] in json.loads((tmp_path / "summary.json").read_text())
