"""``wbc coordinates drive`` as a user types it."""

from __future__ import annotations

import csv
import functools
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tests.cli.test_commands import run as wbc_command
from tests.formats.runs import ticks_and_reasons
from tests.processes import processor_time
from wbc.log import load

run = functools.partial(wbc_command, "coordinates", "drive")


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
    given = ("--rates", orders, "--mode", "M4", "--at", at, "--out", tmp_path / "run", "--backend", "vm")
    assert run("spherical_4r", *given, "--mcap")[0] == 0
    assert ticks_and_reasons(tmp_path / "run" / "ticks.mcap")[0] == 50
    assert run("spherical_4r", *given[:-4], "--mcap")[0] == 2
    assert {"log.csv", "log.npz", "report.html"} <= {file.name for file in (tmp_path / "run").iterdir()}
    columns, written = load(tmp_path / "run"), list(csv.DictReader(log.open()))
    assert columns.units["v.joint2"] == "rad/s"
    for name, head in (("q.joint1", "q joint1"), ("v.joint3", "v joint3"), ("met.0", "met 1"), ("lost", "lost")):
        np.testing.assert_allclose(columns[name], [float(row[head]) for row in written], rtol=1e-5)
    assert columns["pair.tip | beta"].any()
    assert columns["pair.changing"].any()


@pytest.mark.parametrize(("robot", "mode", "part"), [("ssrms", "M6", "second arm"), ("spdm", "M7", "carrier")])
def test_a_mode_without_its_parts_says_what_is_missing(robot: str, mode: str, part: str, tmp_path: Path) -> None:
    orders = tmp_path / "orders.csv"
    orders.write_text("time,pair,r1,r2,r3,r4,r5,r6\n0\n1\n")
    code, _, err = run(robot, "--rates", orders, "--mode", mode)
    assert code == 2
    assert f"the robot has no {part} (got '{mode} on {robot}')" in err


def test_what_is_lost_is_told_and_logged(tmp_path: Path) -> None:
    orders, log = tmp_path / "orders.csv", tmp_path / "log.csv"
    orders.write_text("time,pair,r1,r2,r3,r4,r5,r6\n0,xi | joint2,0,0.02\n0.4,,0,0.02\n3\n")
    at = "0.3,1.5588,-0.5,1.2,0.7,-0.6,0.9"
    given = ("--rates", orders, "--mode", "M1", "--at", at, "--log", log, "--backend", "vm")
    code, out, err = run("ssrms", *given)
    assert code == 0
    assert "warning: this start is 0.012 rad from where 'xi | alpha' is singular; better: 'xi | " in err
    assert "better: xi | " in err
    assert "asked (0, 0.02, 0, 0, 0, 0), met (" in err
    assert "this pair is near a locus of its own, sigma" in err
    assert "lost: more than 1 % of the command in " in out
    assert "rad from joint2 = 1.571, where the pair loses rank" in out
    with log.open() as file:
        ticks = list(csv.DictReader(file))
    worst = max((t for t in ticks if "rise or fall" not in t["why"]), key=lambda tick: float(tick["lost"]))
    assert float(worst["lost"]) > 0.5
    assert worst["why"]
    assert all(tick["advised"] for tick in ticks)


def test_without_a_start_a_regular_one_is_taken(tmp_path: Path) -> None:
    """The neutral configuration of the Space Station arm is singular; of a Panda without modes M1 and M2 are taken."""
    orders = tmp_path / "orders.csv"
    orders.write_text("time,pair,r1,r2,r3,r4,r5,r6\n0,,0.001\n0.1\n")
    for robot, pair in (("ssrms", "xi | alpha"), ("panda", "pose | psi"), ("ur5", "pose | nothing")):
        code, out, err = run(robot, "--rates", orders, "--backend", "vm")
        assert code == 0
        assert "from --at=" in err
        assert "warning" not in err
        assert f"{pair}, solved, sigma 0." in err
        assert "5 ticks: 5 solved" in out


#: The command; of a shell in the background it would inherit that interrupts are ignored
CHILD = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
from wbc import cli
cli.main()
"""


@pytest.mark.parametrize("waits", [["--realtime"], []])
def test_an_interrupted_drive_writes_its_log(waits: list[str], tmp_path: Path) -> None:
    """Ctrl-C in a process of its own, which waits for its next tick or computes all the time: exit code 130, and a log
    of whole rows.
    """
    orders, log = tmp_path / "orders.csv", tmp_path / "log.csv"
    orders.write_text("time,pair,r1,r2,r3,r4,r5,r6\n0,,0.01\n1000\n")
    given = ("--rates", orders, "--at", "0.3,0.5,-0.7,1.1", *waits, "--log", log, "--backend", "vm")
    command = [sys.executable, "-c", CHILD, "coordinates", "drive", "spherical_4r", *map(str, given)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stderr is not None
        # That it starts, and what it does first
        for _ in range(2):
            process.stderr.readline()
        time.sleep(0.5)
        # A busy machine may not have run it meanwhile
        begun = processor_time(process.pid)
        while process.poll() is None and processor_time(process.pid) < begun + 0.05:
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=30)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 130
    assert "ended by Ctrl-C" in out
    with log.open() as file:
        ticks = list(csv.DictReader(file))
    assert len(ticks) > 3
    assert all(None not in tick.values() for tick in ticks)


def test_arms_without_a_mode_or_a_base(tmp_path: Path) -> None:
    orders = tmp_path / "orders.csv"
    orders.write_text("time,pair,r1,r2,r3,r4,r5,r6\n0\n1\n")
    # One that floats is driven with its base held
    code, _, err = run("a1", "--rates", orders)
    assert (code, "a1 floats: its base is held" in err) == (0, True)
    code, _, err = run("ur5", "--rates", orders, "--mode", "M2")
    assert (code, "the robot has no joint beyond those that its tip takes" in err) == (2, True)
