"""The ten programs of examples/ as they are written with pink or mink: their lengths, and how the peers' are called."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from pathlib import Path

import wbc
from bench.descriptions import write_robot, write_urdf
from bench.pool import ROOT

HERE, EXAMPLES = Path(__file__).parent, ROOT / "examples"


@dataclass(frozen=True)
class Program:
    """A program that is written twice.

    Attributes:
        name: of the example. peer: "pink" or "mink". robot: what the peer loads, a file beside the example or a robot
            of the table, of which it gets a copy without meshes and the neutral joint positions. display: needs one.
    """

    name: str
    peer: str
    robot: str
    about: str
    display: bool = False

    @property
    def ours(self) -> Path:
        """The example."""
        return EXAMPLES / f"{self.name}.py"

    @property
    def theirs(self) -> Path:
        """The peer's program."""
        return HERE / f"{self.name}_{self.peer}.py"


PROGRAMS = (
    Program("moving_obstacle", "mink", "arm.xml", "follow a target past a moving obstacle"),
    Program("dual_arm", "pink", "pr2", "two arms carry a box"),
    Program("humanoid", "pink", "talos", "a humanoid reaches over its support polygon"),
    Program("mobile_base", "pink", "tiago_no_hand", "a mobile manipulator"),
    Program("own_urdf", "pink", "arm.urdf", "a URDF of one's own"),
    Program("own_mjcf", "mink", "arm.xml", "an MJCF file of one's own"),
    Program("custom_expression", "pink", "panda", "a task and a constraint of one's own"),
    Program("mujoco_servo", "mink", "arm.xml", "MuJoCo at 1 kHz"),
    Program("retarget", "mink", "g1", "key points of a person on a G1"),
    Program("drag", "mink", "arm.xml", "drag the hand with the mouse", display=True),
)


def length(path: Path) -> int:
    """Lines of code: neither empty, nor comments, nor docstrings."""
    text = path.read_text()
    lines = text.splitlines()
    code = {k for k, line in enumerate(lines, start=1) if line.strip() and not line.strip().startswith("#")}
    for node in ast.walk(ast.parse(text)):
        documented = isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef))
        if documented and ast.get_docstring(node) is not None:
            first = node.body[0]
            code -= set(range(first.lineno, (first.end_lineno or first.lineno) + 1))
    return len(code)


def arguments(program: Program, folder: Path) -> list[str]:
    """What the peer's program is given: a file, and joint positions of the table."""
    if (EXAMPLES / program.robot).exists():
        return [str(EXAMPLES / program.robot)]
    robot, file = wbc.robots.load(program.robot, shapes="none"), folder / f"{program.robot}.urdf"
    folder.mkdir(parents=True, exist_ok=True)
    if robot.base == "fixed":
        write_robot(robot, file)
        return [str(file)]
    # Bases of wheels are built by the peer itself
    write_urdf(Path(robot.source), file)
    words = [str(file)]
    for j in range(2, robot.model.njoints):
        value = float(robot.neutral[robot.model.idx_qs[j]])
        if int(robot.model.nqs[j]) == 1 and value != 0.0:
            words += [str(robot.model.names[j]), f"{value:.6g}"]
    return words
