"""``wbc drive`` as a user types it."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
from typer.testing import CliRunner

from wbc.cli.app import app


def run(*arguments: str | Path) -> tuple[int, str, str]:
    """(exit code, standard output, standard error) of ``wbc drive ARGUMENTS``."""
    result = CliRunner(env={"COLUMNS": "200"}).invoke(app, ["drive", *map(str, arguments)])
    return result.exit_code, result.stdout, result.stderr


def test_a_file_of_orders(tmp_path: Path) -> None:
    orders, log = tmp_path / "orders.csv", tmp_path / "log.csv"
    orders.write_text("time,pair,r1,r2,r3,r4,r5,r6\n0,,0.02\n0.5,tip | beta,0.02\n1\n")
    at = "0.3,0.5,-0.7,1.1"
    code, out, err = run("spherical_4r", "--rates", orders, "--mode", "M4", "--at", at, "--log", log, "--backend", "vm")
    assert code == 0
    assert "50 ticks: 50 solved" in out
    assert "1 changes of pairs" in out
    assert "tip | beta (changing), solved" in err
    assert len(log.read_text().splitlines()) == 51


#: Pair and rates of a mode, and joints that may move
ARM1, ARM2, CARRIER = (tuple(f"{arm}_joint{k}" for k in range(1, 8)) for arm in ("arm1", "arm2", "carrier"))
MODES = {
    "M1": ("arm1_xi | arm1_alpha", "0.004,0,0.002,0,0,0.001", ARM1),
    "M2": ("arm1_elbow x | arm1_xi", "0.002", ARM1),
    "M3": ("arm1_elbow | joints beyond, arm1_alpha", "0.002,0,0", ARM1[:3]),
    "M4": ("arm1_tip | arm1_alpha, wrist", "0.004,0.001,0", ARM1[:4]),
    "M5": ("arm2_joint3 | other joints", "0.01", ARM2[2:3]),
    "M6": ("arm2_xi | the rest", "0.004,0,0,0,0,0", ARM2),
    "M7": ("carrier_xi | hands", "0.004,0,0,0,0,0", (*ARM1, *ARM2, *CARRIER)),
    "M8": ("arm1_elbow | arm1_xi", "0.002,0,0", ARM1),
}
ARM = "0.3,0.4,-0.5,1.2,0.7,-0.6,0.9"


@pytest.mark.parametrize("mode", MODES)
def test_every_mode_is_driven_from_a_file(mode: str, tmp_path: Path) -> None:
    """15 joints, with a carrier 22: what the mode commands moves, joints that it brakes do not."""
    robot, starts = ("spdm_on_ssrms", (ARM, ARM, ARM, "0.2")) if mode == "M7" else ("spdm", ("0.2", ARM, ARM))
    pair, rates, moving = MODES[mode]
    orders, log = tmp_path / "orders.csv", tmp_path / "log.csv"
    orders.write_text(f'time,pair,r1,r2,r3,r4,r5,r6\n0,"{pair}",{rates}\n0.5\n')
    given = ("--rates", orders, "--mode", mode, "--at", ",".join(starts), "--log", log, "--backend", "vm")
    code, out, _ = run(robot, *given)
    assert code == 0
    assert "ticks: " in out
    assert out.split("ticks: ")[1].split(";")[0].endswith(" solved")
    with log.open() as file:
        ticks = list(csv.DictReader(file))
    assert ticks[-1]["pair"] == pair
    gone = {name[2:]: float(ticks[-1][name]) - float(ticks[0][name]) for name in ticks[0] if name.startswith("q ")}
    moved = {name for name, x in gone.items() if abs(x) > 1e-7}
    assert moved
    assert moved <= set(moving)


@pytest.mark.parametrize(("robot", "mode", "part"), [("ssrms", "M6", "second arm"), ("spdm", "M7", "carrier")])
def test_a_mode_without_its_parts_says_what_is_missing(robot: str, mode: str, part: str, tmp_path: Path) -> None:
    orders = tmp_path / "orders.csv"
    orders.write_text("time,pair,r1,r2,r3,r4,r5,r6\n0\n1\n")
    code, _, err = run(robot, "--rates", orders, "--mode", mode)
    assert code == 2
    assert f"the robot has no {part} (got '{mode} on {robot}')" in err


def test_bad_input(tmp_path: Path) -> None:
    assert run("spherical_4r")[0] == 2
    assert run("spherical_4r", "--rates", tmp_path / "none.csv")[0] == 2
    code, _, err = run("spherical_4r", "--keys", "--mode", "M4")
    assert code == 2
    assert "terminal" in err
