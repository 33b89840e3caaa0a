"""``wbc coordinates analyse --certify --resume`` as a process that is interrupted, and what goes on from its file."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.processes import IN_BACKGROUND
from tests.repeats import ALL, MORE
from wbc.cli.app import app

#: The command, with every piece of the subdivision slowed so that there is time to interrupt it
CHILD = """
import sys, time
from pathlib import Path
from wbc.analysis.certificates.boxes import BoxSearch
from wbc.cli import main

run, begun = BoxSearch.run, Path(sys.argv[1])

def slow(self, boxes, budget):
    if budget >= 1000:
        begun.touch()
        time.sleep(0.3)
    return run(self, boxes, budget)

BoxSearch.run = slow
del sys.argv[1]
main()
"""


@pytest.mark.parametrize("background", [False, True] if MORE >= ALL else [False])
def test_a_certificate_interrupted_as_a_process_is_gone_on_with(background: bool, tmp_path: Path) -> None:
    """SIGINT while boxes are looked at: what is known is told and kept, and the rest is done by the next call. In the
    background of a shell that ignores SIGINT the same with SIGTERM.
    """
    begun, states = tmp_path / "begun", tmp_path / "states"
    command = ["coordinates", "analyse", "spherical_4r", "--set", "elbow, beta"]
    command += ["--certify", "--resume", str(states), "--data"]
    cut, whole = tmp_path / "cut.json", tmp_path / "whole.json"
    child = subprocess.Popen(
        [*(IN_BACKGROUND if background else ()), sys.executable, "-c", CHILD, str(begun), *command, str(cut)],
        stdout=subprocess.PIPE,
        text=True,
    )
    until = time.monotonic() + 60.0
    while not begun.exists():
        assert child.poll() is None
        assert time.monotonic() < until
        time.sleep(0.02)
    child.send_signal(signal.SIGINT)
    if background:
        child.send_signal(signal.SIGTERM)
    told, _ = child.communicate(timeout=60.0)
    assert child.returncode == 0
    assert "certificate  undecided" in told
    first = json.loads(cut.read_text())["sets"][0]["certificate"]
    assert first["verdict"] == "undecided"
    assert 0.0 < first["left"] < 1.0
    (kept,) = states.iterdir()
    assert CliRunner().invoke(app, [*command, str(whole)]).exit_code == 0
    assert CliRunner().invoke(app, ["coordinates", *command[1:6], "--data", str(cut)]).exit_code == 0
    resumed, fresh = (json.loads(file.read_text())["sets"][0]["certificate"] for file in (whole, cut))
    assert resumed["verdict"] == fresh["verdict"] == "complete"
    assert resumed["left"] == fresh["left"] == 0.0
    assert resumed["boxes"] == pytest.approx(fresh["boxes"])
    assert kept.exists()
