"""``wbc published ikor`` and ``wbc ik explore``: what they print and write, and what they refuse."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from wbc.cli.app import app
from wbc.published.ikor import film

RUN = CliRunner(env={"COLUMNS": "200"})
LINE = "\n".join(f"{-0.88 + 0.002 * k} -0.356 {0.635 - 0.002 * k}" for k in range(1, 11))
POINTS = f"0 180 0 0 0 90 0\n10\n{LINE}\n"


def test_a_published_run_has_printed_norms_beside(tmp_path: Path) -> None:
    done = RUN.invoke(app, ["published", "ikor", "--case", "1", "--config", "3x7", "--out", str(tmp_path)])
    assert done.exit_code == 0
    assert "0.103820" in done.output
    assert "0.311383  0.3113" in done.output
    figures = json.loads((tmp_path / "summary.json").read_text())
    assert figures["1-3x7"]["values"] == 191
    assert figures["1-3x7"]["rms"] < 3e-4
    with (tmp_path / "norms.csv").open() as stream:
        assert len(list(csv.DictReader(stream))) == 195
    assert (tmp_path / "norms.png").stat().st_size > 5000
    again = RUN.invoke(app, ["published", "ikor", "--case", "1", "--config", "3x7", "--out", str(tmp_path)])
    assert again.exit_code == 2
    assert "--force" in again.output


@pytest.mark.parametrize("resolver", ["fsp", "stack"])
def test_a_run_from_files(resolver: str, tmp_path: Path) -> None:
    points, spheres, out = tmp_path / "TrajectoryPts", tmp_path / "sphere_data", tmp_path / "run"
    points.write_text(POINTS)
    spheres.write_text("-0.5 -0.356 0.55 0.08\n0 0 0 0\n")
    files = ["--trajectory", str(points), "--spheres", str(spheres), "--out", str(out)]
    done = RUN.invoke(
        app, ["published", "ikor-run", *files, "--method", "3", "--resolver", resolver, "--ahead", "--margin", "0.002"]
    )
    assert done.exit_code == 0, done.output
    figures = json.loads((out / "summary.json").read_text())
    assert (figures["stop"], figures["steps"]) == ("all points done", 10)
    assert figures["clearance"] > 0.0
    assert len((out / "CheezyAngles").read_text().splitlines()) == 11


def test_a_line_and_a_jacobian(tmp_path: Path) -> None:
    done = RUN.invoke(app, ["published", "ikor-run", "--line", "-0.8,-0.356,0.6", "--out", str(tmp_path / "run")])
    assert done.exit_code == 0, done.output
    assert len((tmp_path / "run" / "CheezyAngles").read_text().splitlines()) == 10
    data = tmp_path / "FSP_data"
    data.write_text("2 3\n1 0 0\n0 1 1\n0.5\n0.25\n")
    done = RUN.invoke(app, ["published", "ikor-space", str(data)])
    assert done.exit_code == 0
    assert "blocked: rank 2, 2 vectors" in done.output
    assert "0.50000000   0.12500000   0.12500000" in done.output
    data.write_text("2 3\n1 0 0\n0 1\n0.5\n0.25\n")
    assert "FSP_data:3" in RUN.invoke(app, ["published", "ikor-space", str(data)]).output


def test_a_planar_arm_goes_round_a_polygon_on_an_arc(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(film, "MOST", 2)
    (tmp_path / "polygon_data").write_text("0.45 0.35 0.6 0.35 0.6 0.55\n")
    files = ["--polygons", str(tmp_path / "polygon_data"), "--out", str(tmp_path / "run"), "--film", "gif"]
    way = [
        "--robot",
        "planar",
        "--rows",
        "x,y,yaw",
        "--arc",
        "0,0,40,20",
        "--method",
        "2",
        "--ahead",
        "--margin",
        "0.01",
    ]
    done = RUN.invoke(app, ["published", "ikor-run", *way, *files])
    assert done.exit_code == 0, done.output
    figures = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert (figures["stop"], 0.01 < figures["clearance"] < 0.2) == ("all points done", True)
    assert 0.0 < figures["median_step_ms"] <= figures["longest_step_ms"]
    assert (tmp_path / "run" / "polygon_data").read_text() == "0.45 0.35 0.6 0.35 0.6 0.55\n"
    assert (tmp_path / "run" / "film.gif").stat().st_size > 3000


def test_a_line_between_poses_by_weights_and_a_criterion(tmp_path: Path) -> None:
    runs = {}
    for name, more in {
        "plain": [],
        "heavy": ["--weights", "1,1,1,9,1,1,1"],
        "calm": ["--criterion", "acceleration"],
    }.items():
        ends = ["--start", "-0.7,-0.3,0.5", "--line", "-0.8,-0.2,0.6,30,10,0", *more]
        done = RUN.invoke(app, ["published", "ikor-run", *ends, "--rows", "x,y,z", "--out", str(tmp_path / name)])
        assert done.exit_code == 0, done.output
        runs[name] = np.loadtxt(tmp_path / name / "CheezyAngles")
    same = [run[0] for run in runs.values()]
    np.testing.assert_array_equal(same[0], same[1])
    assert np.ptp(runs["heavy"][:, 3]) < 0.5 * np.ptp(runs["plain"][:, 3])
    # Before the first step it stood, and the least change is the least step
    apart = np.abs(runs["calm"] - runs["plain"]).max(axis=1)
    assert (apart[1] < 1e-8, apart[-1] > 0.1) == (True, True)


def test_switches_and_a_course_beyond_the_published_length(tmp_path: Path) -> None:
    points, out = tmp_path / "TrajectoryPts", tmp_path / "run"
    rows = "\n".join(f"{-1.49 + 1e-4 * k} -0.356 {0.935 - 1e-4 * k}" for k in range(1, 1101))
    points.write_text(f"0 180 0 0 0 90 0 0 0 0\n1100\n{rows}\n")
    way = ["published", "ikor-run", "--base", "holonomic", "--trajectory", str(points)]
    done = RUN.invoke(app, [*way, "--out", str(tmp_path / "short")])
    assert done.exit_code == 1
    assert "100 points left out" in done.output
    switches = ["--switch", "300:platform=off,orientation=on", "--switch", "600:platform=on"]
    done = RUN.invoke(app, [*way, "--max-points", "2000", *switches, "--out", str(out)])
    assert done.exit_code == 0, done.output
    q = np.loadtxt(out / "CheezyAngles")
    assert len(q) == 1101
    still = np.abs(np.diff(q[:, 7:], axis=0)).max(axis=1) == 0.0
    np.testing.assert_array_equal(np.flatnonzero(still), np.arange(299, 599))


def test_an_operators_rates_and_a_film(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(film, "MOST", 2)
    rates, out = tmp_path / "rates.csv", tmp_path / "run"
    rates.write_text("time,pair,r1,r2,r3,r4,r5,r6\n0,tool,0.05\n0.1,base,0,0,0,0.1\n0.2,\n")
    done = RUN.invoke(
        app, ["published", "ikor-run", "--rates", str(rates), "--base", "holonomic", "--film", "gif", "--out", str(out)]
    )
    assert done.exit_code == 0, done.output
    assert len((out / "CheezyAngles").read_text().splitlines()) == 11
    assert (out / "film.gif").stat().st_size > 5000
    rates.write_text("time,pair,r1,r2,r3,r4,r5,r6\n0,arm,0.05\n1,\n")
    done = RUN.invoke(app, ["published", "ikor-run", "--rates", str(rates), "--out", str(tmp_path / "other")])
    assert done.exit_code == 2
    assert "arm" in done.output
    assert "tool" in done.output


def test_a_published_run_with_what_was_not_published(tmp_path: Path) -> None:
    spheres = tmp_path / "sphere_data"
    spheres.write_text("-0.5 -0.356 0.55 0.08\n")
    arguments = ["published", "ikor", "--case", "1", "--config", "3x7", "--consistent", "--step-limit", "0.2"]
    done = RUN.invoke(app, [*arguments, "--spheres", str(spheres), "--method", "2", "--out", str(tmp_path / "run")])
    assert done.exit_code == 0, done.output
    with (tmp_path / "run" / "norms.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert all(float(row["norm"]) <= 7 * 0.2**2 * (1 + 1e-6) for row in rows)
    assert all(np.isfinite(float(row["clearance"])) for row in rows)


def test_a_bad_line_is_named(tmp_path: Path) -> None:
    points = tmp_path / "TrajectoryPts"
    points.write_text(POINTS.replace("10\n", "10\n-0.88 O.1 0.6\n", 1))
    done = RUN.invoke(app, ["published", "ikor-run", "--trajectory", str(points), "--out", str(tmp_path / "run")])
    assert done.exit_code == 2
    assert "TrajectoryPts:3" in done.output
    assert "O.1" in done.output
    assert not (tmp_path / "run").exists()


def test_a_run_that_ends_early_says_why(tmp_path: Path) -> None:
    points = tmp_path / "TrajectoryPts"
    points.write_text("0 0 0 0\n1\n2.0 0 0\n")
    way = ["--trajectory", str(points), "--out", str(tmp_path / "run")]
    arguments = ["published", "ikor-run", "--robot", "planar", "--rows", "x,y", *way]
    done = RUN.invoke(app, arguments)
    assert done.exit_code == 1
    assert "the task contradicts itself" in done.output


def test_explore_panda(tmp_path: Path) -> None:
    at = "0.3,0.2,0.1,-1.8,0.2,1.9,0.4"
    way = ["--seeds", "0", "--to", "0.5,0.3,0.5", "--points", "8", "--out", str(tmp_path)]
    done = RUN.invoke(app, ["ik", "explore", "panda", "--start", at, *way])
    assert done.exit_code == 0, done.output
    assert "rank 6, 1 self-motions" in done.output
    figures = json.loads((tmp_path / "summary.json").read_text())
    assert figures["self_motions"] == 1
    assert figures["along"]["duration"] > 0.0
    curve = np.load(tmp_path / "self_motion.npz")["piece1"]
    assert curve.shape[1] == 7
    assert (tmp_path / "self_motion.png").stat().st_size > 5000
    assert (tmp_path / "law.npz").exists()
    kept = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    again = RUN.invoke(app, ["ik", "explore", "panda", "--start", at, "--seeds", "0", "--out", str(tmp_path)])
    assert (again.exit_code, "--force" in again.output) == (2, True)
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == kept
    # Forced, nothing is left of the run before
    done = RUN.invoke(app, ["ik", "explore", "panda", "--start", at, "--seeds", "0", "--out", str(tmp_path), "--force"])
    assert done.exit_code == 0, done.output
    assert sorted(file.name for file in tmp_path.iterdir()) == ["self_motion.npz", "self_motion.png", "summary.json"]
