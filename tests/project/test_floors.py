"""Imports of the package only point down the floors, and go round nowhere."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

from tests.project.layout import ROOT, module_name, nodes, relative, sources

#: Parts of the package, floor by floor from the ground up. Solvers know nothing of robots: see ONLY.
GROUND = (
    "archives cores errors extras interrupts lazy multibody pickling quick_dataclasses rotations sealed shapes style"
)
LEVELS = (
    f"{GROUND} linear_program terminal validation",
    "estimation geometry log native symbolic",
    "proximity resolvers robot robots",
    "clearance simulation tasks",
    "analysis stack",
    "qp",
    "tick",
    "explain",
    "controller",
    "batch export ik plan record servo support trajectory",
    "api",
    "coordinates",
    "climb explore identification motion_control moving_target pages program published replaying retarget teleop track",
    "formats learning study viewer",
    "cli",
)
FLOORS = {f"wbc.{part}": floor for floor, parts in enumerate(LEVELS) for part in parts.split()}
#: Parts that may import only the listed floors, whatever stands below them
ONLY = {"wbc.qp": {0}, "wbc.resolvers": {0, 1}}
#: A module in a string, as importlib takes it; f-strings end where their first value begins
NAMED = re.compile(r"wbc(\.[a-z_]+)+\.?")
#: Modules in strings that are not imported by who names them: classes that a pickle may ask for
LISTED = {("wbc.replaying.ticks", "wbc.coordinates"), ("wbc.replaying.ticks", "wbc.analysis")}
#: What a controller and its steps offer and packages above do: these are imported when somebody asks for it
LISTED |= {("wbc.controller.hooks", f"wbc.{package}") for package in ("batch", "explain", "export", "ik", "record")}
#: The package's own __init__ collects names from every floor
ROOF = "wbc"
PACKAGE_FILES = sources("wbc", "tasks", "robots")
MODULES = frozenset(map(module_name, PACKAGE_FILES))


def part_of(module: str) -> str:
    """The part of the package that a module belongs to."""
    parts = module.split(".")
    return ".".join(parts[:2])


@cache
def telling(path: Path) -> list[ast.AST]:
    """The few nodes of a file that can tell of a module: imports and strings."""
    return [node for node in nodes(path) if isinstance(node, (ast.Import, ast.ImportFrom, ast.Constant))]


@cache
def imported(path: Path) -> list[tuple[int, str]]:
    """(line, module) of every import of this package, in functions and for types too."""
    found: list[tuple[int, str]] = []
    for node in telling(path):
        if isinstance(node, ast.Import):
            found += [(node.lineno, a.name) for a in node.names if a.name.split(".")[0] == "wbc"]
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and (node.module or "").split(".")[0] == "wbc":
            module = node.module or ""
            found += [(node.lineno, f"{module}.{a.name}" if module == "wbc" else module) for a in node.names]
    return found


@cache
def named(path: Path) -> list[tuple[int, str]]:
    """(line, module) of every string that is the name of a module of this package."""
    strings = [n for n in telling(path) if isinstance(n, ast.Constant) and isinstance(n.value, str)]
    return [(n.lineno, n.value.rstrip(".")) for n in strings if NAMED.fullmatch(n.value)]


@cache
def mentioned(path: Path) -> list[tuple[int, str]]:
    """(line, module) of every module that a file imports or names in a string; ``from package import module`` too."""
    found = [*imported(path)]
    for node in telling(path):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "wbc":
            found += [(node.lineno, f"{node.module}.{alias.name}") for alias in node.names]
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.startswith("wbc."):
            found.append((node.lineno, node.value))
    return [(line, target) for line, target in found if target in MODULES]


def package_circles(package: str, arrows: set[tuple[str, str]]) -> set[str]:
    """Modules and packages directly in a package that import each other, also through others."""
    depth = package.count(".") + 2
    down: dict[str, set[str]] = {}
    for ends in arrows:
        if all(end.startswith(f"{package}.") for end in ends):
            one, other = (".".join(end.split(".")[:depth]) for end in ends)
            if one != other:
                down.setdefault(one, set()).add(other)
    # What imports nothing that is left, or is imported by nothing that is left, is in no circle
    while True:
        targets = {target for some in down.values() for target in some}
        left = {one: {t for t in some if t in down} for one, some in down.items() if one in targets}
        left = {one: some for one, some in left.items() if some}
        if left == down:
            return set(down)
        down = left


def faults(path: Path) -> list[str]:
    """Imports of a file that point up, or to a part that has no floor."""
    module = module_name(path)
    if module in (ROOF, f"{ROOF}.__main__"):
        return []
    here = part_of(module)
    if here not in FLOORS:
        return [f"{relative(path)}: {here} has no floor"]
    out = []
    for line, target in imported(path) + named(path):
        there = part_of(target)
        if there == here or target == "wbc.__version__":
            continue
        floor = FLOORS.get(there)
        if floor is None or floor > FLOORS[here] or (here in ONLY and floor not in ONLY[here]):
            out.append(f"{relative(path)}:{line}: {here} imports {there}")
    return out


def test_imports_point_down() -> None:
    """Imports for types and names in strings counted."""
    assert len(PACKAGE_FILES) > 400
    assert [fault for path in PACKAGE_FILES for fault in faults(path)] == []


def test_the_rule_finds_an_import_that_points_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.project.layout.ROOT", tmp_path)
    bad = tmp_path / "wbc" / "symbolic" / "bad.py"
    bad.parent.mkdir(parents=True)
    bad.write_text("import wbc.errors\n\n\ndef f():\n    from wbc import controller\n    return controller\n")
    assert faults(bad) == ["wbc/symbolic/bad.py:5: wbc.symbolic imports wbc.controller"]
    solver = tmp_path / "wbc" / "qp" / "bad.py"
    solver.parent.mkdir(parents=True)
    solver.write_text("from wbc.robot import Robot\nfrom wbc.errors import WbcError\n")
    assert faults(solver) == ["wbc/qp/bad.py:1: wbc.qp imports wbc.robot"]
    late = tmp_path / "wbc" / "qp" / "late.py"
    late.write_text("MODULE = 'wbc.controller.core'\n")
    assert faults(late) == ["wbc/qp/late.py:1: wbc.qp imports wbc.controller"]


def test_no_modules_or_packages_side_by_side_import_each_other_in_a_circle() -> None:
    """Those of every package and those of the whole, imports for types counted."""
    arrows, packages = set(), set()
    for path in PACKAGE_FILES:
        module = module_name(path)
        if path.name == "__init__.py":
            # A package's own names come from what it holds
            packages.add(module)
            continue
        arrows |= {(module, target) for _, target in mentioned(path)}
    assert len(packages) > 15
    assert {package: found for package in sorted(packages) if (found := package_circles(package, arrows))} == {}


def test_the_rule_finds_a_circle() -> None:
    chain = {("p.a.x", "p.b"), ("p.b", "p.c.y"), ("p.c.z", "p.d")}
    assert package_circles("p", chain) == set()
    assert package_circles("p", chain | {("p.c.w", "p.a.v")}) == {"p.a", "p.b", "p.c"}
    assert package_circles("p.a", {("p.a.x", "p.a.y"), ("p.a.y", "p.a.x")}) == {"p.a.x", "p.a.y"}


def test_reproductions_are_imported_by_the_command_line_alone() -> None:
    parts = {
        part_of(module_name(path))
        for path in PACKAGE_FILES
        for _, target in mentioned(path)
        if part_of(target) == "wbc.published"
    }
    assert parts == {"wbc.published", "wbc.cli"}


def test_relative_imports_are_not_used() -> None:
    relative_imports = [
        f"{relative(path)}:{node.lineno}"
        for path in PACKAGE_FILES
        for node in nodes(path)
        if isinstance(node, ast.ImportFrom) and node.level > 0
    ]
    assert relative_imports == []
    assert (ROOT / "wbc").is_dir()


def test_pinocchio_is_imported_in_one_place() -> None:
    """Where it is not installed, ``wbc.multibody.pin`` is the package's own."""
    places = {
        module_name(path)
        for path in PACKAGE_FILES
        for node in telling(path)
        if isinstance(node, (ast.Import, ast.ImportFrom))
        for name in ([a.name for a in node.names] if isinstance(node, ast.Import) else [node.module or ""])
        if name.split(".")[0] == "pinocchio"
    }
    assert places == {"wbc.multibody"}
