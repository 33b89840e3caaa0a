"""Every example runs to its end, and prints what it says it reached."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parent.parent / "examples").glob("*.py"))

#: What each example must print, and the largest numbers (mm, or metres where it prints metres) that it may
LIMITS = {
    "quick_start": (r"hand ([\d.e-]+) m", 2e-3),
    "custom_expression": (r"height error ([\d.e-]+) m", 1e-3),
    "moving_obstacle": (r"hand off by ([\d.]+) mm", 30.0),
    "humanoid": (r"hand +([\d.e-]+) m", 5e-3),
}


def test_every_example_has_a_limit() -> None:
    assert {path.stem for path in EXAMPLES} == set(LIMITS)


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_example_runs(path: Path) -> None:
    # On the virtual machine: what is shown here is the example, not the compiler
    done = subprocess.run(
        [sys.executable, str(path)],
        capture_output=True,
        text=True,
        timeout=300,
        env={**os.environ, "WBC_CC": ""},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    pattern, limit = LIMITS[path.stem]
    found = re.search(pattern, done.stdout)
    assert found is not None, done.stdout
    assert float(found.group(1)) < limit


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_example_is_short(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= 45


def test_readme_blocks_run() -> None:
    """The README's Python, block after block in one namespace."""
    text = (Path(__file__).parent.parent / "README.md").read_text()
    source = "\n".join(re.findall(r"```python\n(.*?)```", text, re.S))
    done = subprocess.run(
        [sys.executable, "-c", source],
        capture_output=True,
        text=True,
        timeout=300,
        env={**os.environ, "WBC_CC": ""},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "EndEffector" in done.stdout
