"""Random stacks and random run-time values: weights from 1e-6 to 1e3, targets that conflict, obstacles that move."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import wbc
from wbc.api import Controller
from wbc.controller import core_of
from wbc.robot import Robot
from wbc.shapes import HalfSpace, Sphere
from wbc.tasks import (
    Damping,
    Elbow,
    EndEffector,
    Fixed,
    FrameVelocityLimit,
    Hold,
    JointLimits,
    Obstacle,
    Posture,
    WorkspaceBox,
)
from wbc.tasks._direction import Direction

DT = 0.005


def weight(rng: np.random.Generator) -> float:
    """From 1e-6 to 1e3, evenly in its logarithm."""
    return float(10.0 ** rng.uniform(-6.0, 3.0))


def random_stack(robot: Robot, rng: np.random.Generator) -> wbc.Stack:
    """Joint limits and a random choice of other items on random frames, some soft at a price, some tasks scaled."""
    names = [frame.name for frame in robot.model.frames if str(frame.name).startswith("f")]
    stack = wbc.Stack(robot, dt=DT, calm=bool(rng.random() < 0.8))

    def frame() -> str:
        return str(rng.choice(names))

    def some(probability: float) -> bool:
        return bool(rng.random() < probability)

    def price() -> float | None:
        return weight(rng) if some(0.2) else None

    for k in range(int(rng.integers(1, 4))):
        kind = str(rng.choice(["pose", "position", "orientation"]))
        stack.add(EndEffector(frame(), kind=kind), name=f"hand{k}", weight=weight(rng), scaled=some(0.2))
    stack.add(Posture(), name="posture", weight=weight(rng))
    if some(0.3):
        stack.add(Elbow(frame()), name="elbow", weight=weight(rng), scaled=some(0.2))
    if some(0.3):
        stack.add(Damping(), name="damping", weight=weight(rng))
    stack.add(JointLimits(return_rate=float(rng.uniform(0.0, 10.0))), name="limits")
    for k in range(int(rng.choice([0, 0, 1, 2]))):
        kind = str(rng.choice(["pose", "position", "orientation"]))
        stack.add(Hold(frame(), kind=kind), name=f"hold{k}", soft=price())
    for k in range(int(rng.choice([0, 1, 2]))):
        stack.add(Obstacle(Sphere(float(rng.uniform(0.02, 0.3))), margin=0.01), name=f"ball{k}", soft=price())
    if some(0.2):
        stack.add(Obstacle(HalfSpace()), name="floor")
    if some(0.3):
        stack.add(FrameVelocityLimit(frame(), linear=float(rng.uniform(0.05, 1.0))), name="speed", soft=price())
    if some(0.2):
        stack.add(WorkspaceBox(frame(), lower=(-0.5, -0.5, -0.5), upper=(0.5, 0.5, 0.5)), name="box", soft=price())
    if some(0.1):
        stack.add(Fixed(str(rng.choice([n for n in robot.joint_names if n != "base"]))), name="fixed")
    return stack


def pose(rng: np.random.Generator, spread: float = 1.0) -> pin.SE3:
    """Anywhere within some metres, turned in any way."""
    return pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(0.0, spread, 3))


def provoke(controller: Controller, rng: np.random.Generator) -> None:
    """Other run-time values: everything may change from one episode to the next."""
    for entry in controller.stack.entries:
        handle, item = controller[entry.name], entry.item
        if isinstance(item, (EndEffector, Hold)):
            kind = core_of(controller).layout.blocks[entry.name].slots["target"].input.kind
            place = pose(rng, 0.5 if rng.random() < 0.8 else 50.0)
            handle.target = {"pose": place, "rotation": place.rotation, "vector": place.translation}[kind]
            handle.gain = float(10.0 ** rng.uniform(-1.0, 2.0))
        if entry.is_task:
            handle.weight = weight(rng)
        elif isinstance(item, Obstacle):
            handle.pose = pose(rng, 0.6)
            handle.velocity = np.concatenate((rng.normal(0.0, 0.5, 3), np.zeros(3)))
        if entry.price is not None and not isinstance(item, Direction):
            handle.price = weight(rng)
        if not isinstance(item, JointLimits):
            handle.enabled = bool(rng.random() < 0.8)
