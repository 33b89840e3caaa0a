"""The package and its commands start quickly, because what only some need is imported when it is used."""

from __future__ import annotations

import ast
import json
import pathlib
import subprocess
import sys

import pytest

from wbc import lazy

ROOT = pathlib.Path(__file__).parents[2]
HEAVY = ("matplotlib", "typer", "rich", "scipy", "pyarrow", "toppra", "ruckig", "osqp")
#: What robots are made of, besides
NUMBERS = ("numpy", "casadi", "pinocchio", "coal", "daqp", "flint")
#: Parts of the package that commands about robots and coordinates do without
UPPER = tuple(f"wbc.{name}" for name in ("controller", "qp", "export", "ik", "track", "climb", "trajectory"))
#: Arguments of a command -> what it must not import
BUDGETS = {
    "--help": (*HEAVY[3:], "matplotlib", *NUMBERS, *UPPER, "wbc.robot", "wbc.tasks"),
    "--version": (*HEAVY[2:], "matplotlib", *NUMBERS, *UPPER, "wbc.robot", "wbc.tasks"),
    "robots": (*HEAVY[3:], "matplotlib", *UPPER, "wbc.coordinates", "flint"),
    "coordinates": (*HEAVY[3:], "matplotlib", *UPPER, "flint"),
    "ik --help": (*HEAVY[3:], "matplotlib", *NUMBERS, *UPPER, "wbc.robot", "wbc.tasks"),
    # Its requests check numbers and poses
    "walk --help": (*HEAVY[3:], "matplotlib", *NUMBERS[4:], "casadi", "wbc.climb.loop", "wbc.robot", "wbc.tasks"),
}


def run(code: str) -> str:
    """Standard output of a fresh interpreter, outside the repository's folder."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd="/")
    return done.stdout


@pytest.mark.parametrize("arguments", BUDGETS)
def test_small_commands_import_little(arguments: str) -> None:
    code = (
        "import contextlib, io, json, sys\n"
        f"sys.argv = ['wbc', *{arguments.split()}]\n"
        "from wbc.cli import main\n"
        "with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):\n"
        "    main()\n"
        "print(json.dumps(list(sys.modules)))"
    )
    loaded = set(json.loads(run(code)))
    assert "wbc.cli.app" in loaded
    assert not loaded & set(BUDGETS[arguments])


def test_completion_imports_no_command() -> None:
    code = "import atexit, sys; atexit.register(lambda: print(*sys.modules)); from wbc.cli import main; main()"
    words = {"_WBC_COMPLETE": "complete_bash", "COMP_WORDS": "wbc tr", "COMP_CWORD": "1"}
    program = f"import os, sys; os.environ |= {words}; sys.argv = ['wbc']; {code}"
    found, loaded = run(program).split("\n", 1)
    assert found.split() == ["track"]
    assert not set(loaded.split()) & {*NUMBERS, *UPPER, "wbc.cli.track"}


PACKAGES = [file for folder in ("wbc", "tasks", "robots") for file in sorted((ROOT / folder).rglob("__init__.py"))]


@pytest.mark.parametrize(
    "file", [file for file in PACKAGES if "lazy.attach" in file.read_text()], ids=lambda file: file.parent.name
)
def test_public_names_are_those_that_the_parser_finds(file: pathlib.Path) -> None:
    blocks = (node for node in ast.parse(file.read_text()).body if isinstance(node, ast.If))
    imports = [node for block in blocks for node in block.body if isinstance(node, ast.ImportFrom)]
    assert lazy.imports_in(file.read_text()) == {
        a.asname or a.name: (n.module, a.name) for n in imports for a in n.names
    }
    assert imports


def test_import_of_the_package_imports_none_of_its_floors() -> None:
    loaded = json.loads(run("import json, sys, wbc; print(json.dumps(list(sys.modules)))"))
    assert {name for name in loaded if name.startswith("wbc.")} == {"wbc.lazy"}
    assert not set(loaded) & {*HEAVY, *NUMBERS}


@pytest.mark.parametrize("module", ["wbc", "wbc.tasks", "wbc.robots", "wbc.trajectory"])
def test_import_leaves_heavy_packages_alone(module: str) -> None:
    loaded = set(json.loads(run(f"import json, sys, {module}; print(json.dumps([m for m in sys.modules]))")))
    assert module in loaded
    assert not loaded & set(HEAVY)


def test_version_is_that_of_the_distribution() -> None:
    code = "import wbc, importlib.metadata as m; print(wbc.__version__ == m.version('wbc'))"
    assert run(code).strip() == "True"


#: What a first command does without: other descriptions of robots, shapes, levels, temporary files
UNUSED = (
    "concurrent.futures", "csv", "decimal", "importlib.resources", "platformdirs", "shutil", "tempfile", "tomllib",
    "wbc.qp.levels", "wbc.robot.dead_points", "wbc.robot.geometry.styles", "wbc.shapes.box", "wbc.symbolic.gaps",
    "wbc.symbolic.manipulability", "wbc.symbolic.two_velocities", "wbc.tick.levels",
)  # fmt: skip


def test_a_first_command_imports_what_it_uses(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is in the cache, and no compiler is there."""
    monkeypatch.setenv("WBC_CACHE", str(tmp_path))
    monkeypatch.setenv("WBC_CC", "")
    file = tmp_path / "arm.urdf"
    file.write_text(
        '<robot name="arm"><link name="base"/><link name="tip"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="turn" type="revolute"><parent link="base"/><child link="tip"/><axis xyz="0 0 1"/>'
        '<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>'
    )
    code = (
        "import json, sys, wbc\n"
        f"robot = wbc.robots.load({str(file)!r})\n"
        "stack = wbc.Stack(robot, dt=0.01).add(wbc.tasks.EndEffector('tip')).add(wbc.tasks.JointLimits())\n"
        "assert stack.compile().step([0.1]).status == 'solved'\n"
        "print(json.dumps(list(sys.modules)))"
    )
    loaded = set(json.loads(run(code)))
    assert "wbc.tick.generic" in loaded
    assert not loaded & set(UNUSED)
