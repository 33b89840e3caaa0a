"""Controllers that the tests export, and how they build and run what was written."""

from __future__ import annotations

import subprocess
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin

import wbc
from tests.controller.stacks import arm
from tests.torque.problems import controller as torques
from wbc.api import Controller
from wbc.shapes import Sphere

TRAP = Path(__file__).with_name("trap.c")
#: Without optimisation, functions that are always put in place are called: they are a third of the tick's machine code
CALLED = ("-Dalways_inline=unused", "-Wno-psabi")
STRICT = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror")
WRAP = "-Wl," + ",".join(f"--wrap={name}" for name in ("malloc", "calloc", "realloc", "free"))


def panda(backend: str = "native") -> Controller:
    """A hand, a posture, joint limits and a ball."""
    c = arm("panda").compile(backend=backend)
    c.reset(c.stack.robot.neutral)
    return c


def ur5(backend: str = "native") -> Controller:
    """A UR5 among three balls."""
    robot = wbc.robots.load("ur5")
    stack = wbc.Stack(robot, dt=0.005)
    stack.add(wbc.tasks.EndEffector(robot.frames["tip"]), name="hand")
    stack.add(wbc.tasks.Posture(), name="posture", weight=1e-3)
    stack.add(wbc.tasks.JointLimits(), name="limits")
    for k, place in enumerate(((0.4, 0.2, 0.3), (0.2, -0.5, 0.4), (-0.3, 0.3, 0.6))):
        pose = pin.SE3(np.eye(3), np.array(place))
        stack.add(wbc.tasks.Obstacle(Sphere(0.1), margin=0.02, pose=pose), name=f"ball {k}")
    c = stack.compile(backend=backend)
    c.reset(robot.neutral)
    return c


def legged(backend: str = "native") -> Controller:
    """A quadruped on two held feet; its rows compile in a third of the time of a humanoid."""
    robot = wbc.robots.load("hyq")
    stack = wbc.Stack(robot, dt=0.005, calm=True)
    for name in ("front_left_foot", "hind_right_foot"):
        stack.add(wbc.tasks.Hold(robot.frames[name], kind="position"), name=name)
    stack.add(wbc.tasks.EndEffector(robot.frames["front_right_foot"], kind="position"), name="hand")
    stack.add(wbc.tasks.EndEffector(robot.frames["base"]), name="body")
    stack.add(wbc.tasks.CenterOfMass(), name="com")
    stack.add(wbc.tasks.Posture(), name="posture", weight=1e-3)
    stack.add(wbc.tasks.JointLimits(), name="limits")
    c = stack.compile(backend=backend)
    c.reset(robot.neutral)
    return c


def grips(backend: str = "native") -> Controller:
    """The walker on two grips, commanded by torques."""
    c = torques("walker", backend).clone()
    c.reset(c.stack.robot.neutral)
    return c


CASES = {"panda": panda, "ur5": ur5, "legged": legged, "grips": grips}


def run(*command: str | Path, folder: Path) -> subprocess.CompletedProcess[str]:
    """A command's outcome."""
    return subprocess.run([str(c) for c in command], cwd=folder, capture_output=True, text=True, check=False)


def build(folder: Path, *options: str) -> None:
    """Both libraries; the rows, minutes of optimisation on large robots, without any, and the tick as asked for."""
    flags = f"CFLAGS={' '.join([*STRICT, *([] if options else CALLED)])}"
    done = run("make", "libwbc_tick.a", flags, "ROWS_FLAGS=-O0", "TICK_FLAGS=-O0", *options, folder=folder)
    assert done.returncode == 0, done.stderr


@cache
def exported(name: str, root: Path) -> Path:
    """The folder of a case, built; that of the Panda as users build it."""
    folder = CASES[name]().export(root / name)
    build(folder, *(["TICK_FLAGS=-O3"] if name == "panda" else []))
    return folder
