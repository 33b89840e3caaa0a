"""Names in the indented Python of pages exist, and calls have the arguments that they name; ``python`` blocks are run
by test_readme.py.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import re
import textwrap
from pathlib import Path
from typing import Any

import pytest

import wbc
from wbc.api import Controller, Stack
from wbc.batch import Batch, BatchStep
from wbc.controller import Step
from wbc.controller.handle import Handle
from wbc.robot import Robot

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
FENCED, INDENTED = re.compile(r"```.*?```", re.S), re.compile(r"(?:^|\n\n)((?:    .*\n|\n(?=    ))+)")
#: What names of pages stand for, where the page does not say it
KNOWN: dict[str, Any] = {
    "wbc": wbc,
    "controller": Controller,
    "stack": Stack,
    "robot": Robot,
    "step": Step,
    "servo": importlib.import_module("wbc.servo").Servo,
    "kinematics": importlib.import_module("wbc.ik").InverseKinematics,
    "runner": importlib.import_module("wbc.program").Runner,
}
#: Where they stand for others
ELSEWHERE: dict[str, dict[str, Any]] = {"batch": {"step": BatchStep, "batch": Batch}}


def blocks(text: str) -> list[ast.Module]:
    """Indented blocks that are Python: what does not parse is output, a formula or a command line."""
    found = []
    for match in INDENTED.finditer(FENCED.sub("", text)):
        try:
            found.append(ast.parse(textwrap.dedent(match[1])))
        except SyntaxError:
            continue
    return found


def imported(tree: ast.Module) -> dict[str, Any]:
    """Names that a block imports; fails where there is no such module or name."""
    names = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                importlib.import_module(alias.name)
                names[alias.asname or alias.name.split(".")[0]] = importlib.import_module(alias.name.split(".")[0])
        elif isinstance(node, ast.ImportFrom):
            module = importlib.import_module(node.module or "")
            names |= {alias.asname or alias.name: getattr(module, alias.name) for alias in node.names}
    return names


def resolved(node: ast.expr, names: dict[str, Any]) -> Any:
    """What a dotted name stands for, None where that is not known; fails where a known thing has no such attribute."""
    if isinstance(node, ast.Name):
        return names.get(node.id)
    if isinstance(node, ast.Subscript) and resolved(node.value, names) is Controller:
        return Handle
    if not isinstance(node, ast.Attribute):
        return None
    owner = resolved(node.value, names)
    if owner is None or (owner is Handle and not hasattr(Handle, node.attr)):
        return None
    if inspect.isclass(owner) and not hasattr(owner, node.attr):
        # Attributes that instances alone have
        assert node.attr in inspect.getsource(owner), f"{owner.__name__} has no {node.attr}"
        return None
    found = getattr(owner, node.attr)
    return found if callable(found) or inspect.ismodule(found) else None


def check(tree: ast.Module, names: dict[str, Any]) -> None:
    """Attributes exist, and named arguments are some that the called thing has."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            resolved(node, names)
        if not isinstance(node, ast.Call) or (called := resolved(node.func, names)) is None:
            continue
        taken = inspect.signature(called).parameters
        if any(one.kind is inspect.Parameter.VAR_KEYWORD for one in taken.values()):
            continue
        for word in node.keywords:
            assert word.arg is None or word.arg in taken, f"{ast.unparse(node)}: {called.__name__} has no {word.arg}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_names_of_snippets_exist(page: Path) -> None:
    names = KNOWN | ELSEWHERE.get(page.stem, {})
    for tree in blocks(page.read_text()):
        names |= imported(tree)
        check(tree, names)


def test_names_that_do_not_exist_are_found() -> None:
    for text in (
        "    wbc.robots.lod('panda')\n",
        "    from wbc.servo import Serve\n",
        "    robot = wbc.robots.load('panda', bas='fixed')\n",
        "    controller.stp(q)\n",
        "    stack.add(wbc.tasks.Posture(), nam='p')\n",
    ):
        (tree,) = blocks(text)
        with pytest.raises((AssertionError, AttributeError, ImportError)):
            check(tree, KNOWN | imported(tree))
