"""House rules of CONTRIBUTING.md that a machine can check."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from pathlib import Path

from tests.project.layout import ROOT, relative, sources, tree

FILES = sources("wbc", "tasks", "robots")
#: A macro of C that is a number
MACRO = re.compile(r"#define ([A-Z][A-Z0-9_]*) +([-+.0-9]\S*)")
CLASS = re.compile(r"\s*class (\w+)[:([]")


def _constants(file: Path) -> dict[str, str]:
    """Name -> value, as written, of the capitals that a file sets alone."""
    out: dict[str, str] = {}
    for node in tree(file).body:
        if isinstance(node, ast.Assign) and isinstance(target := node.targets[0], ast.Name) and target.id.isupper():
            out[target.id] = ast.unparse(node.value)
    return out


def test_one_constant_a_line() -> None:
    for file in FILES:
        for node in tree(file).body:
            if isinstance(node, ast.Assign) and isinstance(target := node.targets[0], ast.Tuple):
                capitals = [each.id for each in target.elts if isinstance(each, ast.Name) and each.id.isupper()]
                assert not capitals, f"{relative(file)}:{node.lineno}: {', '.join(capitals)}"


def test_a_constant_means_one_thing_in_a_package() -> None:
    meanings: dict[tuple[Path, str], set[str]] = defaultdict(set)
    for file in FILES:
        for name, value in _constants(file).items():
            meanings[file.parent.relative_to(ROOT), name].add(value)
    assert not [(str(package), name, *values) for (package, name), values in meanings.items() if len(values) > 1]


def test_a_macro_means_one_thing_in_a_kernel() -> None:
    """Headers of a folder are compiled as one file, in which the last meaning would count from there on."""
    meanings: dict[tuple[Path, str], set[str]] = defaultdict(set)
    for file in sorted((ROOT / "wbc").glob("**/native/*.[ch]")):
        for name, value in MACRO.findall(file.read_text()):
            meanings[file.parent.relative_to(ROOT), name].add(value)
    assert len(meanings) > 100
    assert not [(str(folder), name, *values) for (folder, name), values in meanings.items() if len(values) > 1]


def test_a_class_name_is_used_once() -> None:
    places: dict[str, list[str]] = defaultdict(list)
    for file in FILES:
        for line, text in enumerate(file.read_text().splitlines(), 1):
            if found := CLASS.match(text):
                places[found[1].lstrip("_")].append(f"{relative(file)}:{line}")
    assert not {name: where for name, where in places.items() if len(where) > 1}


def test_a_call_by_position_has_six_arguments_at_most() -> None:
    """More are a value object, or options that are named where it is called; Pinocchio's interface has more."""
    for file in (file for file in FILES if "multibody" not in file.parts):
        for node in ast.walk(tree(file)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                arguments = (*node.args.posonlyargs, *node.args.args)
                given = [each.arg for each in arguments if each.arg not in ("self", "cls")]
                assert len(given) <= 6, f"{relative(file)}:{node.lineno}: {node.name}({', '.join(given)})"
