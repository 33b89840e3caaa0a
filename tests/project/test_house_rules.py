"""House rules of CONTRIBUTING.md that a machine can check. Walking, which is to be rebuilt, is left out."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

import pytest

from tests.project.layout import ROOT

FILES = [
    file
    for folder in ("wbc", "tasks", "robots")
    for file in sorted((ROOT / folder).rglob("*.py"))
    if "walking" not in file.parts
]
TREES = {file: ast.parse(file.read_text(encoding="utf-8")) for file in FILES}


def _constants(tree: ast.Module) -> dict[str, str]:
    """Name -> value, as written, of the capitals that a file sets alone."""
    out: dict[str, str] = {}
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(target := node.targets[0], ast.Name) and target.id.isupper():
            out[target.id] = ast.unparse(node.value)
    return out


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(ROOT)))
def test_one_constant_a_line(file: Path) -> None:
    for node in TREES[file].body:
        if isinstance(node, ast.Assign) and isinstance(target := node.targets[0], ast.Tuple):
            capitals = [each.id for each in target.elts if isinstance(each, ast.Name) and each.id.isupper()]
            assert not capitals, f"line {node.lineno}: {', '.join(capitals)}"


def test_a_constant_means_one_thing_in_a_package() -> None:
    meanings: dict[tuple[Path, str], set[str]] = defaultdict(set)
    for file, tree in TREES.items():
        for name, value in _constants(tree).items():
            meanings[file.parent.relative_to(ROOT), name].add(value)
    assert not [(str(package), name, *values) for (package, name), values in meanings.items() if len(values) > 1]


def test_a_class_name_is_used_once() -> None:
    places: dict[str, list[str]] = defaultdict(list)
    for file, tree in TREES.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                places[node.name.lstrip("_")].append(f"{file.relative_to(ROOT)}:{node.lineno}")
    assert not {name: found for name, found in places.items() if len(found) > 1}
