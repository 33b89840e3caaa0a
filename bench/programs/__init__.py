"""The ten programs of examples/ as they are written with pink or mink: their lengths and what they print."""

from __future__ import annotations

import ast
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pinocchio as pin

import wbc
from bench.descriptions import write_urdf
from bench.pool import ROOT
from bench.sheet import Sheet

HERE, EXAMPLES = Path(__file__).parent, ROOT / "examples"
COLUMNS = ("program", "lines here", "lines there", "with", "it says here", "it says there")


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
    # What the table locks has no joint for the peer either; bases of wheels it builds itself
    whole = pin.buildModelFromUrdf(robot.source)
    locked = set(list(whole.names)[1:]) - set(robot.joint_names) if robot.base == "fixed" else ()
    write_urdf(Path(robot.source), file, locked=locked)
    words = [str(file)]
    if robot.base != "fixed":
        for j in range(2, robot.model.njoints):
            value = float(robot.neutral[robot.model.idx_qs[j]])
            if int(robot.model.nqs[j]) == 1 and value != 0.0:
                words += [str(robot.model.names[j]), f"{value:.6g}"]
    return words


def said(command: list[str]) -> str:
    """The last line that a program prints, of its errors where it fails."""
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600, cwd=ROOT)
    if done.returncode:
        last = (done.stdout.strip().splitlines() or [""])[-1], (done.stderr.strip().splitlines() or ["fails"])[-1]
        return f"{last[0]}; fails: {last[1]}"
    return done.stdout.strip().splitlines()[-1]


def lengths() -> Sheet:
    """Lines of each program, here and there."""
    rows = [(p.about, str(length(p.ours)), str(length(p.theirs)), p.peer) for p in PROGRAMS]
    return Sheet("Programs", COLUMNS[:4], rows)


def results(python: str, folder: Path) -> Sheet:
    """The same, with what each program says at its end; both are run."""
    rows = []
    for program, row in zip(PROGRAMS, lengths().rows, strict=True):
        if program.display:
            rows.append((*row, "runs in a browser", "needs a display"))
            continue
        ours = said([sys.executable, str(program.ours)])
        rows.append((*row, ours, said([python, str(program.theirs), *arguments(program, folder)])))
    return Sheet("Programs", COLUMNS, rows)
