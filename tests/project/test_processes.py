"""The suite itself: whatever a test starts ends with it."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

from tests.project.layout import ROOT

#: Starts with what every file of tests below has: children that tell their numbers, and a short patience with them
HEAD = """
import multiprocessing, os, pathlib, signal, subprocess, sys, time
import pytest
from tests import processes

processes.GRACE = 0.2
numbers = pathlib.Path(__file__).with_name("numbers")

def sleep():
    numbers.open("a").write(f"{os.getpid()} ")
    time.sleep(600)

SLEEP = f"import os, time; open({str(numbers)!r}, 'a').write(str(os.getpid()) + ' '); time.sleep(600)"

def child(**options):
    return subprocess.Popen([sys.executable, "-c", SLEEP], **options)

def told(count):
    while not numbers.exists() or len(numbers.read_text().split()) < count:
        time.sleep(0.01)
"""

LEAVES = """
def test_child():
    child()
    told(1)

def test_orphan_of_another_session():
    command = "import subprocess, sys; subprocess.Popen([sys.executable, '-c', sys.argv[1]])"
    subprocess.run([sys.executable, "-c", command, SLEEP], start_new_session=True, check=True)
    told(2)

def test_fork():
    multiprocessing.get_context("fork").Process(target=sleep).start()
    told(3)

def test_failure():
    child()
    told(4)
    assert False

def test_children_that_end():
    subprocess.run([sys.executable, "-c", "pass"], check=True)
    processes.GRACE = 60.0
    multiprocessing.get_context("spawn").Process(target=os.getpid).start()
"""

DIES = """
def test_killed():
    child()
    child(start_new_session=True)
    multiprocessing.get_context("fork").Process(target=sleep).start()
    told(3)
    os.kill(os.getpid(), signal.SIGKILL)
"""


def suite(folder: Path, text: str) -> tuple[str, list[int]]:
    """(output of a pytest that runs these tests, numbers of their processes)."""
    (folder / "test_it.py").write_text(HEAD + text)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "tests.processes", "-p", "no:cacheprovider"]
    done = subprocess.run(
        [*command, "-c", "/dev/null", "--rootdir", str(folder), str(folder)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        check=False,
    )
    return done.stdout, [int(number) for number in (folder / "numbers").read_text().split()]


def runs(process: int) -> bool:
    """Whether a process is there and has not ended."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_what_a_test_leaves_is_ended_and_fails_it(tmp_path: Path) -> None:
    said, numbers = suite(tmp_path, LEAVES)
    assert "1 failed, 4 passed, 4 errors" in said, said
    assert said.count("left running, and killed") >= 4
    assert len(numbers) == 4
    assert not any(map(runs, numbers))


def test_nothing_outlives_a_pytest_that_is_killed(tmp_path: Path) -> None:
    _, numbers = suite(tmp_path, DIES)
    assert len(numbers) == 3
    until = time.monotonic() + 20.0
    while any(map(runs, numbers)):
        assert time.monotonic() < until
        time.sleep(0.05)
