"""The examples of the task pages run as they are printed."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGES = Path(__file__).parents[2] / "docs" / "tasks"
NAMES = (
    "axis_align",
    "axis_cone",
    "center_of_mass",
    "damping",
    "distance",
    "elbow",
    "end_effector",
    "expression",
    "gaze_cone",
    "joint_coupling",
    "limit",
    "look_at",
    "manipulability",
    "momentum",
    "obstacle",
    "posture",
    "relative_pose",
    "rolling",
    "self_collision",
    "workspace_box",
    "workspace_polyhedron",
)


def examples() -> list[tuple[str, str]]:
    found = []
    for name in NAMES:
        blocks = re.findall(r"```python\n(.*?)```", (PAGES / f"{name}.md").read_text(), flags=re.DOTALL)
        assert blocks, name
        found += [(f"{name}-{k}", block) for k, block in enumerate(blocks)]
    return found


@pytest.mark.parametrize(("name", "code"), examples(), ids=[name for name, _ in examples()])
def test_example_runs(name: str, code: str) -> None:
    exec(compile(code, f"{name}.md", "exec"), {})


@pytest.mark.parametrize("name", NAMES)
def test_page_says_what_the_task_cannot_do(name: str) -> None:
    assert "\n## What it cannot do\n" in (PAGES / f"{name}.md").read_text()
