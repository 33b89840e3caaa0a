"""What is installed: the wheel holds the whole package, its type marker and its data."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from setuptools.command.egg_info import FileList

from tests.project.layout import ROOT, module_name, pyproject, sources

DATA = {".toml", ".urdf", ".srdf", ".xml", ".c", ".h"}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    """The wheel, built from a copy of the tree by what pyproject.toml names, which is all that pip asks as well."""
    source = tmp_path_factory.mktemp("source")
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        (source / name).write_bytes((ROOT / name).read_bytes())
    for folder in ("wbc", "tasks", "robots"):
        for file in (ROOT / folder).rglob("*"):
            if file.is_file() and "__pycache__" not in file.parts:
                target = source / file.relative_to(ROOT)
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(file.read_bytes())
    out = tmp_path_factory.mktemp("wheel")
    backend = pyproject()["build-system"].get("build-backend", "setuptools.build_meta")
    command = [sys.executable, "-c", f"import sys; from {backend} import build_wheel; build_wheel(sys.argv[1])", out]
    done = subprocess.run(command, cwd=source, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return zipfile.ZipFile(next(out.glob("wbc-*.whl")))


def installed_name(path: Path) -> str:
    """Where a file of the tree stands in the wheel."""
    inside = path.relative_to(ROOT).as_posix()
    return inside if inside.startswith("wbc/") else f"wbc/{inside}"


def test_wheel_holds_every_module(wheel: zipfile.ZipFile) -> None:
    wanted = {installed_name(p) for p in sources("wbc", "tasks", "robots")}
    names = {n for n in wheel.namelist() if n.endswith(".py")}
    assert names == wanted
    assert {"wbc/tasks/base.py", "wbc/robots/__init__.py"} <= names


def test_wheel_holds_type_marker_licence_and_data(wheel: zipfile.ZipFile) -> None:
    names = set(wheel.namelist())
    assert "wbc/py.typed" in names
    assert any(n.endswith("licenses/LICENSE") for n in names)
    data = {p for f in ("wbc", "tasks", "robots") for p in (ROOT / f).rglob("*") if p.suffix in DATA and p.is_file()}
    assert {installed_name(p) for p in data} <= names
    assert not {n.split("/")[0] for n in names} - {"wbc", f"wbc-{pyproject()['project']['version']}.dist-info"}


def test_sdist_holds_examples_pages_and_what_makes_them() -> None:
    """By the rules of MANIFEST.in, which setuptools applies to the tree."""
    found = FileList()
    folders = ("examples", "docs", "requirements")
    found.allfiles = [
        p.relative_to(ROOT).as_posix()
        for p in (*ROOT.iterdir(), *(p for folder in folders for p in (ROOT / folder).rglob("*")))
        if p.is_file() and "__pycache__" not in p.parts
    ]
    for line in (ROOT / "MANIFEST.in").read_text().splitlines():
        found.process_template_line(line)
    top = {"CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "Makefile", "mkdocs.yml"}
    assert {name for name in found.allfiles if "/" in name} | top == {*found.files}


def test_every_package_is_listed() -> None:
    listed = set(pyproject()["tool"]["setuptools"]["packages"])
    present = {module_name(p) for p in sources("wbc", "tasks", "robots") if p.name == "__init__.py"}
    assert listed == present


def test_lock_pins_every_requirement() -> None:
    project = pyproject()["project"]
    pins = dict(
        line.split("==")
        for line in (ROOT / "requirements" / "lock.txt").read_text().splitlines()
        if line and not line.startswith("#")
    )
    extras = project["optional-dependencies"]
    wanted = list(project["dependencies"])
    left = ["dev"]
    for extra in left:
        for requirement in extras[extra]:
            if requirement.startswith("wbc["):
                left += requirement[4:-1].split(",")
            else:
                wanted.append(requirement)
    names = {r.replace("==", ">=").split(">=")[0].strip() for r in wanted}
    assert names <= set(pins)
    assert all(version[0].isdigit() for version in pins.values())
