"""The README's Python runs, block after block, and its links lead somewhere."""

from __future__ import annotations

import contextlib
import io
import re
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

ROOT = Path(__file__).parent.parent


#: Pages whose Python runs as one program
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
RUN = [ROOT / "README.md", *(ROOT / "docs" / f"{name}.md" for name in ("cookbook", "tutorial", "porting"))]


def run(page: Path) -> None:
    """All blocks as one program."""
    source = "\n".join(re.findall(r"```python\n(.*?)```", page.read_text(), re.S))
    exec(compile(source, page.name, "exec"), {"__name__": "__main__"})


@pytest.mark.parametrize("page", RUN, ids=lambda page: page.stem)
def test_blocks_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with contextlib.redirect_stdout(io.StringIO()) as said:
        run(page)
    plt.close("all")
    assert page.stem != "README" or "EndEffector" in said.getvalue()


@pytest.mark.parametrize("page", ["dynamics_published", "proximity", "trajectory"])
def test_short_blocks_run(page: str) -> None:
    run(ROOT / "docs" / f"{page}.md")


#: Page -> what is shorter here than there
SHORTER = {
    "torque": {},
    "motion_control": {"0.001, 2.0)": "0.001, 0.05)"},
    "walking_published": {">= 20": ">= 6.1"},
}


@pytest.mark.parametrize("page", SHORTER)
def test_blocks_of_robots_run(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As they stand, but for shorter ways."""
    monkeypatch.chdir(tmp_path)
    text = "\n".join(re.findall(r"```python\n(.*?)```", (ROOT / "docs" / f"{page}.md").read_text(), re.S))
    for long, short in SHORTER[page].items():
        assert long in text
        text = text.replace(long, short)
    exec(compile(text, page, "exec"), {})


def test_links_exist() -> None:
    for page in PAGES:
        for link in re.findall(r"\]\(([^)#\s]+)", page.read_text()):
            if not link.startswith("http"):
                assert (page.parent / link).exists(), f"{page.name}: {link}"
