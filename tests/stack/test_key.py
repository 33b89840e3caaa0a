"""What the name of a cache entry covers: all code of this package that runs when a program is built, and no less."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any, get_type_hints

import pinocchio as pin
import pytest

from tests.project.layout import module_name
from tests.project.test_floors import PACKAGE_FILES, imported, part_of
from tests.stack import small
from wbc import Stack
from wbc.climb import PointFoot
from wbc.climb.loop.stack import FootholdContact
from wbc.native.library import file_bytes
from wbc.shapes import Box, PlacedShape, Sphere
from wbc.stack import key
from wbc.stack.artifact import compile_stack
from wbc.tasks import JointLimits, Obstacle, Posture, SelfCollision


def test_parts_are_all_that_the_builder_imports() -> None:
    """From ``wbc.stack`` on, over every import that runs, also those within functions."""
    files: dict[str, list[Path]] = {}
    for path in PACKAGE_FILES:
        files.setdefault(part_of(module_name(path)), []).append(path)
    reached, waiting = set(), {"wbc.stack"}
    while waiting:
        part = waiting.pop()
        reached.add(part)
        found = {part_of(target) for path in files.get(part, ()) for _, target in imported(path)}
        waiting |= found - reached - {"wbc.__version__"}
    assert tuple(sorted(reached)) == key.PARTS


def test_every_file_that_runs_in_a_build_is_covered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Seen from the interpreter: files whose functions are called while expressions and C code are made."""
    monkeypatch.setenv("WBC_CACHE", str(tmp_path / "cache"))
    box = PlacedShape(Box((0.1, 0.1, 0.1)), pin.SE3.Identity())
    ball = PlacedShape(Sphere(0.1), pin.SE3.Identity())
    robot = small.arm().with_shapes({"link1": [box], "link2": [box, ball]})
    stack = small.stack(robot).add(SelfCollision(pairs=[("link1", "link2")])).add(Obstacle(Box((0.1,) * 3)))
    stack.add(JointLimits(), name="more limits").add(Posture(), name="rest", level=1)
    seen: set[str] = set()

    def note(frame: Any, event: str, _: Any) -> None:
        if event == "call":
            seen.add(frame.f_code.co_filename)

    sys.setprofile(note)
    try:
        compile_stack(stack, "vm", "1")
    finally:
        sys.setprofile(None)
    root = Path(key.__file__).parents[2]
    own = {Path(name).resolve() for name in seen if Path(name).resolve().is_relative_to(root / "wbc")}
    own |= {Path(name).resolve() for name in seen if Path(name).resolve().is_relative_to(root / "tasks")}
    covered = {Path(path).resolve() for part in key.PARTS for _, path in key.files_of(part)}
    assert len(own) > 30
    assert own <= covered


@pytest.mark.parametrize("part", key.PARTS)
def test_a_change_in_any_part_changes_the_key(part: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    stack, files = small.stack(), key.files_of

    def changed(which: str) -> list[tuple[str, str]]:
        found = files(which)
        if which == part:
            name, path = found[-1]
            (tmp_path / "changed.py").write_bytes(Path(path).read_bytes() + b"\n")
            found[-1] = (name, str(tmp_path / "changed.py"))
        return found

    before = key.key(stack, "1")
    key._own_code.cache_clear()
    monkeypatch.setattr(key, "files_of", changed)
    try:
        assert key.key(stack, "1") != before
    finally:
        monkeypatch.undo()
        key._own_code.cache_clear()
    assert key.key(stack, "1") == before


def test_a_change_of_a_class_of_an_items_field_changes_the_key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows of a contact are those of the kind that it is given, whose class is in another file."""
    file = tmp_path / "own_kinds.py"
    file.write_text("from wbc.climb import PointFoot\n\n\nclass OwnFoot(PointFoot):\n    pass\n")
    spec = importlib.util.spec_from_file_location("own_kinds", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "own_kinds", module)
    spec.loader.exec_module(module)
    robot = small.arm()
    kinds = PointFoot(0.5), module.OwnFoot(0.5)
    stacks = [Stack(robot, dt=0.01).add(FootholdContact("tip", kind)) for kind in kinds]
    before = [key.key(stack, "1") for stack in stacks]
    file.write_text(file.read_text() + "# changed\n")
    assert [key.key(stack, "1") == known for stack, known in zip(stacks, before, strict=True)] == [True, False]


@pytest.mark.parametrize("size", [0, 1, 1 << 16, (1 << 16) + 1, 3 << 16])
def test_files_are_read_whole(size: int, tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(bytes(k % 251 for k in range(size)))
    assert file_bytes(tmp_path / "file") == (tmp_path / "file").read_bytes()


def test_add_returns_the_stack_that_it_was_called_on() -> None:
    """So that ``wbc.Stack(...).add(...).compile()`` is what a type checker takes it for."""
    stack = Stack(small.arm(), 0.01)
    assert stack.add(Posture()) is stack
    assert str(get_type_hints(Stack.add)["return"]) == "typing.Self"
