"""``operator_arm``: the redundant arms that operators command by hand, by their published chains."""

from __future__ import annotations

import functools
import os
import pathlib
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import pi
from typing import Any

import numpy as np

from wbc import validation
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.robot.loading import finish
from wbc.robot.recipe import LinkShape, Recipe
from wbc.robot.sources.description import Description
from wbc.robots import operator_chains as chains
from wbc.robots.link_tree import TreeLink, build_model, write_urdf
from wbc.robots.operator_chains import ChainJoint, Triple
from wbc.validation import Array

_FILE = pathlib.Path(__file__).parent / "data" / "operator_arms.toml"
ROOT = "base"
#: Frames that the source speaks of, of an arm with seven joints
_ROLES = {"tip": "tip", "shoulder": "F3", "elbow": "F4", "wrist": "F5"}


@dataclass(frozen=True, eq=False)
class OperatorArm:
    """An arm, or a tree of arms, and the links that it is made of.

    Attributes:
        robot: on a fixed base. Joints are ``joint1`` ..., frames ``F1`` ... at the joints (they turn with them) and
            ``tip``; ``end3`` is the far end of link 3, which is where the elbow is, on the body before it. Arms of a
            tree have ``arm1_``, ``arm2_`` and ``carrier_`` before these names.
        origin: where the numbers come from.
    """

    robot: Robot
    origin: str
    links: tuple[TreeLink, ...] = field(repr=False)

    def urdf(self, path: str | os.PathLike[str]) -> pathlib.Path:
        """Writes the robot as URDF; returns the file.

        Raises:
            RobotFileError: the file cannot be written.
        """
        return write_urdf(path, self.robot, ROOT, self.links)


@functools.cache
def _data() -> dict[str, dict[str, Any]]:
    return tomllib.loads(_FILE.read_text(encoding="utf-8"))


@dataclass(frozen=True)
class _ChainLimits:
    """Of the joints of one chain, and how thick its links are drawn [m]."""

    lower: Sequence[float]
    upper: Sequence[float]
    rate: float
    radius: float
    effort: float


def _chain(name: str) -> tuple[tuple[ChainJoint, ...], _ChainLimits, list[pin.Inertia | None]]:
    """The chain of a section of the file, with its limits and the inertias of its links."""
    numbers = dict(_data()[name])
    numbers.pop("origin")
    rate = numbers.pop("rate_per_s") if "rate_per_s" in numbers else numbers.pop("rate_deg_s") * pi / 180.0
    radius = numbers.pop("radius", 0.03)
    travel, effort = numbers.pop("limit_deg", None), numbers.pop("effort", np.inf)
    per_m, given = numbers.pop("mass_per_m", 0.0), [numbers.pop(key, []) for key in ("mass", "centre", "moments")]
    lower, upper = numbers.pop("lower_deg_or_m", ()), numbers.pop("upper_deg_or_m", ())
    make: Callable[..., tuple[ChainJoint, ...]] = getattr(chains, name.removesuffix("_simplified"))
    joints = make(**numbers)
    if travel is not None:
        lower, upper = [-travel] * len(joints), [travel] * len(joints)
    unit = [1.0 if joint.sliding else pi / 180.0 for joint in joints]
    low, high = ([x * u for x, u in zip(side, unit, strict=True)] for side in (lower, upper))
    bodies: list[pin.Inertia | None] = [pin.Inertia(m, np.array(c), _matrix(i)) for m, c, i in zip(*given, strict=True)]
    if per_m:
        bodies = [_tubes(ends, per_m, radius) if ends else None for ends in map(_offsets, joints)]
    return joints, _ChainLimits(low, high, rate, radius, effort), bodies or [None] * len(joints)


def _matrix(six: Sequence[float]) -> Array:
    """Of xx, xy, yy, xz, yz, zz."""
    xx, xy, yy, xz, yz, zz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _offsets(joint: ChainJoint) -> list[tuple[Triple, Triple]]:
    """Ends of the offsets of a link: along z, y and then x."""
    out, at = list[tuple[Triple, Triple]](), (0.0, 0.0, 0.0)
    for i in (2, 1, 0):
        to = (at[0], at[1], joint.after[2]) if i == 2 else (at[0], joint.after[1], at[2]) if i == 1 else joint.after
        if to != at:
            out.append((at, to))
            at = to
    return out


def _tubes(ends: Sequence[tuple[Triple, Triple]], mass_per_m: float, radius: float) -> pin.Inertia:
    """Thin tubes: m r^2 about their axis, m (r^2 / 2 + l^2 / 12) across it."""
    out = pin.Inertia.Zero()
    for first, last in ends:
        a, b = np.array(first), np.array(last)
        length = float(np.linalg.norm(b - a))
        mass, axis = mass_per_m * length, (b - a) / length
        across = radius**2 / 2.0 + length**2 / 12.0
        moments = mass * (across * np.eye(3) + (radius**2 - across) * np.outer(axis, axis))
        out = out + pin.Inertia(mass, (a + b) / 2.0, moments)
    return out


def _links(prefix: str, parent: str, place: pin.SE3, name: str) -> tuple[list[TreeLink], list[LinkShape]]:
    """Links of a chain on a frame, and capsules along its offsets: along z, y and then x."""
    joints, limits, bodies = _chain(name)
    links: list[TreeLink] = []
    shapes: list[LinkShape] = []
    for k, joint in enumerate(joints, start=1):
        link = f"{prefix}F{k}"
        bounds = (limits.lower[k - 1], limits.upper[k - 1], limits.rate, np.inf)
        about = (joint.axis, joint.sliding, limits.effort, bodies[k - 1])
        links.append(TreeLink(link, parent, place, f"{prefix}joint{k}", *bounds, *about))
        shapes += [LinkShape(link, *ends, limits.radius) for ends in _offsets(joint)]
        parent, place = link, pin.SE3(np.eye(3), np.array(joint.after))
        end = "tip" if k == len(joints) else f"end{k}"
        links.append(TreeLink(f"{prefix}{end}", link, place))
    return links, shapes


def _single(name: str) -> tuple[list[TreeLink], list[LinkShape], dict[str, str]]:
    links, shapes = _links("", ROOT, pin.SE3.Identity(), name)
    roles = _ROLES if any(link.name == "F5" for link in links) else {"tip": "tip"}
    return links, shapes, roles


def _two_arms(parent: str, place: pin.SE3, terminal: bool) -> tuple[list[TreeLink], list[LinkShape]]:
    """Body and arms of the dexterous manipulator; ``terminal``: held by the body, the body joint moves no arm."""
    numbers = _data()["spdm"]
    travel, rate = numbers["body_limit_deg"] * pi / 180.0, numbers["body_rate_deg_s"] * pi / 180.0
    high, wide, alike = numbers["height"], numbers["half_width"], _data()["spdm_arm"]
    column, shoulders = (
        _tubes([ends], alike["mass_per_m"], alike["radius"])
        for ends in (((0.0, 0.0, 0.0), (high, 0.0, 0.0)), ((high, -wide, 0.0), (high, wide, 0.0)))
    )
    whole = column if terminal else column + shoulders
    limits = -travel, travel, rate, np.inf, chains.X
    turning = TreeLink("body_turned", parent, place, "body_joint", *limits, inertia=whole)
    held = "body" if terminal else "body_turned"
    links = [TreeLink("body", parent, place, inertia=shoulders), turning] if terminal else [turning]
    shapes: list[LinkShape] = []
    for k, side in ((1, 1.0), (2, -1.0)):
        out = np.array([high, side * wide, 0.0])
        arm, capsules = _links(f"arm{k}_", held, pin.SE3(np.eye(3), out), "spdm_arm")
        links += arm
        shapes += capsules
    return links, shapes


def _spdm() -> tuple[list[TreeLink], list[LinkShape], dict[str, str]]:
    links, shapes = _two_arms(ROOT, pin.SE3.Identity(), terminal=False)
    return links, shapes, {"tip": "arm1_tip", "other_tip": "arm2_tip"}


def _spdm_on_ssrms() -> tuple[list[TreeLink], list[LinkShape], dict[str, str]]:
    carrier, tubes = _links("carrier_", ROOT, pin.SE3.Identity(), "ssrms")
    links, shapes = _two_arms("carrier_tip", pin.SE3.Identity(), terminal=True)
    roles = {"tip": "arm1_tip", "other_tip": "arm2_tip", "carrier_tip": "carrier_tip"}
    return carrier + links, tubes + shapes, roles


_SINGLE = (
    "planar_rp",
    "planar_3r",
    "spherical_4r",
    "ssrms_simplified",
    "ssrms",
    "spdm_arm_simplified",
    "spdm_arm",
)
_TREES = {"spdm": _spdm, "spdm_on_ssrms": _spdm_on_ssrms}
#: Names that :func:`operator_arm` and ``wbc.robots.load`` know
OPERATOR_ARMS = (*_SINGLE, *_TREES)


@functools.cache
def _parts(name: str) -> tuple[Recipe, pin.Model, tuple[TreeLink, ...]]:
    links, shapes, roles = _TREES[name]() if name in _TREES else _single(name)
    recipe = Recipe(name, about=_data()[name]["origin"], frames=roles, shapes=tuple(shapes))
    model = build_model(name, ROOT, links, floating=False)
    if _weighs(model):
        model.gravity.linear = np.zeros(3)  # what weighs of them is in orbit
    return recipe, model, tuple(links)


def _weighs(model: pin.Model) -> bool:
    return any(body.mass > 0.0 for body in model.inertias)


def operator_recipe(name: str) -> tuple[Recipe, pin.Model]:
    """What ``wbc.robots.load`` makes the robot of."""
    recipe, model, _ = _parts(name)
    return recipe, pin.Model(model)


def operator_arm(name: str) -> OperatorArm:
    """A redundant arm of the studies on manual control, by its published chain.

    ``planar_rp`` (turn and extension), ``planar_3r``, ``spherical_4r`` (roll, yaw, pitch, elbow), ``ssrms`` (Space
    Station arm, 7 joints) and ``ssrms_simplified`` (without offsets), ``spdm_arm`` (one dexterous arm, 7 joints) and
    ``spdm_arm_simplified``, ``spdm`` (body joint and two arms, 15 joints), ``spdm_on_ssrms`` (22 joints; held by its
    body, so that the body joint moves neither hand). In q the joints of a tree stand in the order carrier, body, arms.

    ``ssrms`` has masses, moments of inertia and torques as published, ``spdm_arm`` and the trees the published mass of
    the whole, spread along their links; the others are without masses. Which numbers are assumed,
    robots/data/operator_arms.toml and ``origin`` say.

    Raises:
        UnknownNameError: no such arm.
    """
    validation.one_of("operator_arm", name, OPERATOR_ARMS)
    recipe, model, links = _parts(name)
    notes: Mapping[str, str] = {} if _weighs(model) else {"inertia": "no masses: kinematics only"}
    robot = finish(Description(pin.Model(model), notes=notes), recipe, "auto", (), {})
    return OperatorArm(
        replace(robot, notes={**robot.notes, "origin": _data()[name]["origin"]}), _data()[name]["origin"], links
    )
