"""MJCF as XML: one self-contained tree for Pinocchio's parser, and the joints with their defaults applied.

Pinocchio 4.1 reads no <include>, only the first body of the world, confuses bodies without names, and drops what
stands in a <frame>; none of this is reported. So the tree is put into a form that it reads, or refused.
"""

from __future__ import annotations

import contextlib
import copy
import math
import pathlib
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass

from wbc.errors import RobotFileError
from wbc.robot.sources.files import read_xml

Element = ElementTree.Element

#: Elements that add bodies or change poses, and that the parser does not know.
_REFUSED = ("frame", "replicate", "composite", "flexcomp", "attach")
_FOLDERS = ("meshdir", "texturedir", "assetdir")


@dataclass(frozen=True)
class MjcfJoint:
    """A joint element with its defaults applied; ranges and ``ref`` in radians or metres."""

    name: str
    kind: str
    lower: float
    upper: float
    ref: float


def read_tree(path: pathlib.Path) -> Element:
    """The tree of an MJCF file: includes put in, one <compiler> with absolute folders, every body named, one root body.

    Raises:
        RobotFileError: not readable, no MJCF, or with elements that would be lost.
    """
    _, tree = read_xml(path)
    if tree.tag != "mujoco":
        raise RobotFileError("robot", str(path), f"no MJCF: the root element is <{tree.tag}>, expected <mujoco>")
    tree = _include(tree, path.parent, 0)
    for element in tree.iter():
        if element.tag in _REFUSED:
            reason = f"<{element.tag}> is not supported: write out what it stands for, or pip install wbc[mujoco]"
            raise RobotFileError("robot", str(path), reason)
    _merge_compilers(tree, path.parent)
    _without_mocap(tree)
    _one_root(tree, path)
    names = {body.get("name") for body in tree.iter("body")}
    number = 0
    for body in tree.iter("body"):
        while not body.get("name"):
            number += 1
            if f"body{number}" not in names:
                body.set("name", f"body{number}")
    return tree


def with_weight(tree: Element) -> Element:
    """The tree with the mass of every geom that MuJoCo weighs.

    Pinocchio 4.1 takes geoms with contype and conaffinity 0 for pictures and leaves their mass out, where MuJoCo counts
    all geoms of a body without <inertial>. Such geoms touch something here; shapes are read from the tree as it was.
    """
    out = copy.deepcopy(tree)
    for body in out.iter("body"):
        if body.find("inertial") is None:
            for geom in body.findall("geom"):
                geom.set("contype", "1")
    return out


@contextlib.contextmanager
def parser_file(tree: Element) -> Iterator[str]:
    """A temporary file with the tree, as the parser takes file names only."""
    with tempfile.TemporaryDirectory(prefix="wbc-mjcf-") as folder:
        file = pathlib.Path(folder) / "model.xml"
        ElementTree.ElementTree(tree).write(file, encoding="utf-8", xml_declaration=True)
        yield str(file)


def _include(tree: Element, folder: pathlib.Path, depth: int) -> Element:
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


def _merge_compilers(tree: Element, folder: pathlib.Path) -> None:
    """One <compiler> at the front; folders of assets become absolute, so that the tree may be stored elsewhere."""
    merged: dict[str, str] = {}
    for element in tree.findall("compiler"):
        merged |= element.attrib
        tree.remove(element)
    assets = merged.pop("assetdir", "")
    for key in _FOLDERS[:2]:
        merged[key] = str((folder / merged.get(key, assets)).resolve()) + "/"
    tree.insert(0, ElementTree.Element("compiler", merged))


def _without_mocap(tree: Element) -> None:
    """Takes out bodies that a program moves, such as targets: they are no part of a robot."""
    for world in tree.findall("worldbody"):
        for body in world.findall("body"):
            if body.get("mocap") == "true":
                world.remove(body)


def _one_root(tree: Element, path: pathlib.Path) -> None:
    """Puts several bodies of the world under one that is welded to it.

    Raises:
        RobotFileError: one of them moves freely, which Pinocchio reads only at the root.
    """
    worlds = tree.findall("worldbody")
    bodies = [(world, body) for world in worlds for body in world.findall("body")]
    if len(bodies) < 2:
        return
    for _, body in bodies:
        if body.find("freejoint") is not None or body.find("joint[@type='free']") is not None:
            what = f"body {body.get('name', '')!r} moves freely beside others: pip install wbc[mujoco]"
            raise RobotFileError("robot", str(path), what)
    root = ElementTree.Element("body", {"name": "world_bodies"})
    for world, body in bodies:
        world.remove(body)
        root.append(body)
    worlds[0].append(root)


def joints(tree: Element) -> list[MjcfJoint]:
    """All joints, depth first, in the file's order."""
    compiler = tree.find("compiler")
    classes: dict[str, dict[str, str]] = {}
    for default in tree.findall("default"):
        _read_classes(default, {}, classes, default.get("class", "main"))
    settings = dict(compiler.attrib) if compiler is not None else {}
    return [j for world in tree.findall("worldbody") for j in _body_joints(world, "main", classes, settings)]


def _read_classes(element: Element, inherited: dict[str, str], classes: dict[str, dict[str, str]], name: str) -> None:
    """Joint attributes of each default class; a nested class inherits from the one around it."""
    own = classes.get("main", {}) | inherited
    for joint in element.findall("joint"):
        own |= joint.attrib
    classes.setdefault(name, {}).update(own)
    for child in element.findall("default"):
        _read_classes(child, own, classes, child.get("class", ""))


def _body_joints(
    body: Element, outer: str, classes: dict[str, dict[str, str]], compiler: dict[str, str]
) -> Iterator[MjcfJoint]:
    active = body.get("childclass", outer)
    for element in body:
        if element.tag == "freejoint":
            yield MjcfJoint(element.get("name", ""), "free", -math.inf, math.inf, 0.0)
        elif element.tag == "joint":
            yield _joint(classes.get(element.get("class", active), {}) | element.attrib, compiler)
    for child in body.findall("body"):
        yield from _body_joints(child, active, classes, compiler)


def _joint(attributes: dict[str, str], compiler: dict[str, str]) -> MjcfJoint:
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
        lower, upper = (float(x) * unit for x in attributes.get("range", "0 0").split())
    return MjcfJoint(attributes.get("name", ""), kind, lower, upper, ref)
