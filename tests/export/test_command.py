"""``wbc export``, and the example in C on what it writes."""

from __future__ import annotations

import re
from pathlib import Path

from typer.testing import CliRunner

from tests.export.cases import STRICT, build, run
from wbc.cli.app import app

MAIN = Path(__file__).parents[2] / "examples" / "c" / "main.c"


def wbc(*arguments: str | Path) -> tuple[int, str]:
    """(exit code, all that was said)."""
    result = CliRunner(env={"COLUMNS": "200"}).invoke(app, ["export", *map(str, arguments)])
    return result.exit_code, result.output


def test_help_names_the_options() -> None:
    code, said = wbc("--help")
    assert code == 0
    for option in ("--out", "--sphere", "--solver-source", "--solver-archive", "--iteration-cap", "--force"):
        assert option in said


def test_the_example_closes_the_loop(tmp_path: Path) -> None:
    folder = tmp_path / "panda_tick"
    code, said = wbc("panda", "--out", folder, "--states", "50")
    assert code == 0
    assert f"{folder}: panda, 7 degrees of freedom" in said
    build(folder)
    parts = (str(MAIN), "libwbc_tick.a", "daqp/libdaqp.a", "-lm")
    done = run("gcc", *STRICT, "-I.", *parts, "-o", "main", folder=folder)
    assert done.returncode == 0, done.stderr
    done = run("./main", folder=folder)
    assert done.returncode == 0
    found = re.search(r"([-.0-9]+) mm off", done.stdout)
    assert found is not None
    assert abs(float(found[1])) < 0.1


def test_obstacles_and_the_cap_arrive(tmp_path: Path) -> None:
    places = ["--sphere", "0.4,0.2,0.3,0.1", "--sphere", "0.2,-0.5,0.4,0.1,0.1,0,0"]
    code, said = wbc(
        "ur5", "--out", tmp_path / "out", *places, "--iteration-cap", "4", "--states", "20", "--backend", "native"
    )
    assert code == 0, said
    values = (tmp_path / "out" / "values.h").read_text()
    assert "#define FIRST_CAP 4\n" in values
    header = (tmp_path / "out" / "wbc_tick.h").read_text()
    assert "WBC_P_SPHERE1_POSE" in header
    assert "WBC_P_SPHERE2_VELOCITY" in header
