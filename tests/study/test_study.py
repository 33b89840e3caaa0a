"""Studies: what is asked for and refused, kills, lost workers, and what is left of them."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import distributed
import numpy as np
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from tests.repeats import repeats
from wbc import robots
from wbc.cli.app import app
from wbc.errors import BusyError, RangeError, RobotFileError, SolverError, UnknownNameError, WbcError
from wbc.study import Kept, Progress, Study, StudyError, carry_out
from wbc.study.carrying_out import connected
from wbc.study.summary import conclude

HERE = Path(__file__).with_name("scenario_file.py")
SQUARES = f"{HERE}:squares"


def squares(tmp_path: Path, seeds: int = 8) -> Study:
    return Study(scenario=SQUARES, parameters={"base": 2, "accident": str(tmp_path)}, seeds=seeds, metrics=["square"])


@pytest.mark.parametrize(
    ("content", "error", "field", "near"),
    [
        ({"scenario": "reech"}, UnknownNameError, "scenario", "reach"),
        ({"scenario": "reach", "parameters": {"pose": 3}}, UnknownNameError, "parameters.pose", "poses"),
        ({"scenario": "reach", "metrics": ["reachd"]}, UnknownNameError, "metrics", "reached"),
        ({"scenario": "reach", "sed": 3}, UnknownNameError, "sed", "seeds"),
        (
            {"scenario": "reach", "parameters": {"radius": {"low": 1, "hihg": 2, "count": 3}}},
            UnknownNameError,
            "parameters.radius",
            "high",
        ),
        ({"scenario": "reach", "parameters": {"poses": 3.5}}, RangeError, "parameters.poses", ""),
        ({"scenario": "reach", "parameters": {"poses": True}}, RangeError, "parameters.poses", ""),
        ({"scenario": "reach", "parameters": {"radius": float("nan")}}, StudyError, "parameters.radius", ""),
        ({"scenario": "reach", "parameters": {"poses": []}}, StudyError, "parameters.poses", ""),
        ({"scenario": "reach", "parameters": [1]}, StudyError, "parameters", ""),
        ({"scenario": "reach", "seeds": 0}, StudyError, "seeds", ""),
        ({"scenario": "reach", "seeds": "three"}, StudyError, "seeds", ""),
        ({"scenario": "reach", "seeds": [-1]}, RangeError, "seeds", ""),
        (
            {"scenario": "reach", "seeds": 1000, "parameters": {"poses": list(range(1001))}},
            StudyError,
            "parameters",
            "",
        ),
        ({}, StudyError, "scenario", ""),
        ({"scenario": 3}, StudyError, "scenario", ""),
        ({"scenario": SQUARES}, StudyError, "parameters.base", ""),
        ({"scenario": f"{HERE}:square"}, UnknownNameError, "scenario", "squares"),
        ({"scenario": f"{HERE}:seedless"}, RangeError, "scenario", ""),
        ({"scenario": f"{HERE}:untyped"}, RangeError, "scenario", ""),
        ({"scenario": "nowhere.py:squares"}, RobotFileError, "scenario", ""),
        ({"scenario": "wbc.nowhere:squares"}, RobotFileError, "scenario", ""),
    ],
)
def test_a_bad_schema_is_refused_by_field_and_nearest_name(
    content: dict[str, Any], error: type[WbcError], field: str, near: str
) -> None:
    with pytest.raises(error) as refused:
        Study(**content)
    assert refused.value.field == field
    assert not near or refused.value.choices[0] == near


def test_a_killed_study_goes_on_and_loses_nothing(tmp_path: Path) -> None:
    """SIGKILL in the fourth of eight trials, then half a line, as a kill in the middle of writing leaves."""
    code = (
        "import sys; from pathlib import Path; from wbc.study import Kept, Study, carry_out\n"
        "folder = Path(sys.argv[1])\n"
        "with Kept(folder, Study.read(folder / 'asked.yaml')) as kept: carry_out(kept)"
    )
    (tmp_path / "asked.yaml").write_text(json.dumps(squares(tmp_path).data()))
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path)], check=False)
    assert done.returncode == -signal.SIGKILL
    trials = tmp_path / "trials.jsonl"
    before = trials.read_text()
    assert before.count("\n") == 1 + 3
    trials.write_text(before + before.splitlines()[-1][:20])
    with Kept(tmp_path, Study.read(tmp_path / "asked.yaml")) as kept:
        progress = carry_out(kept)
        table = kept.table()
    assert (progress.before, progress.done, progress.failed) == (3, 5, 0)
    assert table["square"] == [4.0 + seed for seed in range(8)]
    assert trials.read_text().startswith(before)
    assert trials.read_text().count("\n") == 1 + 8


def test_workers_that_die_with_results_lose_no_trial(tmp_path: Path) -> None:
    """First both, when they have the results of all trials and one was fetched; then one, at random instants, also
    while it starts.
    """
    rng, killed = np.random.default_rng(1), list[int]()
    with connected(2, None) as client:
        cluster = client.cluster

        def kill(most: int) -> None:
            there = [worker.pid for worker in list(cluster.workers.values()) if worker.pid]
            for pid in rng.permutation(there)[:most].tolist():
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
                    killed.append(pid)

        def wait(state: str, there: bool) -> None:
            end = time.monotonic() + 30.0
            while any(task.state == state for task in list(cluster.scheduler.tasks.values())) is not there:
                assert time.monotonic() < end, state
                time.sleep(0.01)

        def tick(progress: Progress) -> None:
            if progress.done == 1 and not case:
                wait("processing", False)
                wait("memory", True)
                kill(2)
                wait("memory", False)

        for case in range(1 + repeats(1)):
            seeds = 40 if case else 8
            accident = threading.Timer(0.4 * rng.random(), kill, [min(case, 1)])
            (tmp_path / str(case)).mkdir()
            study = Study(scenario=SQUARES, parameters={"base": 2}, seeds=seeds, metrics=["square"])
            with Kept(tmp_path / str(case), study) as kept:
                accident.start()
                progress = carry_out(kept, address=cluster.scheduler_address, tick=tick)
                accident.join()
                assert (progress.done, progress.failed) == (seeds, 0), case
                assert kept.table()["square"] == [4.0 + seed for seed in range(seeds)], case
        assert len(killed) > repeats(1) // 2


@pytest.mark.parametrize("lost", [False, True])
def test_a_cluster_by_its_address(tmp_path: Path, lost: bool) -> None:
    """A scheduler that was there before, as that of another machine is, goes on after the study; where it is lost, the
    study ends and keeps what it has.
    """
    study = Study(scenario=SQUARES, parameters={"base": 2}, seeds=8, metrics=["square"])
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=False, protocol="tcp", dashboard_address=None
        ) as cluster,
        Kept(tmp_path, study) as kept,
    ):

        def tick(progress: Progress) -> None:
            if lost and progress.done == 2:
                cluster.close()

        if lost:
            with pytest.raises(SolverError, match="the scheduler was lost"):
                carry_out(kept, address=cluster.scheduler_address, tick=tick)
            assert len(kept.table()["square"]) == 2
            return
        progress = carry_out(kept, address=cluster.scheduler_address)
        assert (progress.done, progress.failed) == (8, 0)
        assert kept.table()["square"] == [4.0 + seed for seed in range(8)]
        assert cluster.scheduler.status.name == "running"


def test_results_failures_and_an_interrupt(tmp_path: Path) -> None:
    """A trial that raises is told of and the study goes on; Ctrl-C in the third keeps the first two."""
    study = Study(scenario=f"{HERE}:rows", seeds=4)
    with Kept(tmp_path, study) as kept:
        with pytest.raises(KeyboardInterrupt):
            carry_out(kept)
        with pytest.raises(BusyError):
            Kept(tmp_path, study)
        summary = conclude(kept)
    assert (summary["trials"], summary["finished"], summary["failed"], summary["rows"]) == (4, 1, 1, 3)
    assert "ZeroDivisionError: seed 1 (scenario_file.py:" in summary["failures"][0]
    assert summary["metrics"] == {
        "x": {"count": 3.0, "mean": 1.0, "p5": pytest.approx(0.1), "median": 1.0, "p95": pytest.approx(1.9)},
        "y": {"count": 0.0},
    }
    read = pq.read_table(tmp_path / "results.parquet")
    assert json.loads(read.schema.metadata[b"study"]) == json.loads((tmp_path / "study.json").read_text())
    table = read.to_pydict()
    assert table == {"trial": [0] * 3, "seed": [0] * 3, "x": [0.0, 1.0, 2.0], "y": [None] * 3}
    assert (tmp_path / "study.png").stat().st_size > 1000


def test_trials_of_another_scenario_or_a_damaged_file_are_refused(tmp_path: Path) -> None:
    with Kept(tmp_path, Study(scenario="reach")):
        pass
    with pytest.raises(RangeError):
        Kept(tmp_path, Study(scenario="ik"))
    file = tmp_path / "trials.jsonl"
    file.write_text(file.read_text() + "{}\n")
    with pytest.raises(RobotFileError):
        Kept(tmp_path, Study(scenario="reach"))


def test_another_metric_is_computed_again_and_more_seeds_are_added(tmp_path: Path) -> None:
    with Kept(tmp_path, Study(scenario=SQUARES, parameters={"base": 2}, seeds=2, metrics=["square"])) as kept:
        carry_out(kept)
    with Kept(tmp_path, Study(scenario=SQUARES, parameters={"base": 2}, seeds=3, metrics=["square"])) as kept:
        assert carry_out(kept).before == 2
    with Kept(tmp_path, Study(scenario=SQUARES, parameters={"base": [2, 3]}, seeds=[2])) as kept:
        assert carry_out(kept).before == 0
        assert kept.table() == {
            "trial": [0, 1], "seed": [2, 2], "base": [2.0, 3.0], "square": [6.0, 11.0], "kind": [1.0, 1.0]
        }  # fmt: skip


def test_reach_and_sets_of_inverse_kinematics_agree_with_the_robot() -> None:
    """Places out of reach are not reached, targets made from configurations are."""
    from wbc.study.scenarios import ik, manipulability, reach

    found = reach(seed=1, threads=1, robot="ur5", poses=20, radius=3.0, restarts=1)
    far = np.linalg.norm([found["x"], found["y"], np.array(found["z"]) - 0.089], axis=0) > 1.1
    assert far.sum() > 5
    assert not np.array(found["reached"])[far].any()
    assert ik(seed=1, threads=1, robot="ur5", targets=5)["solved"] == 1.0
    moved = manipulability(seed=1, robot="ur5", samples=5)
    robot = robots.load("ur5")
    low, high = robot.limits.position_lower, robot.limits.position_upper
    q = low + np.random.default_rng(1).random((5, 6))[0] * (high - low)
    J = robot.jacobian(q, robot.frames["tip"])
    J[:3] /= robot.characteristic_length
    assert moved["measure"][0] == pytest.approx(abs(np.linalg.det(J)), rel=1e-9)


def test_layouts_are_planned_between_places_that_seeds_draw() -> None:
    from wbc.study.scenarios import layouts

    few = layouts(seed=2, least=0.1, most=0.4, speed=0.05)
    assert few["planned"] == 1.0
    assert 0.1 <= few["removed"] <= 0.4
    # The longest way on 25 x 24 holds, and the shortest that is drawn
    assert 6.0 * 0.235 / 0.05 < few["duration"] < 3600.0
    assert 2.0 <= few["regrasps"] < 60.0
    none = layouts(seed=2, least=0.995, most=0.995)
    assert none["planned"] == 0.0
    assert np.isnan([none["regrasps"], none["duration"]]).all()


def test_the_command(tmp_path: Path) -> None:
    file, folder = tmp_path / "asked.yaml", tmp_path / "run"
    (tmp_path / "mine.py").write_text(HERE.read_text())
    file.write_text("scenario: mine.py:squares\nparameters: {base: {low: 0, high: 1, count: 3}}\nseeds: 2\n")
    done = CliRunner().invoke(app, ["study", str(file), "--out", str(folder), "--json"])
    assert done.exit_code == 0, done.stderr
    assert json.loads(done.stdout)["metrics"]["square"]["mean"] == pytest.approx(0.5 + (0 + 0.25 + 1) / 3)
    again = CliRunner().invoke(app, ["study", "--resume", str(folder)])
    assert again.exit_code == 0
    assert "6 of 6 trials" in again.stdout
    fewer = CliRunner().invoke(app, ["study", str(file), "--seeds", "1", "--out", str(tmp_path / "fewer")])
    assert "3 of 3 trials" in fewer.stdout
    resumed = ["--resume", str(folder)]
    for wrong in ([str(file), "--out", str(folder)], ["reech"], [], ["--resume", str(tmp_path)],
                  [str(file), "--seeds", "0"], [*resumed, "--seeds", "2"], [*resumed, "--force"]):  # fmt: skip
        refused = CliRunner().invoke(app, ["study", *wrong])
        assert refused.exit_code == 2, wrong
        assert "error:" in refused.stderr
