"""An item that is added to the package is a file and a line; all else follows from its declaration."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from tests.project.layout import ROOT

ITEM = '''"""The height of a frame's origin follows a number."""

from dataclasses import dataclass

import casadi as ca

from wbc.robot import Robot
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Input, Row, Task, Values


@dataclass(frozen=True)
class Height(Task):
    """The height of a frame's origin follows a number:

        e = p_z - target                                     [m]

    Attributes:
        frame: name of the frame.

    Inputs:
        target: height in the world [m]. Default 0.5.

    What it cannot do: say where the frame is sideways.

    Example:
        >>> import wbc
        >>> stack = wbc.Stack(wbc.robots.load("panda"), dt=0.005)
        >>> stack.add(wbc.tasks.Height("panda_hand_tcp"), name="height")
    """

    frame: str

    def inputs(self, robot: Robot) -> tuple[Input, ...]:
        return (Input("target", unit="m", default=0.5),)

    def rows(self, robot: Robot) -> tuple[Row, ...]:
        return (Row("z", "m"),)

    def error(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX:
        return kin.position(self.frame)[2] - inputs["target"]
'''
EXPORT = "    from wbc.tasks.height import Height as Height\n"
#: What the package does with it: a tick by name and by item, its values for type checkers, its page
USE = """
import wbc
from wbc.pages import folder, stub
from wbc.tasks import Height, registry
assert registry()["Height"] is Height
robot, height = wbc.robots.load("panda", shapes="none"), Height("panda_hand_tcp", gain=50.0)
controller = wbc.Stack(robot, dt=0.01).add(height, name="height").compile(backend="vm")
controller[height].target = 0.6
q = robot.neutral
for _ in range(100):
    q = robot.integrate(q, controller.step(q).v, 0.01)
assert abs(robot.pose(q, "panda_hand_tcp").translation[2] - 0.6) < 1e-4
assert "class HeightHandle(Handle):\\n    target: Any\\n    weight: float" in stub.text()
page = folder.made(Height)
assert page.startswith("# Height") and "height in the world" in page, page
assert "[Height](height.md)" in folder.index()
"""


def test_an_item_is_a_file_and_a_line(tmp_path: Path) -> None:
    package = tmp_path / "wbc"
    package.mkdir()
    for source in (*(ROOT / "wbc").iterdir(), ROOT / "robots"):
        (package / source.name).symlink_to(source)
    shutil.copytree(ROOT / "tasks", package / "tasks")
    (package / "tasks" / "height.py").write_text(ITEM)
    exported = package / "tasks" / "__init__.py"
    before, after = exported.read_text().split("else:", 1)
    exported.write_text(f"{before}{EXPORT}else:{after}")
    done = subprocess.run([sys.executable, "-c", USE], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
