"""Runs to convert: a robot of the table under a random stack, whose recordings hold what there is."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from mcap.reader import make_reader

import wbc
from wbc.multibody import pin
from wbc.shapes import Sphere

#: Robots of several kinds: fixed, floating (a quaternion in q), and with unbounded joints (two numbers each)
ROBOTS = ("panda", "solo8", "kinova")


def ticks_and_reasons(file: Path) -> tuple[int, list[str]]:
    """How many ticks an MCAP file has, and its sentences why."""
    ticks, said = 0, []
    with file.open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages():
            ticks += channel.topic == "/tick"
            if channel.topic == "/why":
                said.append(str(json.loads(message.data)["message"]))
    return ticks, said


def recorded(folder: Path, seed: int, ticks: int = 40) -> Path:
    """A recording of a random run."""
    rng = np.random.default_rng(seed)
    robot = wbc.robots.load(ROBOTS[seed % len(ROBOTS)])
    dt = float(rng.choice([0.001, 0.01, 0.02]))
    frame = [str(f.name) for f in robot.model.frames if f.type == pin.FrameType.BODY][-1]
    stack = wbc.Stack(robot, dt=dt)
    stack.add(wbc.tasks.EndEffector(frame), name="hand").add(wbc.tasks.Posture(), name="posture", weight=1e-3)
    stack.add(wbc.tasks.Damping(), name="damping").add(wbc.tasks.JointLimits())
    start = robot.pose(robot.neutral, frame)
    if robot.shapes:
        place = pin.SE3(np.eye(3), start.translation + rng.normal(size=3))
        stack.add(wbc.tasks.Obstacle(Sphere(0.05), pose=place), name="ball")
    controller = stack.compile(backend="vm")
    q = robot.neutral.copy()
    folder.mkdir(exist_ok=True)
    with controller.record(folder / "ticks.npz"):
        for k in range(ticks):
            move = pin.exp6(0.2 * np.sin(k / 10.0) * rng.normal(size=6))
            controller["hand"].target = start * move
            q = robot.integrate(q, controller.step(q).v, dt)
    return folder / "ticks.npz"
