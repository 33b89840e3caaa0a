"""Habits that every source file keeps."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from tests.project.layout import FOLDERS, relative, sources

PACKAGE = sources("wbc", "tasks", "robots", "bench")
EVERYTHING = sources(*FOLDERS)
#: Spelled apart so that this file passes its own rule
UNFINISHED = re.compile(r"\b(" + "|".join(("TO" + "DO", "FIX" + "ME", "X" + "XX", "HA" + "CK")) + r")\b")


@pytest.mark.parametrize("path", PACKAGE, ids=relative)
def test_files_and_functions_are_short(path: Path) -> None:
    text = path.read_text()
    assert text.count("\n") < 350
    functions = [n for n in ast.walk(ast.parse(text)) if isinstance(n, (ast.FunctionDef, ast.AsyncFunctionDef))]
    assert [f"{f.name}:{f.lineno}" for f in functions if (f.end_lineno or 0) - f.lineno + 1 > 70] == []


@pytest.mark.parametrize("path", EVERYTHING, ids=relative)
def test_nothing_is_left_unfinished(path: Path) -> None:
    text = path.read_text()
    marked = [n for n, line in enumerate(text.splitlines(), 1) if UNFINISHED.search(line)]
    assert marked == []
    raised = [n.lineno for n in ast.walk(ast.parse(text)) if isinstance(n, ast.Raise) and "NotImpl" in ast.dump(n)]
    assert raised == []


@pytest.mark.parametrize("path", sources("wbc", "tasks", "robots"), ids=relative)
def test_annotations_are_lazy(path: Path) -> None:
    tree = ast.parse(path.read_text())
    annotated = any(isinstance(n, (ast.FunctionDef, ast.AnnAssign)) for n in ast.walk(tree))
    futures = [n for n in tree.body if isinstance(n, ast.ImportFrom) and n.module == "__future__"]
    assert bool(futures) or not annotated


@pytest.mark.parametrize("path", sources("tests"), ids=relative)
def test_no_test_is_switched_off(path: Path) -> None:
    names = {n.attr for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Attribute)}
    assert not names & {"skip" + "if", "x" + "fail", "import" + "orskip"}
