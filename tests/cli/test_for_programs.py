"""What shells and programs ask of the command line: completion, JSON, and quiet ends."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.processes import processor_time
from wbc.cli import completion
from wbc.cli.app import COMMANDS, CommandGroup, app, command

WBC = [sys.executable, "-c", "import sys; sys.argv[0] = 'wbc'; from wbc.cli import main; main()"]


def run(*arguments: str) -> str:
    """Standard output of ``wbc ARGUMENTS`` at 80 columns."""
    result = CliRunner(env={"COLUMNS": "80"}).invoke(app, arguments)
    assert result.exit_code in (0, 1), result.stderr
    return result.stdout


def test_results_as_json() -> None:
    table = json.loads(run("robots", "panda", "--json"))
    assert "panda" in {row["name"] for row in table}
    panda = json.loads(run("robots", "show", "panda", "--json"))
    assert (panda["nv"], panda["roles"]["tip"], len(panda["limits"]["velocity"])) == (7, "panda_hand_tcp", 7)
    assert panda["limits"]["acceleration"][0] == 15.0
    # JSON has no infinity
    assert json.loads(run("robots", "show", "so100", "--json"))["limits"]["acceleration"][0] is None
    modes = json.loads(run("coordinates", "modes", "spherical_4r", "--json"))
    assert modes["M4"]["pairs"]
    assert "missing" in modes["M6"]
    reached, missed = ["--target", "0.4,0.2,0.5"], ["--target", "3,0,0"]
    quick = ["--backend", "vm", "--budget", "10", "--restarts", "3"]
    answers = json.loads(run("ik", "ur5", *reached, *missed, *quick, "--json"))
    assert [answer["solved"] for answer in answers] == [True, False]
    assert len(answers[0]["q"]) == 6
    assert "out of reach" in answers[1]["reason"]


def test_commands_print_only_where_data_is_kept() -> None:
    """What every command says goes through :mod:`wbc.cli.console`, so that ``--json`` has it."""
    own = {"app.py", "console.py"}
    folder = Path(completion.__file__).parent
    found = [
        f"{path.name}: {line.strip()}"
        for path in sorted(folder.rglob("*.py"))
        if path.name not in own
        for line in path.read_text().splitlines()
        if re.search(r"(?<![.\w])print\(|echo\(|sys\.stdout|Console\(", line)
    ]
    assert found == []
    for name, entry in COMMANDS.items():
        for mode in entry.modes:
            assert entry.in_clone or any("--json" in option.opts for option in command(name, mode).params), name


def test_the_shell_completes_robots_files_and_frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "panda" in completion.robots("pand")
    assert {"spdm", "walker"} <= set(completion.robots(""))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.urdf").write_text("")
    (tmp_path / "notes.txt").write_text("")
    (tmp_path / "robots").mkdir()
    assert completion.robots("mi") == ["mine.urdf"]
    assert completion.robots("robo") == ["robots/"]
    assert "notes.txt" not in completion.robots("")
    words = {"_WBC_COMPLETE": "complete_bash", "COMP_WORDS": "wbc track panda --frame panda_h", "COMP_CWORD": "4"}
    done = subprocess.run(WBC, env={**os.environ, **words}, capture_output=True, text=True, check=False)
    assert {"panda_hand", "panda_hand_tcp"} <= set(done.stdout.split()), done.stderr
    assert all(word.startswith("panda_h") for word in done.stdout.split())
    for line, found in (("wbc walk dr", {"drive"}), ("wbc robots sh", {"show"}), ("wbc walk drive --pl", {"--plant"})):
        words |= {"COMP_WORDS": line, "COMP_CWORD": str(line.count(" "))}
        done = CliRunner(env=words).invoke(app, prog_name="wbc", complete_var="_WBC_COMPLETE")
        assert set(done.stdout.split()) == found, done.stderr


def test_what_needs_a_clone_is_hidden_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    hidden = {name for name, entry in COMMANDS.items() if entry.in_clone}
    assert hidden == {"docs"}
    assert not {name for name, one in CommandGroup().commands.items() if one.hidden}
    monkeypatch.setattr(Path, "is_file", lambda _: False)
    assert {name for name, one in CommandGroup().commands.items() if one.hidden} == hidden


@pytest.mark.parametrize("wait", [0.5, 1.0])
def test_ctrl_c_while_a_command_starts_is_quiet(wait: float) -> None:
    """After so many seconds of its processor time, whatever else the machine does."""
    process = subprocess.Popen(
        [*WBC, "robots", "show", "talos"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    while process.poll() is None and processor_time(process.pid) < wait:
        time.sleep(0.005)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    # Before Python has a handler of its own the signal ends the process
    assert process.returncode in (0, 130, -signal.SIGINT)
    assert "Traceback" not in err
