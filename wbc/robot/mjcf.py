"""Reading MJCF files: Pinocchio's parser for the model, the XML for joint ranges, keyframes and couplings.

Pinocchio 4.1 scales the range of a slide joint as if it were an angle, applies ranges of joints that say
``limited="false"``, and counts q from ``ref``; ranges are therefore taken from the XML here.
"""

from __future__ import annotations

import math
import pathlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.errors import RobotFileError
from wbc.robot.description import Description, Mimic, with_base
from wbc.robot.files import captured_stderr, read_xml
from wbc.validation import Array

_KINDS = {"hinge": (1, 1), "slide": (1, 1), "ball": (4, 3), "free": (7, 6)}


@dataclass(frozen=True)
class _Joint:
    """A joint element with its defaults applied; ranges in radians or metres, counted from ``ref``."""

    name: str
    kind: str
    lower: float
    upper: float
    ref: float


def read_mjcf(path: pathlib.Path, base: str | None = None) -> Description:
    """The description in an MJCF file; a free joint at the root makes it floating unless ``base`` says otherwise.

    Raises:
        RobotFileError: the file cannot be read or is no MJCF; the parser's reason is in the message.
    """
    _, tree = read_xml(path)
    if tree.tag != "mujoco":
        raise RobotFileError("robot", str(path), f"no MJCF: the root element is <{tree.tag}>, expected <mujoco>")
    tree = _include(tree, path.parent, 0)
    try:
        with captured_stderr() as noise:
            model = pin.buildModelFromMJCF(str(path))
    except (ValueError, RuntimeError) as error:
        reason = noise.reason or " ".join(str(error).split())
        raise RobotFileError("robot", str(path), f"the MJCF parser refused it: {reason}") from error
    notes = {"parser": noise.reason} if noise.reason else {}
    joints = list(_joints(tree))
    offsets = np.zeros(model.nq)
    if not _same_order(model, joints):
        notes["position"] = "the parser orders the joints otherwise than the file: its own ranges are kept"
    else:
        offsets = _set_ranges(model, joints)
        moved = [j.name for j in joints if j.ref]
        if moved:
            notes["position"] = f"q is counted from the file's ref for {', '.join(moved)}"
    states = _states(model, offsets)
    mimics, coupling_note = _couplings(tree)
    if coupling_note:
        notes["mimic"] = coupling_note
    drawn = np.concatenate([np.zeros(0), *states["qpos0"].values()]) if "qpos0" in states else None
    whole, kind = with_base(model, base, drawn)
    return Description(whole, kind, mimics, states, notes=notes, source=str(path))


def _include(tree: ElementTree.Element, folder: pathlib.Path, depth: int) -> ElementTree.Element:
    """The tree with its <include> elements replaced by what they name."""
    if depth > 16:
        raise RobotFileError("robot", str(folder), "more than 16 nested <include> elements")
    out = ElementTree.Element(tree.tag, tree.attrib)
    for child in tree:
        if child.tag == "include":
            _, other = read_xml(folder / child.get("file", ""))
            out.extend(_include(other, folder, depth + 1))
        else:
            out.append(_include(child, folder, depth))
    return out


def _joints(tree: ElementTree.Element) -> Iterator[_Joint]:
    """All joints, depth first, in the file's order."""
    compiler: dict[str, str] = {}
    for element in tree.findall("compiler"):
        compiler |= element.attrib
    classes: dict[str, dict[str, str]] = {}
    for default in tree.findall("default"):
        _read_classes(default, {}, classes, "main")
    for world in tree.findall("worldbody"):
        yield from _body_joints(world, "main", classes, compiler)


def _read_classes(
    element: ElementTree.Element, inherited: dict[str, str], classes: dict[str, dict[str, str]], name: str
) -> None:
    """Joint attributes of each default class; a nested class inherits from the one around it."""
    own = dict(inherited)
    for joint in element.findall("joint"):
        own |= joint.attrib
    classes.setdefault(name, {}).update(own)
    for child in element.findall("default"):
        _read_classes(child, own, classes, child.get("class", ""))


def _body_joints(
    body: ElementTree.Element, outer: str, classes: dict[str, dict[str, str]], compiler: dict[str, str]
) -> Iterator[_Joint]:
    active = body.get("childclass", outer)
    for element in body:
        if element.tag == "freejoint":
            yield _Joint(element.get("name", ""), "free", -math.inf, math.inf, 0.0)
        elif element.tag == "joint":
            attributes = classes.get(element.get("class", active), {}) | element.attrib
            yield _joint(attributes, compiler)
    for child in body:
        if child.tag in ("body", "frame"):
            yield from _body_joints(child, active, classes, compiler)


def _joint(attributes: dict[str, str], compiler: dict[str, str]) -> _Joint:
    kind = attributes.get("type", "hinge")
    degrees = kind == "hinge" and compiler.get("angle", "degree") == "degree"
    unit = math.pi / 180 if degrees else 1.0
    ref = float(attributes.get("ref", "0")) * unit if kind in ("hinge", "slide") else 0.0
    limited = attributes.get("limited", "auto")
    if limited == "auto":
        automatic = compiler.get("autolimits", "true") == "true"
        limited = "true" if automatic and "range" in attributes else "false"
    lower, upper = -math.inf, math.inf
    if limited == "true" and kind in ("hinge", "slide"):
        lower, upper = (float(x) * unit - ref for x in attributes.get("range", "0 0").split())
    return _Joint(attributes.get("name", ""), kind, lower, upper, ref)


def _parts(model: pin.Model) -> list[tuple[str, pin.JointModel]]:
    """(name, joint) of the model's joints in the order of q, composites taken apart."""
    parts = []
    for j in range(1, model.njoints):
        joint = model.joints[j]
        if joint.shortname() == "JointModelComposite":
            parts += [("", part) for part in joint.extract().joints]
        else:
            parts.append((str(model.names[j]), joint))
    return parts


def _same_order(model: pin.Model, joints: list[_Joint]) -> bool:
    """Whether the model has the file's joints in the file's order, judged by sizes, slides and names."""
    parts = _parts(model)
    if len(parts) != len(joints):
        return False
    for (name, part), joint in zip(parts, joints, strict=True):
        slides = part.shortname().startswith(("JointModelP",)) and part.nq == 1
        if (part.nq, part.nv) != _KINDS.get(joint.kind) or slides != (joint.kind == "slide"):
            return False
        if name and joint.name and name != joint.name:
            return False
    return True


def _set_ranges(model: pin.Model, joints: list[_Joint]) -> Array:
    """Writes the file's ranges into the model; returns what to take off the file's qpos, nq numbers."""
    lower, upper = np.array(model.lowerPositionLimit), np.array(model.upperPositionLimit)
    offsets = np.zeros(model.nq)
    index = 0
    for joint in joints:
        width = _KINDS[joint.kind][0]
        lower[index : index + width], upper[index : index + width] = joint.lower, joint.upper
        offsets[index : index + width] = joint.ref
        index += width
    model.lowerPositionLimit, model.upperPositionLimit = lower, upper
    return offsets


def _states(model: pin.Model, offsets: Array) -> dict[str, dict[str, Array]]:
    """The keyframes, by joint; ``qpos0`` is the pose that the file is drawn in."""
    states = {}
    for entry in model.referenceConfigurations:
        q = np.array(entry.data()) - offsets
        states[str(entry.key())] = {
            str(model.names[j]): q[model.idx_qs[j] : model.idx_qs[j] + model.nqs[j]] for j in range(1, model.njoints)
        }
    return states


def _couplings(tree: ElementTree.Element) -> tuple[tuple[Mimic, ...], str]:
    """Linear joint equalities, and a sentence about the equalities that are none."""
    mimics, lost = [], []
    for equality in tree.findall("equality"):
        for element in equality:
            terms = [float(x) for x in element.get("polycoef", "0 1 0 0 0").split()]
            if element.tag == "joint" and element.get("joint2") and not any(terms[2:]):
                offset, ratio = (terms + [0.0, 0.0])[:2]
                mimics.append(Mimic(element.get("joint1", ""), element.get("joint2", ""), ratio, offset))
            else:
                lost.append(f"<{element.tag} {element.get('name', '')}>".replace(" >", ">"))
    return tuple(mimics), f"equalities that are not represented: {', '.join(lost)}" if lost else ""
