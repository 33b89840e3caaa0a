"""Tasks under test: how each is declared, and what it is about as Pinocchio sees it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

from tests.closed_loop.eyes import Array, Eyes, wrap
from tests.closed_loop.machines import STARTS
from tests.tasks.robots import FRAMES, Frames
from wbc.robot import Robot
from wbc.tasks import (
    CenterOfMass,
    Damping,
    Elbow,
    EndEffector,
    Expression,
    Input,
    Item,
    JointLimits,
    PitchPlane,
    PlaneReference,
    Posture,
    Task,
)

#: A point of the elbow's body, and the frame's weights that leave the turn about its z axis free
POINT = (0.1, -0.2, 0.05)
FREE_Z = (1, 1, 1, 1, 1, 0)


@dataclass(frozen=True, eq=False)
class Subject:
    """A task whose error must fall like exp(-gain t).

    Attributes:
        cls: its class.
        declare: the item, from frames and robot.
        measure: the task's quantity at a configuration, as a target would be written.
        error: what the quantity at a configuration lacks, in coordinates that the class says decay independently.
        reach: how far targets are from starts in every degree of freedom [rad, m].
        usable: whether a configuration is away from the task's singular sets.
        rate: the input that takes the target's velocity.
        starts: of :func:`tests.closed_loop.tasks.decay`; more where a wrong formula shows from few of them only.
    """

    cls: type[Task]
    declare: Callable[[Frames, Robot], Item]
    measure: Callable[[Eyes, Frames, Array], Any]
    error: Callable[[Eyes, Frames, Array, Any], Array]
    reach: float = 0.25
    usable: Callable[[Eyes, Frames, Array], bool] = lambda eyes, f, q: True
    rate: str = "feedforward"
    starts: int = STARTS


def pose_error(eyes: Eyes, f: Frames, q: Array, target: pin.SE3) -> Array:
    here = eyes.pose(q, f.tip)
    return np.concatenate([here.translation - target.translation, pin.log3(here.rotation @ target.rotation.T)])


def own_axes_error(eyes: Eyes, f: Frames, q: Array, target: pin.SE3) -> Array:
    """Without the turn about z, which is free."""
    here = eyes.pose(q, f.tip)
    turn = pin.log3(target.rotation.T @ here.rotation)
    return np.concatenate([here.rotation.T @ (here.translation - target.translation), turn[:2]])


def seen_from_base(eyes: Eyes, f: Frames, q: Array) -> pin.SE3:
    base, tip = eyes.poses(q, f.base, f.tip)
    return base.actInv(tip)


def elbow_point(eyes: Eyes, f: Frames, q: Array) -> Array:
    return np.array(eyes.pose(q, f.middle).act(np.array(POINT)))


def height_and_distance(eyes: Eyes, f: Frames, q: Array) -> Array:
    tip, middle, base = (p.translation for p in eyes.poses(q, f.tip, f.middle, f.base))
    return np.array([tip[2] - 0.3 * middle[1], np.linalg.norm(tip - base)])


def declare_expression(f: Frames, robot: Robot) -> Item:
    """Height of the tip less a part of the elbow's y, and distance of the tip from the base frame."""
    return Expression(
        lambda kin, p: (
            ca.vertcat(
                kin.position(f.tip)[2] - 0.3 * kin.position(f.middle)[1],
                ca.norm_2(kin.position(f.tip) - kin.position(f.base)),
            )
            - p["target"]
        ),
        units="m",
        inputs=(
            Input("target", unit="m", size=2, default=np.zeros(2), rate="speed"),
            Input("speed", unit="m/s", size=2, default=np.zeros(2)),
        ),
    )


def plane_subject(axis: bool) -> Subject:
    def joint(f: Frames) -> str | None:
        return f.axis if axis else None

    def declare(f: Frames, robot: Robot) -> Item:
        return PitchPlane(*f.plane, axis=f.axis, reference=PlaneReference()) if axis else PitchPlane(*f.plane)

    return Subject(
        PitchPlane,
        declare,
        lambda eyes, f, q: eyes.plane_angle(q, f.plane, joint(f)),
        lambda eyes, f, q, target: np.array([wrap(eyes.plane_angle(q, f.plane, joint(f)) - target)]),
        usable=lambda eyes, f, q: eyes.plane_is_clear(q, f.plane, joint(f)),
    )


SUBJECTS: dict[str, Subject] = {
    "hand": Subject(
        EndEffector,
        lambda f, robot: EndEffector(f.tip),
        lambda eyes, f, q: eyes.pose(q, f.tip),
        pose_error,
    ),
    "hand, turn about z free, own axes": Subject(
        EndEffector,
        lambda f, robot: EndEffector(f.tip, axes="frame", weights=FREE_Z),
        lambda eyes, f, q: eyes.pose(q, f.tip),
        own_axes_error,
    ),
    "hand's place from a moving frame": Subject(
        EndEffector,
        lambda f, robot: EndEffector(f.tip, kind="position", relative_to=f.base),
        lambda eyes, f, q: np.array(seen_from_base(eyes, f, q).translation),
        lambda eyes, f, q, target: seen_from_base(eyes, f, q).translation - target,
    ),
    "hand's turn from a moving frame": Subject(
        EndEffector,
        lambda f, robot: EndEffector(f.tip, kind="orientation", relative_to=f.base),
        lambda eyes, f, q: seen_from_base(eyes, f, q).rotation.copy(),
        lambda eyes, f, q, target: pin.log3(seen_from_base(eyes, f, q).rotation @ target.T),
    ),
    "elbow": Subject(
        Elbow,
        lambda f, robot: Elbow(f.middle, offset=POINT),
        elbow_point,
        lambda eyes, f, q, target: elbow_point(eyes, f, q) - target,
    ),
    "elbow, own axes": Subject(
        Elbow,
        lambda f, robot: Elbow(f.middle, offset=POINT, axes="frame"),
        elbow_point,
        lambda eyes, f, q, target: eyes.pose(q, f.middle).rotation.T @ (elbow_point(eyes, f, q) - target),
    ),
    "plane of three points": plane_subject(axis=False),
    "plane across an axis": plane_subject(axis=True),
    "posture": Subject(
        Posture,
        lambda f, robot: Posture(joints=robot.joint_names),
        lambda eyes, f, q: q.copy(),
        lambda eyes, f, q, target: np.array(pin.difference(eyes.model, target, q)),
        reach=0.6,
    ),
    "centre of mass": Subject(
        CenterOfMass,
        lambda f, robot: CenterOfMass(),
        lambda eyes, f, q: eyes.center_of_mass(q),
        lambda eyes, f, q, target: eyes.center_of_mass(q) - target,
    ),
    "expression": Subject(
        Expression,
        declare_expression,
        height_and_distance,
        lambda eyes, f, q, target: height_and_distance(eyes, f, q) - target,
        rate="speed",
    ),
}


def damping_weights(robot: Robot) -> Array:
    """0.1, 0.2, ...: every degree of freedom is slowed by another factor."""
    return 0.1 * np.arange(1, robot.nv + 1)


def task_items(name: str, robot: Robot) -> dict[str, Item]:
    """Every task under test by name; damping and a plane's rate, which have no error that decays; "rest", a posture to
    rest in, and joint limits.
    """
    f = FRAMES[name]
    return {key: s.declare(f, robot) for key, s in SUBJECTS.items()} | {
        "damping": Damping(weights=damping_weights(robot)),
        "rate of the plane": PitchPlane(*f.plane, axis=f.axis),
        "rest": Posture(),
        "limits": JointLimits(),
    }
