"""The page that puts published and measured side by side is complete, and the tests that it names are there."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

HERE = Path(__file__).parent
PAGE = (HERE.parents[1] / "docs" / "task_constraint_published.md").read_text()
CASES = [f"A{k}" for k in range(1, 26) if k not in (10, 13, 19)]
MISPRINTS = [
    *("3.15", "3.16", "3.20", "3.25", "3.26", "3.30", "3.41", "3.45", "3.47", "3.52", "3.42", "after 3.31"),
    *("footnote, page 45", "4.1", "4.3", "4.10", "4.29", "4.40", "4.32", "4.37", "4.38", "text, page 84", "4.42"),
    *("gamma, appendix C", "B.7", "B.22", "B.27", "range of p, appendix B", "appendix A, A.4", "list of contents"),
]
#: Of the misprints the one that no computation can meet
PAGE_NUMBER = "list of contents"


def rows(heading: str) -> list[list[str]]:
    """Cells of the table below a heading, without its head."""
    section = PAGE.split(f"## {heading}\n")[1].split("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("|")][2:]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def test_every_case_has_its_row() -> None:
    assert sorted({row[0] for row in rows("Cases")}) == sorted(CASES)


@pytest.mark.parametrize("place", MISPRINTS)
def test_every_misprint_has_its_row(place: str) -> None:
    assert [row for row in rows("What print has wrong") if row[0] == place or place in row[0].split(", ")]


def test_every_row_is_measured_and_shown_by_tests_that_exist() -> None:
    there = {
        f"{file.name}::{node.name}"
        for file in HERE.glob("test_*.py")
        for node in ast.parse(file.read_text()).body
        if isinstance(node, ast.FunctionDef)
    }
    for row in (*rows("Cases"), *rows("What print has wrong")):
        assert len(row) == 4
        assert all(row), row
        named = re.findall(r"`([^`]+)`", row[3])
        assert set(named) <= there, row[0]
        assert bool(named) == (row[0] != PAGE_NUMBER), row[0]


def test_tests_of_a_case_are_in_its_row() -> None:
    """A test that is named after a case is not left out of the page."""
    by_case: dict[str, str] = {}
    for row in rows("Cases"):
        by_case[row[0]] = by_case.get(row[0], "") + row[3]
    for file in (*HERE.glob("test_task_constraint_*.py"), HERE / "test_rank_analysis.py"):
        for number, name in re.findall(r"^def (?=test_a(\d+)_)(\w+)", file.read_text(), re.M):
            assert name in by_case[f"A{number}"] or name in PAGE.split("## What print has wrong")[1], name
