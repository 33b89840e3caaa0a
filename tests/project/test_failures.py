"""What a run says of tests that fail while it goes on, and what it leaves where it is stopped."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.project.layout import ROOT

TESTS = """
import pathlib, time, pytest

@pytest.mark.parametrize("k", [1, 2])
def test_wrong(k):
    assert k == 2, "the reason"

@pytest.fixture
def broken():
    raise ValueError("first this")

def test_set_up(broken):
    pass

def test_endless():
    time.sleep(60.0)
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_failures_are_named_at_once_and_kept_where_a_run_is_stopped(tmp_path: Path, number: signal.Signals) -> None:
    (tmp_path / "test_some.py").write_text(TESTS)
    kept = tmp_path / "build" / "failed.txt"
    command = [sys.executable, "-m", "pytest", "-p", "tests.failures", "-p", "no:cacheprovider", "-c", os.devnull]
    options = ["--rootdir", ".", "-n", "1", "--failed-list", kept, "test_some.py"]
    names = ["test_some.py::test_wrong[1]", "test_some.py::test_set_up"]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    environment.pop("PYTEST_XDIST_WORKER", None)
    with subprocess.Popen(
        [*command, *options], cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True, start_new_session=True
    ) as run:
        assert run.stdout is not None
        said: list[str] = []
        for line in run.stdout:
            said += [line.strip()] if line.startswith("FAILED") else []
            if len(said) == len(names):
                break
        os.killpg(run.pid, number)
        rest = run.stdout.read()
    assert run.returncode != 0
    assert said == [f"FAILED {names[0]} - AssertionError: the reason", f"FAILED {names[1]} - ValueError: first this"]
    assert kept.read_text().splitlines() == names
    assert number == signal.SIGTERM or f"2 failed; again: make test PYTEST_ARGS=@{kept}" in rest
