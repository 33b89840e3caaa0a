"""The README's Python runs, block after block, and its links lead somewhere."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


#: Pages whose Python runs as one program
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
RUN = [ROOT / "README.md", *(ROOT / "docs" / f"{name}.md" for name in ("cookbook", "tutorial", "porting"))]


@pytest.mark.parametrize("page", RUN, ids=lambda page: page.stem)
def test_blocks_run(page: Path) -> None:
    source = "\n".join(re.findall(r"```python\n(.*?)```", page.read_text(), re.S))
    done = subprocess.run(
        [sys.executable, "-c", source],
        capture_output=True,
        text=True,
        timeout=300,
        env={**os.environ, "WBC_CC": ""},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert page.stem != "README" or "EndEffector" in done.stdout


@pytest.mark.parametrize("page", ["dynamics_published", "proximity", "trajectory"])
def test_short_blocks_run(page: str) -> None:
    text = (ROOT / "docs" / f"{page}.md").read_text()
    exec(compile("\n".join(re.findall(r"```python\n(.*?)```", text, re.S)), page, "exec"), {})


def test_links_exist() -> None:
    for page in PAGES:
        for link in re.findall(r"\]\(([^)#\s]+)", page.read_text()):
            if not link.startswith("http"):
                assert (page.parent / link).exists(), f"{page.name}: {link}"
