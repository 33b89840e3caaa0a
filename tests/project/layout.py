"""What the tests of this folder know about the repository."""

from __future__ import annotations

import ast
import functools
import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
#: Top-level folders that hold Python of this project
FOLDERS = ("wbc", "tasks", "robots", "tests", "examples", "bench")


def sources(*folders: str) -> list[Path]:
    """Python files of the given top-level folders, sorted."""
    return sorted(p for f in folders for p in (ROOT / f).rglob("*.py") if "__pycache__" not in p.parts)


@functools.cache
def tree(path: Path) -> ast.Module:
    """The parsed file; all rules read the same."""
    return ast.parse(path.read_text())


@functools.cache
def nodes(path: Path) -> tuple[ast.AST, ...]:
    """Its nodes, the module first."""
    return tuple(ast.walk(tree(path)))


def relative(path: Path) -> str:
    """Path inside the repository, for messages."""
    return path.relative_to(ROOT).as_posix()


def module_name(path: Path) -> str:
    """Import name of a file of the package: tasks/a.py is wbc.tasks.a."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    if parts[0] in ("tasks", "robots"):
        parts = ("wbc", *parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def pyproject() -> dict[str, Any]:
    """The parsed pyproject.toml."""
    return tomllib.loads((ROOT / "pyproject.toml").read_text())
