"""``walker``: bodies with n arms, and the two-ended arm."""

from __future__ import annotations

import os
import pathlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import pi
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.robot.loading import finish
from wbc.robot.recipe import LinkShape, Recipe
from wbc.robot.sources.description import Description
from wbc.robots.link_tree import TreeLink, build_model, write_urdf
from wbc.robots.walker_arms import BODY, WalkerArm, chain, puma_rows, reversed_chain, two_ended_rows
from wbc.robots.walker_data import TwoEndedData, WalkerData
from wbc.robots.walker_shapes import body_shapes, link_pairs, puma_shapes, two_ended_shapes
from wbc.shapes import Capsule, PlacedShape, Sphere

BODY_SHAPES = ("capsules", "prism", "none")
#: Names that :func:`made_here` knows
MADE = ("walker", "two_ended_arm")


@dataclass(frozen=True, eq=False)
class Walker:
    """A machine that walks on holds with its hands.

    Attributes:
        robot: on a floating base that carries the frame ``body``; q is position, quaternion x, y, z, w, then the
            arms' joints.
        arms: in the order of the robot's joints.
        data: the numbers that it was made of.
        links: the tree of links and joints, as the URDF has it.
    """

    robot: Robot
    arms: tuple[WalkerArm, ...]
    data: WalkerData | TwoEndedData
    links: tuple[TreeLink, ...] = field(repr=False)

    def arm(self, name: str) -> WalkerArm:
        """The arm of a name.

        Raises:
            UnknownNameError: no such arm.
        """
        names = [arm.name for arm in self.arms]
        return self.arms[names.index(validation.one_of("arm", name, names))]

    @property
    def two_ended(self) -> bool:
        """It is the two-ended arm, and no body with arms."""
        return isinstance(self.data, TwoEndedData)

    @property
    def arm_data(self) -> WalkerData:
        """Numbers of a body with PUMA arms.

        Raises:
            ShapeError: another machine.
        """
        if not isinstance(self.data, WalkerData):
            raise ShapeError("walker", self.robot.name, "expected a body with arms")
        return self.data

    def urdf(self, path: str | os.PathLike[str]) -> pathlib.Path:
        """Writes the robot as URDF without its floating base; returns the file. The root link is ``body``.

        Raises:
            RobotFileError: the file cannot be written.
        """
        return write_urdf(path, self.robot, BODY, self.links)


#: More make a robot that nothing here could plan for
MOST_ARMS = 64


def walker(
    arms: int = 3,
    shoulder_radius: float | None = None,
    data: WalkerData | TwoEndedData | None = None,
    two_ended: bool = False,
    *,
    artificial_limits: bool = False,
    body_shape: str = "capsules",
) -> Walker:
    """A walking machine.

    A body with n PUMA 600 arms at 0, 360/n, ... degrees about its z axis, which points into the structure. An arm's
    base has its x axis outwards and its z axis along the body's. Frames: ``body``; of arm 1 ``arm1_base``,
    ``arm1_link1`` ... ``arm1_link6`` and ``arm1_hand``, the frame 6 of Table II, whose z axis is the approach
    direction.

    Two-ended: the arm with joints roll, yaw, pitch, pitch, pitch, yaw, roll. ``body`` is at its elbow, fixed to the
    first boom; ``arm1`` goes from there to one tip by joints 3, 2, 1, ``arm2`` to the other by joints 4 to 7.

    Args:
        arms: number of arms, 2 to 64; two ends always are two.
        shoulder_radius: body centre to arm base [m]; default: the data's.
        data: numbers; default: those of the file.
        two_ended: make the two-ended arm.
        artificial_limits: let theta3 end at the data's elbow limit. The shoulder limit joins two joints and is
            no limit of the robot.
        body_shape: ``capsules`` (about the edges of the body, and in its middle what leaves no gap for a hand),
            ``prism`` (a convex body, exact, which URDF does not get) or ``none``.

    Raises:
        ShapeError, NotFiniteError, RangeError: a bad number, or data of the other machine.
        UnknownNameError: no such body shape.
    """
    validation.one_of("body_shape", body_shape, BODY_SHAPES)
    two_ended = validation.flag("two_ended", two_ended)
    artificial_limits = validation.flag("artificial_limits", artificial_limits)
    if isinstance(arms, bool) or not isinstance(arms, int) or not 2 <= arms <= MOST_ARMS:
        raise RangeError("arms", arms, f"expected a whole number of arms, 2 to {MOST_ARMS}")
    if two_ended:
        if shoulder_radius is not None or arms not in (2, 3):
            raise RangeError("two_ended", (arms, shoulder_radius), "the two-ended arm has no body to place arms on")
        numbers = TwoEndedData.read() if data is None else data
        if not isinstance(numbers, TwoEndedData):
            raise ShapeError("data", type(numbers).__name__, "expected TwoEndedData")
        return _two_ended(numbers)
    found = WalkerData.read() if data is None else data
    if not isinstance(found, WalkerData):
        raise ShapeError("data", type(found).__name__, "expected WalkerData")
    if shoulder_radius is not None:
        found = replace(found, shoulder_radius=shoulder_radius)
    return _bodied(arms, found, artificial_limits, body_shape)


def made_here(name: str) -> Robot | None:
    """The robot that ``wbc.robots.load`` gives for the names :data:`MADE`; None for other names."""
    return walker(two_ended=name == MADE[1]).robot if name in MADE else None


def recipe_of(robot: Robot) -> Recipe:
    """The recipe that makes ``robot`` out of its model."""
    joints = robot.joint_names[1:]
    coordinates = [int(robot.model.idx_qs[robot.model.getJointId(joint)]) for joint in joints]
    return Recipe(
        robot.name,
        frames=robot.frames,
        neutral={joint: float(robot.neutral[k]) for joint, k in zip(joints, coordinates, strict=True)},
        acceleration={joint: float(robot.limits.acceleration[robot.dofs(joint)][0]) for joint in joints},
        source=robot.notes["acceleration"].split(";")[0],
        shapes=tuple(_link_shape(link, shape) for link, group in robot.shapes.items() for shape in group),
    )


def as_made(built: Robot, made: Robot, whole: bool, limits: Mapping[str, Any], neutral: Any) -> Robot:
    """``built`` out of the recipe of ``made``, with what a recipe does not hold.

    With ``whole`` links and joints are as they were made, unless the base is another: then shapes, pairs and notes are
    those of ``made``, except notes about ``limits`` and ``neutral`` that were given.
    """
    if whole and built.base == made.base:
        given = {key for key, value in limits.items() if value is not None} | ({"neutral"} if neutral else set())
        notes = {**built.notes, **{key: note for key, note in made.notes.items() if key not in given}}
        return replace(made, name=built.name, limits=built.limits, neutral=built.neutral, notes=notes)
    return replace(built, notes={**built.notes, **{key: made.notes[key] for key in ("inertia", "data")}})


def _link_shape(link: str, placed: PlacedShape) -> LinkShape:
    a, b = (tuple(end.tolist()) for end in placed.ends())
    if not isinstance(placed.shape, (Capsule, Sphere)):
        raise ShapeError("shape", placed.shape, "a recipe holds spheres and capsules only")
    return LinkShape(link, a, b, placed.shape.radius)


def _bodied(count: int, data: WalkerData, artificial_limits: bool, body_shape: str) -> Walker:
    names = [f"arm{i + 1}" for i in range(count)]
    corners = [pin.SE3(pin.utils.rotate("z", 2 * pi * i / count), np.zeros(3)) for i in range(count)]
    out = pin.SE3(np.eye(3), np.array([data.shoulder_radius, 0.0, 0.0]))
    bases = [corner * out for corner in corners]
    links: list[TreeLink] = []
    shapes = body_shapes([np.array(base.translation) for base in bases], data, body_shape)
    for name, base in zip(names, bases, strict=True):
        links.append(TreeLink(f"{name}_base", BODY, base))
        links += chain(name, f"{name}_base", puma_rows(data, artificial_limits), f"{name}_hand")
        shapes |= puma_shapes(name, data)
    neutral = {f"{name}_joint{k + 1}": x for name in names for k, x in enumerate(data.initial_posture)}
    robot = _robot(MADE[0] if count == 3 else f"walker{count}", links, neutral, {"body": BODY}, data.digest)
    arms = tuple(
        _arm(
            robot,
            name,
            base,
            [f"{name}_joint{k}" for k in range(1, 7)],
            [k for k in shapes if k.startswith(f"{name}_")],
        )
        for name, base in zip(names, bases, strict=True)
    )
    robot = _with_shapes(robot, shapes, link_pairs(arms, BODY in shapes, data))
    return Walker(robot, arms, data, tuple(links))


def _two_ended(data: TwoEndedData) -> Walker:
    rows = two_ended_rows(data)
    bases = [pin.SE3.Identity(), pin.SE3.Identity()]
    # Joints have the numbers 1 to 7 from tip to tip, whichever half they belong to
    links = [TreeLink("arm1_base", BODY, bases[0]), *reversed_chain("arm1", "arm1_base", rows[:3], "arm1_hand", 1)]
    links += [TreeLink("arm2_base", BODY, bases[1]), *chain("arm2", "arm2_base", rows[3:], "arm2_hand", 4)]
    neutral = {f"arm{1 if k <= 3 else 2}_joint{k}": angle for k, angle in enumerate(data.initial_posture, start=1)}
    robot = _robot(MADE[1], links, neutral, {"body": BODY, "elbow": BODY}, data.digest)
    model, shapes = robot.model, two_ended_shapes(data)
    arms = []
    for name, base in zip(("arm1", "arm2"), bases, strict=True):
        joints = [n for n in list(model.names) if str(n).startswith(name)]
        arms.append(_arm(robot, name, base, [str(n) for n in joints], [k for k in shapes if k.startswith(name)]))
    tip, boom, far_tip = "arm1_link1", "arm2_link4", "arm2_link7"
    pairs = [(tip, BODY), (tip, boom), (tip, far_tip), (BODY, far_tip), (boom, far_tip)]
    robot = _with_shapes(robot, shapes, pairs)
    return Walker(robot, tuple(arms), data, tuple(links))


def _robot(
    name: str, links: Sequence[TreeLink], neutral: Mapping[str, float], frames: Mapping[str, str], digest: str
) -> Robot:
    """The robot of a tree of links, without shapes."""
    source = f"assumed: rate / acceleration time of the data {digest}"
    acceleration = {link.joint: link.acceleration for link in links if link.joint}
    recipe = Recipe(name, neutral=neutral, frames=frames, acceleration=acceleration, source=source)
    notes = {"inertia": "the data have no masses: kinematics only", "data": digest}
    description = Description(build_model(name, BODY, links), "floating", notes=notes)
    robot = finish(description, recipe, "none", (), {})
    return replace(robot, notes={**robot.notes, "neutral": "the initial posture of the data"})


def _with_shapes(
    robot: Robot, shapes: Mapping[str, tuple[PlacedShape, ...]], pairs: Sequence[tuple[str, str]]
) -> Robot:
    notes = {
        "shapes": "assumed: capsules with the radii of the data",
        "self_pairs": f"{len(pairs)} pairs; left out: neighbours, and links that no joint moves apart or together",
    }
    return replace(robot.with_shapes(shapes).with_self_pairs(pairs), notes={**robot.notes, **notes})


def _arm(robot: Robot, name: str, base: pin.SE3, joints: Sequence[str], links: Sequence[str]) -> WalkerArm:
    model = robot.model
    first, last = robot.dofs(joints[0]), robot.dofs(joints[-1])
    start = int(model.idx_qs[model.getJointId(joints[0])])
    q = slice(start, start + len(joints))
    return WalkerArm(
        name, base, tuple(joints), q, slice(first.start, last.stop), f"{name}_base", f"{name}_hand", tuple(links)
    )
