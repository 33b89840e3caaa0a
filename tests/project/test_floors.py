"""Imports of the package only point down the floors."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from tests.project.layout import ROOT, module_name, nodes, relative, sources

#: Floor of each part of the package, from the ground up. Solvers know nothing of robots: see ONLY.
FLOORS = {
    "wbc.errors": 0,
    "wbc.interrupts": 0,
    "wbc.pickling": 0,
    "wbc.validation": 0,
    "wbc.shapes": 0,
    "wbc.style": 0,
    "wbc.terminal": 0,
    "wbc.native": 1,
    "wbc.symbolic": 1,
    "wbc.robot": 2,
    "wbc.robots": 2,
    "wbc.proximity": 2,
    "wbc.tasks": 3,
    "wbc.analysis": 4,
    "wbc.stack": 4,
    "wbc.qp": 5,
    "wbc.resolvers": 5,
    "wbc.export": 5,
    "wbc.controller": 6,
    "wbc.trajectory": 7,
    "wbc.coordinates": 7,
    "wbc.teleop": 8,
    "wbc.track": 8,
    "wbc.published": 8,
    "wbc.walking": 8,
    "wbc.pages": 8,
    "wbc.cli": 9,
}
#: Floors inside wbc.walking; a room imports only rooms on lower floors
WALKING = {
    "holds": 0,
    "arms": 0,
    "body_path": 1,
    "native": 1,
    "log": 2,
    "checker": 3,
    "planner": 3,
    "loop": 4,
    "modes": 5,
    "two_ended": 5,
    "run": 6,
    "report": 7,
}
#: Packages in which no two modules or packages side by side import each other, also not through others
NO_CIRCLES = ("wbc.walking", "wbc.published")
#: Names what it leads to in strings, and must: what it stands for lies above it
OLD_NAMES = "wbc.walking.old_names"
#: Parts that may import only the listed floors, whatever stands below them
ONLY = {"wbc.qp": {0}, "wbc.resolvers": {0}}
#: The package's own __init__ collects names from every floor
ROOF = "wbc"
PACKAGE_FILES = sources("wbc", "tasks", "robots")


def part_of(module: str) -> str:
    """The part of the package that a module belongs to."""
    parts = module.split(".")
    return ".".join(parts[:2])


def imported(path: Path) -> list[tuple[int, str]]:
    """(line, module) of every import of this package that runs; those for type checking only are left out."""
    idle = {
        id(inner)
        for node in nodes(path)
        if isinstance(node, ast.If) and getattr(node.test, "id", getattr(node.test, "attr", "")) == "TYPE_CHECKING"
        for statement in node.body
        for inner in ast.walk(statement)
    }
    found: list[tuple[int, str]] = []
    for node in nodes(path):
        if id(node) in idle:
            continue
        if isinstance(node, ast.Import):
            found += [(node.lineno, a.name) for a in node.names if a.name.split(".")[0] == "wbc"]
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and (node.module or "").split(".")[0] == "wbc":
            module = node.module or ""
            found += [(node.lineno, f"{module}.{a.name}" if module == "wbc" else module) for a in node.names]
    return found


def named(path: Path) -> list[tuple[int, str]]:
    """(line, module) of every module that a file imports or names in a string; ``from package import module`` too."""
    found = imported(path)
    for node in nodes(path):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "wbc":
            found += [(node.lineno, f"{node.module}.{alias.name}") for alias in node.names]
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.startswith("wbc."):
            found.append((node.lineno, node.value))
    known = {module_name(file) for file in PACKAGE_FILES}
    return [(line, target) for line, target in found if target in known]


def circles(package: str, arrows: set[tuple[str, str]]) -> set[str]:
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
    if module == ROOF:
        return []
    here = part_of(module)
    if here not in FLOORS:
        return [f"{relative(path)}: {here} has no floor"]
    out = []
    for line, target in imported(path):
        there = part_of(target)
        if there == here or target == "wbc.__version__":
            continue
        floor = FLOORS.get(there)
        if floor is None or floor > FLOORS[here] or (here in ONLY and floor not in ONLY[here]):
            out.append(f"{relative(path)}:{line}: {here} imports {there}")
    return out


def test_imports_point_down() -> None:
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


def test_rooms_of_walking_import_only_rooms_below() -> None:
    used, up = set(), []
    for path in PACKAGE_FILES:
        module = module_name(path)
        if not module.startswith("wbc.walking.") or module == OLD_NAMES:
            continue
        here = module.split(".")[2]
        used.add(here)
        for line, target in named(path):
            there = [*target.split("."), ""][2]
            if target.startswith("wbc.walking.") and there != here and not WALKING[there] < WALKING[here]:
                up.append(f"{relative(path)}:{line}: {here} names {there}")
    assert up == []
    assert used == set(WALKING)


def test_no_modules_import_each_other_in_a_circle() -> None:
    arrows, packages = set(), set()
    for path in PACKAGE_FILES:
        module = module_name(path)
        if not module.startswith(NO_CIRCLES) or module == OLD_NAMES:
            continue
        if path.name == "__init__.py":
            # A package's own names come from what it holds
            packages.add(module)
            continue
        arrows |= {(module, target) for _, target in named(path)}
    assert len(packages) > 15
    assert {package: found for package in sorted(packages) if (found := circles(package, arrows))} == {}


def test_the_rule_finds_a_circle() -> None:
    chain = {("p.a.x", "p.b"), ("p.b", "p.c.y"), ("p.c.z", "p.d")}
    assert circles("p", chain) == set()
    assert circles("p", chain | {("p.c.w", "p.a.v")}) == {"p.a", "p.b", "p.c"}
    assert circles("p.a", {("p.a.x", "p.a.y"), ("p.a.y", "p.a.x")}) == {"p.a.x", "p.a.y"}


def test_reproductions_are_imported_by_the_command_line_alone() -> None:
    parts = {
        part_of(module_name(path))
        for path in PACKAGE_FILES
        if module_name(path) != OLD_NAMES
        for _, target in named(path)
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
