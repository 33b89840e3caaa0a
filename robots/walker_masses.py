"""``with_masses``: a body with arms as bodies with masses and motors."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import ShapeError
from wbc.multibody import pin
from wbc.robots.walker_arms import BODY
from wbc.robots.walker_robot import Walker
from wbc.shapes import Capsule, PlacedShape, Sphere
from wbc.validation import Array

MASSES_FILE = Path(__file__).parent / "data" / "walker_masses.toml"


@dataclass(frozen=True)
class HoldRating:
    """What a hold bears along [N] and about [N m] each axis of a hand."""

    force: float
    torque: float


def with_masses(walker: Walker, gravity: Any = (0.0, 0.0, 0.0)) -> Walker:
    """The same machine with the masses, rotors and largest torques of robots/data/walker_masses.toml.

    Links are solid capsules as they are drawn, of equal density, with the published masses; the forearm's mass is
    carried by joint 3.

    Args:
        gravity: in the structure's axes [m/s^2].

    Raises:
        ShapeError: the two-ended arm, which has no such data, or gravity that is not three numbers.
    """
    if validation.instance("walker", walker, Walker, "a walker").two_ended:
        raise ShapeError("walker", walker.robot.name, "only bodies with arms have masses")
    published, assumed = _data()["published"], _data()["assumed"]
    robot, model = walker.robot, walker.robot.model.copy()
    model.gravity.linear = validation.real_array("gravity", gravity, (3,))
    effort, armature = np.full(robot.nv, np.inf), np.zeros(robot.nv)
    _load(model, 1, assumed["body"], [(BODY, shape) for shape in robot.shapes.get(BODY, ())])
    for arm in walker.arms:
        links = [f"{arm.name}_link{k}" for k in range(1, 7)]
        upper, forearm = ([(link, s) for s in robot.shapes[link]] for link in (links[1], links[3]))
        neck, hand = ([(link, s) for s in robot.shapes[link]] for link in (links[0], links[5]))
        wrist = [(links[4], PlacedShape(Sphere(walker.arm_data.hand_radius), pin.SE3.Identity()))]
        masses = [
            (assumed["neck"], neck),
            (published["upper_arm"], upper),
            (published["forearm"], forearm),
            (published["wrist_roll"], wrist),
            (published["wrist_bend"], wrist),
            (published["hand"] + assumed["gripper"], hand),
        ]
        for k, (mass, shapes) in enumerate(masses):
            _load(model, model.getJointId(f"{arm.name}_joint{k + 1}"), mass, shapes)
        effort[arm.v], armature[arm.v] = published["torques"], published["rotors"]
    model.armature = armature
    notes = {**robot.notes, "inertia": f"masses, rotors and torques of {MASSES_FILE.name}"}
    limits = robot.limits.override(effort=effort)
    return replace(walker, robot=replace(robot, model=model, limits=limits, notes=notes))


def hold_rating() -> HoldRating:
    """Of every hold, assumed."""
    assumed = _data()["assumed"]
    return HoldRating(assumed["hold_force"], assumed["hold_torque"])


@cache
def _data() -> dict[str, Any]:
    return tomllib.loads(MASSES_FILE.read_text(encoding="utf-8"))


def _load(model: pin.Model, joint: int, mass: float, shapes: list[tuple[str, PlacedShape]]) -> None:
    """Give a joint's body a mass, spread over shapes on links in the neutral configuration by their volumes."""
    parts = [_solid(placed) for _, placed in shapes]
    total = sum(part.mass for part in parts)
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    out = pin.Inertia.Zero()
    for (link, _), part in zip(shapes, parts, strict=True):
        frame = data.oMf[model.getFrameId(link)]
        share = mass / total
        scaled = pin.Inertia(share * part.mass, part.lever, share * part.inertia)
        out += (data.oMi[joint].inverse() * frame).act(scaled)
    model.inertias[joint] = out


def _solid(placed: PlacedShape) -> pin.Inertia:
    """Of density 1."""
    shape: Any = placed.shape
    if isinstance(shape, Sphere):
        inertia = pin.Inertia.FromSphere(_ball(shape.radius), shape.radius)
    elif isinstance(shape, Capsule):
        mass = np.pi * shape.radius**2 * shape.length + _ball(shape.radius)
        inertia = pin.Inertia.FromCapsule(mass, shape.radius, shape.length)
    else:
        points: Array = shape.points
        inertia = pin.Inertia.FromBox(1.0, *np.ptp(points, axis=0))
    return placed.placement.act(inertia)


def _ball(radius: float) -> float:
    return float(4.0 / 3.0 * np.pi * radius**3)
