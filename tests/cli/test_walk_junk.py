"""Whatever stands behind an option of ``wbc walk``, it is taken or refused in one line that names it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from wbc.cli.app import app

JUNK = st.sampled_from(
    [
        *(
            "",
            " ",
            "nan",
            "inf",
            "-inf",
            "-1",
            "0",
            "1e400",
            "9" * 400,
            "1,2,3,4",
            "13,9",
            "13,9,nan",
            ",",
            "é\u2028",
            "[]",
        ),
        *(
            "\0",
            "a\0b",
            "/",
            "..",
            "~",
            "/dev/null",
            "/proc/self/mem",
            "x" * 300,
            "hold",
            "hold ",
            "rate 1 for 2",
            "{}",
        ),
        *(
            "poses /dev/null",
            "rate 0,0,0,0,0,0 for inf",
            "rate nan,0,0,0,0,0 for 1",
            "=",
            "a=b",
            "hand_radius=nan",
            "3-1",
        ),
        *("hand_radius=1e400", "hand_radius=[1]", "joint_rates=[]", "hand_radius=" + "[" * 4000, "acceleration_time=0"),
        *("@", "@nan", "/@nan", ".@1e9", "keyboard", "published", "two-ended", "arm", "truss", "module", "L2,6", "1 2"),
    ]
)
OPTIONS = st.sampled_from(
    [
        *("--structure", "--robot", "--arms", "--gait", "--mode", "--speed", "--turn-rate", "--from", "--to", "--seed"),
        *(
            "--remove-rows",
            "--remove-columns",
            "--remove",
            "--commands",
            "--arm",
            "--do",
            "--resume",
            "--planner",
            "--plan",
        ),
        *("--set", "--backend"),
    ]
)
FLAGS = st.sampled_from(["--rigid", "--free-start", "--ask", "--least-time", "--no-check", "--force"])


@settings(max_examples=40, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(given_=st.lists(st.tuples(OPTIONS, JUNK), min_size=1, max_size=3), flags=st.lists(FLAGS, max_size=2))
def test_junk_is_named(
    given_: list[tuple[str, str]], flags: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    walked = list[Any]()
    for name in ("walk_free", "walk_published"):
        monkeypatch.setattr(f"wbc.cli.walking.run.{name}", lambda *arguments: walked.append(arguments))
    monkeypatch.chdir(tmp_path)
    arguments = [part for pair in given_ for part in pair]
    done = CliRunner().invoke(app, ["walk", *arguments, *flags, "--out", "run"], input="")
    assert done.exception is None or isinstance(done.exception, SystemExit), repr(done.exception)
    assert done.exit_code in (0, 2), done.output
    # What is refused leaves nothing behind
    assert bool(walked) == (done.exit_code == 0)
    # The folder is made by the walk, which is not done here
    assert not (tmp_path / "run").exists()
    if done.exit_code == 2:
        assert "rror" in done.stderr
    for file in (tmp_path / "run", tmp_path):
        if file.name == "run" and file.exists():
            file.rmdir()
