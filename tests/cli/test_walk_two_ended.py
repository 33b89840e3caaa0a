"""``wbc walk two-ended``: from the command line to a run folder, as of the body with arms."""

from __future__ import annotations

import json
from math import radians
from pathlib import Path

import pytest

from tests.cli.test_commands import run
from tests.cli.test_walk import SMALL
from wbc import robots
from wbc.robots import TwoEndedData, Walker
from wbc.walking.report.folder import save_run
from wbc.walking.report.plots import save_plots
from wbc.walking.report.stills import save_overview
from wbc.walking.run import TwoEndedRequest, WalkRun, perform_walk
from wbc.walking.two_ended import TwoEndedStack, grapple_row


@pytest.fixture(scope="module")
def quick() -> Walker:
    """Five times the rates, so that a walk has fewer ticks."""
    return robots.walker(data=TwoEndedData.read(joint_rate=radians(20.0)), two_ended=True)


@pytest.fixture(scope="module")
def stack(quick: Walker) -> TwoEndedStack:
    return TwoEndedStack(quick, grapple_row(), 0.0125, collisions=False)


@pytest.fixture(scope="module")
def walked(quick: Walker, stack: TwoEndedStack) -> WalkRun:
    request = TwoEndedRequest(goal="3", gait="inchworm")
    return perform_walk(request, quick, stack=stack)


def test_a_run_has_a_folder_and_the_checker_is_content(walked: WalkRun, tmp_path: Path) -> None:
    assert walked.outcome == "arrived"
    files, report = save_run(walked, tmp_path)
    assert report is not None
    assert report.ok, str(report)
    told = json.loads((tmp_path / "summary.json").read_text())
    assert told["plan"]["regrasps"] == 1
    assert told["stopping"]["body"] > 0.0
    assert "theta5" not in told
    steps = json.loads((tmp_path / "plan.json").read_text())["regrasps"]
    assert [(step["arm"], step["source"], step["target"]) for step in steps] == [("arm2", "2", "3")]
    assert {"run.npz", "robot.urdf", "structure.csv", "check.txt"} <= {file.name for file in files}


def test_it_is_plotted_and_drawn(walked: WalkRun, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in SMALL.items():
        monkeypatch.setattr(name, value)
    assert walked.log is not None
    assert walked.ticks is not None
    plots = {file.name for file in save_plots(walked, walked.log, walked.ticks, tmp_path)}
    assert plots == {"holds.png", "joints.png", "rates.png", "drift.png", "speed.png", "tick_time.png"}
    picture = save_overview(walked, walked.log, tmp_path / "walk.png", (160, 120))
    assert picture.stat().st_size > 3000


def test_an_abort_in_a_swing_goes_no_farther_than_was_said(quick: Walker, stack: TwoEndedStack) -> None:
    request, asked = TwoEndedRequest("grapples", goal="3"), iter([*[False] * 400, True])
    done = perform_walk(request, quick, stack=stack, stop=lambda: next(asked))
    assert done.outcome == "interrupted"
    assert done.log is not None
    told = {figure.key: figure.value for figure in done.more}
    abort, most = told["abort"], told["stopping"]
    assert 0.01 < abort["hand"] <= abort["hand_bound"] <= most["hand"]
    assert 0.005 < abort["body"] <= abort["body_bound"] <= most["body"]
    assert abs(done.log.v[-2]).max() < 0.01


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--gait", "gallop"], "turnaround"),
        (["--from", "1", "9"], "'9'"),
        (["--to", "9"], "'9'"),
        (["--to", "1,2,x"], "'1,2,x'"),
        (["--free-start"], "No such option"),
        (["--set", "hand_radus=0.1"], "hand_radus"),
    ],
)
def test_bad_input_is_named(arguments: list[str], told: str, tmp_path: Path) -> None:
    code, _, err = run("walk", "two-ended", *arguments, "--out", tmp_path / "run")
    assert code == 2
    assert told in err
    assert not (tmp_path / "run").exists()


def test_a_way_that_is_not_there_is_refused(tmp_path: Path) -> None:
    arguments = ["two-ended", "--from", "1", "6", "--to", "3", "--no-pictures", "--out", tmp_path]
    code, _, err = run("walk", *arguments)
    assert code == 3
    assert "no posture between these holds" in err
