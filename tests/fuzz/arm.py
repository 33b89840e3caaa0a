"""An arm of three joints and stacks on it, whose calls are spoiled by :mod:`tests.fuzz.surface`."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import wbc
from wbc import shapes, tasks
from wbc.robot import Robot
from wbc.robots import DHRow

DT = 0.01
Q = np.array([0.3, 0.8, -1.5])
#: Triangles of a tetrahedron of four of the corners
HULL = np.array([[0, 1, 2], [0, 1, 4], [0, 2, 4], [1, 2, 4]])
ONE = pin.SE3.Identity()
TIP, MIDDLE = "tip", "link2"
CUBE = np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1)])
#: A shoulder that turns about z and y, an elbow about y, and capsules of 0.4 m
URDF = "".join(
    f"""<link name="link{k}"><inertial><origin xyz="0.2 0 0"/><mass value="1"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial><collision>
    <origin xyz="0.2 0 0" rpy="0 1.5708 0"/><geometry><cylinder radius="0.04" length="0.2"/></geometry>
    </collision></link>
    <joint name="joint{k}" type="revolute"><parent link="{parent}"/><child link="link{k}"/><origin xyz="{x} 0 0"/>
    <axis xyz="{axis}"/><limit lower="-2.5" upper="2.5" velocity="1" effort="50"/></joint>"""
    for k, parent, x, axis in ((1, "base", 0, "0 0 1"), (2, "link1", 0, "0 1 0"), (3, "link2", 0.4, "0 1 0"))
)
TOOL = """<link name="tip"/><joint name="tool" type="fixed"><parent link="link3"/><child link="tip"/>
    <origin xyz="0.4 0 0"/></joint>"""
ROWS = tuple(
    DHRow(a=0.4, lower=-2.5, upper=2.5, velocity=1.0, acceleration=5.0, effort=50.0, name=f"joint{k}")
    for k in (1, 2, 3)
)
BOUNDS = {"velocity": 1.0, "acceleration": 2.0, "jerk": 10.0}


@cache
def robot() -> Robot:
    """The arm, with shapes on its links, from a file."""
    file = Path(_folder().name) / "arm.urdf"
    file.write_text(f'<robot name="arm"><link name="base"/>{URDF}{TOOL}</robot>')
    return wbc.robots.load(file, acceleration=5.0)


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    """Where the arm's file lies as long as the process lives."""
    return tempfile.TemporaryDirectory(prefix="wbc-fuzz-")


def height(kin: Any, inputs: Any) -> Any:
    """Of the tip over a plane that the input ``level`` moves."""
    return kin.position(TIP)[1] - inputs["level"]


def stack() -> wbc.Stack:
    """A task, a scaled one, a soft obstacle that is an expression, one that is measured, limits, an own expression."""
    out = wbc.Stack(robot(), DT)
    out.add(tasks.EndEffector(TIP, kind="position"), name="hand")
    out.add(tasks.Posture(), name="posture", weight=1e-2)
    out.add(tasks.Obstacle(shapes.Sphere(0.1)), name="ball", soft=10.0)
    out.add(tasks.Obstacle(shapes.Box((0.1, 0.1, 0.1)), closest=2), name="box")
    level = tasks.Input("level", unit="m", default=0.1)
    out.add(tasks.Expression(height, units="m", inputs=(level,)), name="height", weight=1e-3)
    out.add(tasks.JointLimits(), name="limits")
    return out


def item() -> tasks.Item:
    """A task of this arm."""
    return tasks.EndEffector(TIP, kind="position")


def plain() -> wbc.Stack:
    """A task and limits."""
    out = wbc.Stack(robot(), DT).add(item(), name="hand")
    return out.add(tasks.JointLimits(), name="limits")


def stack_of_poses() -> wbc.Stack:
    """A task of poses."""
    return wbc.Stack(robot(), DT).add(tasks.EndEffector(TIP), name="hand")


@cache
def compiled() -> wbc.Controller:
    """On the virtual machine."""
    return stack().compile(backend="vm")


@cache
def solvers() -> wbc.InverseKinematics:
    """On the virtual machine, with one goal."""
    return wbc.InverseKinematics(plain(), ["hand"], "vm")
