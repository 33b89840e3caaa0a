"""Importing the package is quick, because what only some users need is imported when it is used."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

HEAVY = ("matplotlib", "typer", "rich", "scipy", "pyarrow", "toppra", "ruckig", "osqp")


def run(code: str) -> str:
    """Standard output of a fresh interpreter, outside the repository's folder."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd="/")
    return done.stdout


@pytest.mark.parametrize("module", ["wbc", "wbc.tasks", "wbc.robots", "wbc.trajectory"])
def test_import_leaves_heavy_packages_alone(module: str) -> None:
    loaded = set(json.loads(run(f"import json, sys, {module}; print(json.dumps([m for m in sys.modules]))")))
    assert module in loaded
    assert not loaded & set(HEAVY)


def test_version_is_that_of_the_distribution() -> None:
    code = "import wbc, importlib.metadata as m; print(wbc.__version__ == m.version('wbc'))"
    assert run(code).strip() == "True"


def test_names_that_left_the_controller_are_still_found_there() -> None:
    code = (
        "from wbc.controller import Branches, Ending, Explanation, Recorder, Solver, replayed; print(Solver.__module__)"
    )
    assert run(code).strip() == "wbc.ik.inverse_kinematics"
