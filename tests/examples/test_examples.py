"""Every example runs without a display and without a compiler, and prints what it promises."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "examples"
EXAMPLES = sorted(FOLDER.glob("*.py"))
NUMBER = r"([-+0-9.e]+)"


def output(name: str) -> str:
    """What the example prints, run in a process of its own on the virtual machine."""
    done = subprocess.run(
        [sys.executable, str(FOLDER / f"{name}.py")],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "WBC_CC": ""},
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def number(pattern: str, text: str) -> float:
    found = re.search(pattern.replace("#", NUMBER), text)
    assert found is not None, text
    return float(found.group(1))


def test_quick_start_follows() -> None:
    text = output("quick_start")
    assert "(vm)" in text
    assert number("solved, hand error # mm", text) < 0.1


def test_custom_expression_looks_at_the_point() -> None:
    errors = [float(x) for x in re.findall(rf"solved.*look {NUMBER} m", output("custom_expression"))]
    assert len(errors) == 2
    assert max(errors) < 5e-3


def test_moving_obstacle_pushes_the_arm_away() -> None:
    text = output("moving_obstacle")
    assert number("beyond the margin # mm", text) > -0.5
    assert number("hand pushed # mm", text) > 5.0
    assert number("at the end: solved, hand error # mm", text) < 0.1


@pytest.mark.slow
def test_humanoid_reaches_on_held_feet() -> None:
    text = output("humanoid")
    assert number("solved: hand # mm", text) < 1.0
    assert number("centre of mass # mm", text) < 5.0
    assert number("left foot moved # um", text) < 1.0


def test_dual_arm_carries_the_box() -> None:
    text = output("dual_arm")
    assert number("solved: box # mm", text) < 1.0
    assert number("slipped # mm", text) < 0.5


def test_mobile_base_rolls_to_where_the_hand_reaches() -> None:
    text = output("mobile_base")
    assert number("solved: hand # mm", text) < 0.5
    assert number("and # m and turned", text) < -0.8


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_examples_are_short_and_use_public_names(path: Path) -> None:
    text = path.read_text()
    assert text.count("\n") < 40
    tree = ast.parse(text)
    assert ast.get_docstring(tree)
    modules = {a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
    modules |= {n.module or "" for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    assert modules <= {"wbc", "wbc.tasks", "numpy", "pinocchio", "casadi"}
    assert not [n.attr for n in ast.walk(tree) if isinstance(n, ast.Attribute) and n.attr.startswith("_")]


def test_every_example_is_run() -> None:
    called = set(re.findall(r'output\("(\w+)"\)', Path(__file__).read_text()))
    assert called == {path.stem for path in EXAMPLES}
