"""A run of the two-ended arm goes on from any state of its log, as if it had not been ended."""

from __future__ import annotations

import pathlib
from dataclasses import replace
from math import radians

import numpy as np
import pytest

import wbc
from wbc.errors import RangeError
from wbc.robots import TwoEndedData, Walker
from wbc.walking.checker import check_walk
from wbc.walking.log.log import CLOSED, OPENING
from wbc.walking.loop.state import Tick
from wbc.walking.report.folder import rules_of, save_run
from wbc.walking.run import ResumeRequest, WalkRun, perform_walk
from wbc.walking.run.request import TwoEndedRequest
from wbc.walking.two_ended import TwoEndedWalk


@pytest.fixture(scope="module")
def arm() -> Walker:
    """Ten times the rates, so that a walk has fewer ticks."""
    return wbc.robots.walker(data=TwoEndedData.read(joint_rate=radians(40.0)), two_ended=True)


@pytest.fixture(scope="module")
def walked(arm: Walker, tmp_path_factory: pytest.TempPathFactory) -> tuple[WalkRun, pathlib.Path]:
    folder = tmp_path_factory.mktemp("run")
    run = perform_walk(TwoEndedRequest(goal="3"), arm)
    assert run.outcome == "arrived"
    save_run(run, folder, check=False)
    return run, folder


@pytest.mark.parametrize("part", [0.3, 0.81])
def test_a_swing_goes_on_as_it_was(
    arm: Walker, walked: tuple[WalkRun, pathlib.Path], part: float, tmp_path: pathlib.Path
) -> None:
    run, folder = walked
    assert run.log is not None
    at = part * float(run.log.t[-1])
    again = perform_walk(ResumeRequest(folder, at), arm)
    assert (again.outcome, again.log is not None) == ("arrived", True)
    assert again.log is not None
    assert len(again.log) == len(run.log)
    np.testing.assert_allclose(again.log.q, run.log.q, atol=2e-4)
    # At ten times the rates the elbow moves too far in a tick for these
    rules = replace(rules_of(arm), sub_samples=1, twist_speed=0.05, jump_speed=0.1, jump_rate=0.1)
    report = check_walk(again.log, arm.urdf(tmp_path / "robot.urdf"), again.structure, rules)
    assert report.ok, str(report)


def test_a_hand_that_opens_opens_and_another_goal_comes_after_the_swing(
    arm: Walker, walked: tuple[WalkRun, pathlib.Path]
) -> None:
    run, folder = walked
    assert run.log is not None
    row = int(np.flatnonzero((run.log.hand_state == OPENING).any(axis=1))[3])
    again = perform_walk(ResumeRequest(folder, float(run.log.t[row]), ("4",)), arm)
    assert again.outcome == "arrived"
    assert again.log is not None
    last = [again.log.hold_id[hold] for hold in again.log.hand_hold[-1]]
    assert (again.log.hand_state[-1] == CLOSED).all()
    assert "4" in last


@pytest.mark.parametrize("later", [0.0, 0.2, 1.0])
def test_a_hand_that_comes_out_of_the_air_stops_and_goes_on(
    arm: Walker, tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch, later: float
) -> None:
    tick = TwoEndedWalk.tick

    def vanishing(self: TwoEndedWalk) -> Tick:
        swinging = self.swinging
        if swinging is not None and swinging.clock > 1.0 and "4" in self.structure.ids:
            self.vanish(["4"])
            self.go_to("5")
        return tick(self)

    with monkeypatch.context() as patched:
        patched.setattr(TwoEndedWalk, "tick", vanishing)
        run = perform_walk(TwoEndedRequest(goal="4"), arm)
    save_run(run, tmp_path, check=False)
    assert run.log is not None
    gone = float(run.log.t[np.argmax(run.log.hand_hold.min(axis=1) < 0)])
    again = perform_walk(ResumeRequest(tmp_path, gone + later, ("5",)), arm)
    assert again.outcome == "arrived", again.reason
    assert again.log is not None
    rules = replace(rules_of(arm), sub_samples=1, twist_speed=0.05, jump_speed=0.1, jump_rate=0.1)
    report = check_walk(again.log, arm.urdf(tmp_path / "robot.urdf"), again.structure, rules)
    assert report.ok, str(report)
    assert "4" in again.structure.ids


def test_what_is_not_of_this_arm_is_refused(arm: Walker, walked: tuple[WalkRun, pathlib.Path]) -> None:
    _, folder = walked
    with pytest.raises(RangeError, match="expected a time"):
        perform_walk(ResumeRequest(folder, 1e6), arm)
    with pytest.raises(RangeError, match="another robot"):
        perform_walk(ResumeRequest(folder), wbc.robots.walker(two_ended=True))
