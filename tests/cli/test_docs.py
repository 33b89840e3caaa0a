"""``wbc docs`` on a copy of the pages."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.cli.test_commands import run

PAGES = Path(__file__).parents[2] / "docs" / "tasks"


@pytest.mark.usefixtures("loaded_once")
def test_a_stale_page_is_named_and_written(tmp_path: Path) -> None:
    folder = tmp_path / "tasks"
    shutil.copytree(PAGES, folder)
    page = folder / "fixed.md"
    wanted = page.read_text()
    page.write_text(wanted.replace("The named joints stand still", "The joints stand still"))
    assert run("docs", "--check", "--folder", folder)[:2] == (1, "stale: fixed.md\n")
    assert run("docs", "--folder", folder)[:2] == (0, "written: fixed.md\n")
    assert page.read_text() == wanted
