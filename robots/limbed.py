"""Bodies with limbs, made of the numbers in ``data/limbed.toml``, and arms of the table on one body."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from wbc import validation
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.robot.loading import finish
from wbc.robot.recipe import Recipe, segment_shape
from wbc.robot.sources.description import ROOT, Description
from wbc.robots.link_tree import TreeLink, build_model
from wbc.shapes import Box, PlacedShape
from wbc.validation import Array

#: Link and frame of the body
TRUNK = "body"
#: Numbers of the machines
MACHINES_FILE = Path(__file__).parent / "data" / "limbed.toml"
#: Axes of joints by their letters
_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def limbed(name: str) -> Robot:
    """A body with limbs on a floating base, at rest at the height of its feet.

    Frames: ``body``; of limb k from 1 on ``limbK_link1`` ... and the tip ``limbK_tip``. Links are capsules that end at
    the tip; bodies and capsules are solid.

    Raises:
        UnknownNameError: no such machine.
    """
    machines = _machines()
    return _made(name, machines[validation.one_of("machine", name, machines)])


def arms_on_body(arm: Robot, places: Sequence[pin.SE3], side: float, mass: float) -> Robot:
    """Several of one arm on a cubic body with a floating base.

    Frames: ``body``, and those of the arm with ``armK_`` before their names, from 1 on.

    Args:
        arm: on a fixed base. places: of its root on the body. side: of the body [m]. mass: of the body [kg].

    Raises:
        ShapeError: an arm with loops. RangeError: no side or mass.
    """
    arm.require_tree("arms on a body")
    side = validation.scalar("side", side, low=0.0, open_low=True, unit="m")
    box = Box((side, side, side))
    trunk = TreeLink(TRUNK, "", pin.SE3.Identity(), inertia=box.inertia(validation.scalar("mass", mass, low=0.0)))
    model = _with_trunk(f"{len(places)} {arm.name}", [], trunk.inertia)
    shapes: dict[str, tuple[PlacedShape, ...]] = {TRUNK: (PlacedShape(box, pin.SE3.Identity()),)}
    pairs = list[tuple[str, str]]()
    neutral, acceleration = dict[str, float](), dict[str, float]()
    for k, place in enumerate(places, start=1):
        one = pin.Model(arm.model)
        for j in range(1, one.njoints):
            one.names[j] = f"arm{k}_{one.names[j]}"
        for frame in one.frames:
            if frame.name != "universe":
                frame.name = f"arm{k}_{frame.name}"
        model = pin.appendModel(model, one, model.getFrameId(TRUNK), place)
        mine = {f"arm{k}_{link}": group for link, group in arm.shapes.items()}
        pairs += [(f"arm{k}_{a}", f"arm{k}_{b}") for a, b in arm.self_pairs or ()]
        pairs += [(a, b) for a in shapes for b in mine if a != TRUNK or not _first(model, b)]
        shapes |= mine
        for joint in arm.joint_names:
            row = arm.dofs(joint).start
            neutral[f"arm{k}_{joint}"] = float(arm.neutral[arm.position_index[row]])
            acceleration[f"arm{k}_{joint}"] = float(arm.limits.acceleration[row])
    recipe = Recipe(str(model.name), neutral=neutral, acceleration=acceleration, source=f"of {arm.name}")
    robot = finish(Description(model, "floating"), recipe, "none", (), {})
    return robot.with_shapes(shapes).with_self_pairs(pairs)


@cache
def _machines() -> dict[str, Any]:
    return tomllib.loads(MACHINES_FILE.read_text(encoding="utf-8"))


def _made(name: str, data: Mapping[str, Any]) -> Robot:
    body = Box(tuple(data["body"]))
    links, neutral, shapes = list[TreeLink](), dict[str, float](), {TRUNK: (PlacedShape(body, pin.SE3.Identity()),)}
    for number, (x, y, z, heading) in enumerate(data["places"], start=1):
        place = pin.SE3(pin.utils.rotate("z", heading), np.array([x, y, z]))
        parent = TRUNK
        for k, row in enumerate(data["limb"], start=1):
            link, joint = f"limb{number}_link{k}", f"limb{number}_joint{k}"
            segment, last = np.array(row["to"]), k == len(data["limb"])
            shape = _segment(segment, row["radius"], last)
            links.append(
                TreeLink(
                    link,
                    parent,
                    place,
                    joint,
                    float(row["range"][0]),
                    float(row["range"][1]),
                    row.get("rate", data["rate"]),
                    row.get("acceleration", data["acceleration"]),
                    _AXES[row["axis"]],
                    effort=row.get("effort", data["effort"]),
                    inertia=shape.placement.act(shape.shape.inertia(row["mass"])),
                )
            )
            shapes[link] = (shape,)
            neutral[joint] = row["rest"]
            parent, place = link, pin.SE3(np.eye(3), segment)
        along = data.get("tip") == "along"
        turn = pin.Quaternion.FromTwoVectors(np.array(_AXES["z"]), segment).matrix() if along else np.eye(3)
        links.append(TreeLink(f"limb{number}_tip", parent, pin.SE3(turn, segment)))
    acceleration = {link.joint: link.acceleration for link in links if link.joint}
    recipe = Recipe(name, data["about"], neutral=neutral, frames={"base": TRUNK}, acceleration=acceleration)
    recipe = replace(recipe, source=f"assumed, {MACHINES_FILE.name}")
    model = _with_trunk(name, links, body.inertia(data["mass"]))
    robot = finish(Description(model, "floating"), recipe, "none", (), {})
    at = robot.neutral.copy()
    at[2] = data["height"]
    count = len(data["limb"])
    return replace(robot.with_shapes(shapes).with_self_pairs(_pairs(len(data["places"]), count)), neutral=at)


def _segment(segment: Array, radius: float, last: bool) -> PlacedShape:
    """A capsule from joint to joint; the last one ends at the tip with its round end."""
    end = segment * (1.0 - radius / np.linalg.norm(segment)) if last else segment
    return segment_shape(np.zeros(3), end, radius, 0.0)


def _with_trunk(name: str, links: Sequence[TreeLink], inertia: pin.Inertia | None) -> pin.Model:
    model = build_model(name, TRUNK, links)
    if inertia is not None:
        model.appendBodyToJoint(model.getJointId(ROOT), inertia, pin.SE3.Identity())
    return model


def _pairs(limbs: int, count: int) -> list[tuple[str, str]]:
    """Links that must not touch: within a limb those with two others between them, of body and limb all from the
    third on, of two limbs all but the first links, which no joint brings together.
    """
    links = [[f"limb{number}_link{k}" for k in range(1, count + 1)] for number in range(1, limbs + 1)]
    out = [(TRUNK, link) for limb in links for link in limb[2:]]
    out += [(a, b) for limb in links for i, a in enumerate(limb) for b in limb[i + 3 :]]
    for i, limb in enumerate(links):
        out += [(a, b) for other in links[i + 1 :] for a in limb for b in other if (a, b) != (limb[0], other[0])]
    return out


def _first(model: pin.Model, link: str) -> bool:
    """Whether at most one joint is between the body and a link."""
    joint = model.frames[model.getFrameId(link)].parentJoint
    return bool(model.supports[joint].tolist().index(joint) <= 2)
