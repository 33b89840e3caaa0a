"""What commands print at a terminal of 80 columns, in a pipe, and as JSON."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from wbc.cli.app import COMMANDS, app

#: Run one after the other in one folder; those of walks, films, loops and long searches have tests of their own
COMMANDS_RUN = (
    "robots",
    "robots show panda",
    "robots pairs ur5 --samples 20",
    "coordinates",
    "coordinates modes spherical_4r",
    "coordinates advise spherical_4r --at 0.3,1.5,-0.7,1.1",
    "coordinates analyse spherical_4r --set alpha",
    "published relative-motion --table 4.6 --out relative",
    "published ikor --case 1 --config 3x7 --out ikor",
    "ik ur5 --target 0.4,0.2,0.5 --target 3,0,0 --backend vm --budget 10 --restarts 2",
    "ik explore panda --seeds 0 --out explore",
    "track ur5 --duration 0.05 --rate 100 --backend vm --no-plots --out track",
    "replay track",
    "coordinates drive spherical_4r --rates rates.csv --backend vm",
    "study manipulability.yaml --out study",
    "export ur5 --out export --backend vm",
)
STUDY = "scenario: manipulability\nparameters: {robot: ur5, samples: 3}\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("output")
    (folder / "rates.csv").write_text("time,pair,r1,r2,r3,r4,r5,r6\n0,,0.02\n0.1\n")
    (folder / "manipulability.yaml").write_text(STUDY)
    return folder


def printed(line: str, **environment: str) -> tuple[str, str]:
    """Standard output and errors of a command that neither fails nor is refused."""
    found = CliRunner(env={"COLUMNS": "80", **environment}).invoke(app, line.split())
    assert found.exit_code in (0, 1), (line, found.stderr, found.exception)
    return found.stdout, found.stderr


@pytest.mark.parametrize("line", COMMANDS_RUN)
def test_a_terminal_gets_80_columns_and_a_program_json(
    line: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", "".join(printed(line, FORCE_COLOR="1", TERM="xterm")))
    assert "\x1b" not in text
    # What is copied, such as a path or joint positions, stays one word
    wide = [row for row in text.splitlines() if len(row) > 80 and len(row.split()) > 1]
    assert wide == []
    other = line.replace("--out ", "--out json_")
    out, _ = printed(f"{other} --json")
    assert json.loads(out)


@pytest.mark.parametrize(
    "line", [*(f"{name} {mode} --help" for name, entry in COMMANDS.items() for mode in entry.modes), "--help", "robots"]
)
def test_a_pipe_gets_no_colours(line: str) -> None:
    out, err = printed(line)
    assert "\x1b" not in out + err
    if line.endswith("--help"):
        assert max(map(len, out.splitlines())) <= 80
        # Square brackets are markup for help texts, and vanish
        assert not re.search(r" [.,;:](?!\S)", out), out


def test_lines_stay_whole_in_a_pipe() -> None:
    out, _ = printed("robots show walker")
    assert "limit" in next(row for row in out.splitlines() if row.startswith("acceleration:"))
    assert max(map(len, out.splitlines())) > 80
