"""Trials: what is asked of errors in the object's frame, the operator's path, the judgement, and the command."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

import wbc
from tests.models import frame_jacobian
from wbc.cli.app import app
from wbc.moving_target import pictures
from wbc.moving_target.knowledge import Knowledge, Measurement
from wbc.moving_target.motions import swing
from wbc.moving_target.study import TargetStudy, grasp, outcome, peg, trials
from wbc.moving_target.trial import Bench, TargetTrial, gap
from wbc.track import scene

RUN = CliRunner(env={"COLUMNS": "200"})


def study(motion: str, **measurement: float) -> TargetStudy:
    return peg(wbc.robots.load("panda"), "panda_hand_tcp", motion, 1.5e-3, Measurement(**measurement))  # type: ignore[arg-type]


@cache
def bench() -> Bench:
    return Bench(study("swing").scenario)


@cache
def station_arm() -> TargetStudy:
    return grasp(wbc.robots.load("ssrms"), "tip", "tumble", Measurement((5e-3, 1e-3)))


@cache
def trial(motion: str, kind: Knowledge) -> TargetTrial:
    return bench().run(study(motion).moves(0), kind, np.random.default_rng(0))


def test_fed_forward_the_published_swing_leaves_under_a_tenth_of_a_millimetre() -> None:
    found = trial("swing", Knowledge.TWIST)
    assert found.success
    assert np.linalg.norm(found.error[:, :3], axis=1).max() < 1e-4
    assert np.abs(found.known).max() < 1e-12


def test_late_and_noisy_the_filter_leaves_under_a_millimetre() -> None:
    found = trial("swing", Knowledge.ESTIMATED)
    assert found.success
    assert np.linalg.norm(found.error[found.working, :3], axis=1).max() < 1e-3
    assert outcome(Knowledge.NONE, [trial("swing", Knowledge.NONE)]).successes == 0


def test_the_operators_stream_is_the_same_for_an_object_at_rest_and_one_that_moves() -> None:
    """From the first tick to the last, where the object at rest is where the other one is at first."""
    moving, sea = trial("sea", Knowledge.TWIST), study("sea").moves(0)
    still = swing(sea.at(0.0).pose)
    rest = bench().run(replace(still, amplitude=0.0 * still.amplitude), Knowledge.TWIST, np.random.default_rng(0))
    assert rest.success
    assert moving.success
    assert np.linalg.norm(np.ptp(moving.goal[:, :3], axis=0)) > 0.02
    assert np.abs(rest.command - moving.command).max() < 1e-12


def test_a_trial_is_its_program_and_the_same_again() -> None:
    names = [step.name or step.step for step in bench().scenario.program.steps]
    assert names == ["move", "align", "go in", "stay", "retreat"]
    short = Bench(replace(bench().scenario, timeout=0.5), backend="vm")
    once, again = (short.run(study("swing").moves(0), Knowledge.ESTIMATED, np.random.default_rng(0)) for _ in range(2))
    assert np.array_equal(once.q, again.q)
    assert (once.success, once.reason) == (False, "move: not done in time")


def test_an_object_that_is_lost_ends_the_program() -> None:
    """Measurements end for good in the first second: the frame comes to rest, and the trial is given up."""
    one = study("swing", dropouts=1.0, dropout=1e3)
    found = Bench(one.scenario, backend="vm").run(one.moves(0), Knowledge.ESTIMATED, np.random.default_rng(5))
    assert not found.success
    assert found.reason.endswith("lost above 0.5")
    policy = one.scenario.policy
    assert found.t[-1] > policy.predict + policy.hold - 1.1


def test_walls_of_a_hole() -> None:
    """At depth d the axis is off by e at its end and by e - d tilt at the mouth."""
    clearance = 1e-3
    for error, left in (
        ((0.9e-3, 0, 0, 0, 0, 0), 0.1e-3),
        ((1.1e-3, 0, 0, 0, 0, 0), -0.1e-3),
        ((0, 0, 5e-3, 0, 0, 1.0), 1e-3),
        ((0, 0, 0, 0, 0.03, 0), -0.2e-3),
        ((0.6e-3, 0, 0, 0, 0.03, 0), 0.4e-3),
        ((-0.6e-3, 0, 0, 0, 0.03, 0), -0.8e-3),
        ((0, 0.6e-3, 0, -0.03, 0, 0), 0.4e-3),
    ):
        assert gap(np.array(error, dtype=float), 0.04, clearance) == pytest.approx(left, abs=1e-12)


def test_an_arm_starts_where_it_can_turn_about_every_axis_within_its_rates() -> None:
    """The Space Station's arm: each of some hundred random axes takes less than 0.9 of the rate limits at first."""
    robot = wbc.robots.load("ssrms")
    jacobian = frame_jacobian(robot, "tip", station_arm().scenario.start)
    axes = np.random.default_rng(0).normal(size=(100, 3))
    spins = np.radians(3.0) * axes / np.linalg.norm(axes, axis=1)[:, None]
    needed = np.abs(np.linalg.pinv(jacobian)[:, 3:] @ spins.T) / robot.limits.velocity[:, None]
    assert needed.max() < 0.9


def test_the_arm_grasps_a_body_that_tumbles() -> None:
    """One axis; the bench has 60, which all end well."""
    found = trials(station_arm(), 1, [Knowledge.ESTIMATED])[Knowledge.ESTIMATED][0]
    assert found.success
    assert found.rates.max() <= 1.0


def test_outcomes_and_a_stop_between_trials() -> None:
    asked: list[int] = []
    found = trials(study("swing"), 3, [Knowledge.TWIST], stop=lambda: len(asked) == 1, told=lambda *_: asked.append(1))
    figures = outcome(Knowledge.TWIST, found[Knowledge.TWIST])
    assert (figures.done, figures.successes, figures.reasons) == (1, 1, {})
    assert figures.time[0] == pytest.approx(5.79, abs=0.3)


def test_the_command_leaves_a_folder(tmp_path: Path) -> None:
    asked = ["moving-target", "--motion", "swing", "--runs", "1", "--knowledge", "twist", "--no-film"]
    done = RUN.invoke(app, [*asked, "--out", str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert "1 of 1" in done.output
    figures = json.loads((tmp_path / "summary.json").read_text())
    assert figures["outcomes"]["twist"]["rms"] < 1e-4
    for name in ("trials.csv", "first.npz", "error.png", "object.png", "trials.png"):
        assert (tmp_path / name).stat().st_size > 100
    again = RUN.invoke(app, [*asked, "--out", str(tmp_path)])
    assert again.exit_code == 2
    assert "--force" in again.output
    wrong = RUN.invoke(app, ["moving-target", "--motion", "see"])
    assert wrong.exit_code == 2
    assert "sea" in wrong.output


def test_a_film_has_both_trials(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two small pictures of the hand alone."""
    one, hand = study("swing"), scene.link_meshes(wbc.robots.load("panda"))[-1:]
    for module, name, value in (
        (pictures, "SIZE", (60, 40)),
        (pictures, "MOST", 2),
        (scene, "SUPERSAMPLING", 1),
        (scene, "link_meshes", lambda _: hand),
    ):
        monkeypatch.setattr(module, name, value)
    pair = {kind: trial("swing", kind) for kind in (Knowledge.NONE, Knowledge.TWIST)}
    file = pictures.film(one, pair, tmp_path / "film.gif")
    assert file is not None
    with Image.open(file) as image:
        assert (image.size, getattr(image, "n_frames", 1)) == ((120, 40), 2)
        pixels = np.asarray(image.convert("RGB"))
    assert pixels.std() > 10
    assert pictures.film(one, pair, tmp_path / "none.gif", stop=lambda: True) is None
