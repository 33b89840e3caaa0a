"""Models of branching machines, made joint by joint, and their description as URDF."""

from __future__ import annotations

import os
import pathlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from wbc import validation
from wbc.errors import RobotFileError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.robot.sources.description import ROOT
from wbc.shapes import Capsule, Convex, PlacedShape, Sphere

Z = (0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class TreeLink:
    """A link and the joint that carries it: revolute, sliding, or welded.

    Attributes:
        name: of the link; its frame is the joint's, turned by the coordinate.
        parent: the link below.
        placement: of the joint in the parent's frame.
        joint: its name; "" for a weld.
        lower, upper: limits [rad or m]. velocity, acceleration: largest [per s, s^2].
        axis: unit vector in the frame of ``placement``. sliding: along it, not about it.
        effort: largest [N m or N]. inertia: of the link, in its frame; None: it weighs nothing.
    """

    name: str
    parent: str
    placement: pin.SE3
    joint: str = ""
    lower: float = 0.0
    upper: float = 0.0
    velocity: float = 0.0
    acceleration: float = 0.0
    axis: tuple[float, float, float] = Z
    sliding: bool = False
    effort: float = np.inf
    inertia: pin.Inertia | None = None


def build_model(name: str, root: str, links: Iterable[TreeLink], floating: bool = True) -> pin.Model:
    """The model whose link ``root`` a free flyer carries, or the world; frames have the names of the links and joints.

    URDF's parser makes the same joints and frames out of :func:`urdf_text`.
    """
    model = pin.Model()
    model.name = name
    index = 0
    if floating:
        index = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), ROOT)
        model.addJointFrame(index)
    frames = {root: model.addFrame(pin.Frame(root, index, 0, pin.SE3.Identity(), pin.FrameType.BODY))}
    for link in links:
        below = model.frames[frames[link.parent]]
        local = below.placement * link.placement
        if not link.joint:
            frame = pin.Frame(link.name, below.parentJoint, frames[link.parent], local, pin.FrameType.BODY)
            frames[link.name] = model.addFrame(frame)
            if link.inertia is not None:
                model.appendBodyToJoint(below.parentJoint, link.inertia, local)
            continue
        numbers = [np.array([x]) for x in (link.effort, link.velocity, link.lower, link.upper)]
        index = model.addJoint(below.parentJoint, _joint(link), local, link.joint, *numbers)
        above = model.addJointFrame(index, frames[link.parent])
        frames[link.name] = model.addFrame(pin.Frame(link.name, index, above, pin.SE3.Identity(), pin.FrameType.BODY))
        if link.inertia is not None:
            model.appendBodyToJoint(index, link.inertia, pin.SE3.Identity())
    return model


def _joint(link: TreeLink) -> pin.JointModel:
    axis = np.array(link.axis)
    if link.sliding:
        return pin.JointModelPrismaticUnaligned(axis)
    return pin.JointModelRZ() if link.axis == Z else pin.JointModelRevoluteUnaligned(axis)


def write_urdf(path: str | os.PathLike[str], robot: Robot, root: str, links: Iterable[TreeLink]) -> pathlib.Path:
    """Writes :func:`urdf_text`.

    Raises:
        RobotFileError: the file cannot be written.
    """
    file = validation.file_path("path", path)
    with validation.writing("path", path, RobotFileError):
        file.write_text(urdf_text(robot, root, links), encoding="utf-8")
    return file


def urdf_text(robot: Robot, root: str, links: Iterable[TreeLink]) -> str:
    """The robot as URDF: joints with position and velocity limits, shapes as collision and visual bodies.

    A capsule becomes a cylinder with a ball at each end, a convex body is left out (URDF has it as a mesh only). URDF
    has no accelerations, and its effort limits must be there: 0 stands for none.
    """
    tree = ElementTree.Element("robot", name=robot.name)
    _add_link(tree, root, robot.shapes)
    for link in links:
        _add_inertia(_add_link(tree, link.name, robot.shapes), link.inertia)
        kind = ("prismatic" if link.sliding else "revolute") if link.joint else "fixed"
        joint = ElementTree.SubElement(tree, "joint", name=link.joint or f"{link.name}_weld", type=kind)
        ElementTree.SubElement(joint, "parent", link=link.parent)
        ElementTree.SubElement(joint, "child", link=link.name)
        _add_origin(joint, link.placement)
        if link.joint:
            ElementTree.SubElement(joint, "axis", xyz=" ".join(f"{x:g}" for x in link.axis))
            effort = link.effort if link.effort < np.inf else 0.0
            limits = {"lower": link.lower, "upper": link.upper, "velocity": link.velocity, "effort": effort}
            ElementTree.SubElement(joint, "limit", {k: repr(float(v)) for k, v in limits.items()})
    ElementTree.indent(tree)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(tree, encoding="unicode") + "\n"


def _add_link(
    tree: ElementTree.Element, name: str, shapes: Mapping[str, tuple[PlacedShape, ...]]
) -> ElementTree.Element:
    link = ElementTree.SubElement(tree, "link", name=name)
    for placed in shapes.get(name, ()):
        for kind in ("visual", "collision"):
            for placement, tag, numbers in _primitives(placed):
                body = ElementTree.SubElement(link, kind)
                _add_origin(body, placement)
                geometry = ElementTree.SubElement(body, "geometry")
                ElementTree.SubElement(geometry, tag, {k: repr(v) for k, v in numbers.items()})
    return link


def _add_inertia(link: ElementTree.Element, inertia: pin.Inertia | None) -> None:
    if inertia is None:
        return
    body = ElementTree.SubElement(link, "inertial")
    _add_origin(body, pin.SE3(np.eye(3), inertia.lever))
    ElementTree.SubElement(body, "mass", value=repr(float(inertia.mass)))
    of = {
        f"i{a}{b}": repr(float(inertia.inertia[i, j]))
        for i, a in enumerate("xyz")
        for j, b in enumerate("xyz")
        if i <= j
    }
    ElementTree.SubElement(body, "inertia", of)


def _primitives(placed: PlacedShape) -> list[tuple[pin.SE3, str, dict[str, float]]]:
    """(placement, URDF's name of the body, its numbers) of what a shape consists of."""
    shape, at = placed.shape, placed.placement
    if isinstance(shape, Sphere):
        return [(at, "sphere", {"radius": shape.radius})]
    if isinstance(shape, Capsule):
        balls = [(pin.SE3(np.eye(3), end), "sphere", {"radius": shape.radius}) for end in placed.ends()]
        return [(at, "cylinder", {"radius": shape.radius, "length": shape.length}), *balls]
    if isinstance(shape, Convex):
        return []
    raise RobotFileError("shape", type(shape).__name__, "neither sphere, capsule nor convex body")


def _add_origin(parent: ElementTree.Element, placement: pin.SE3) -> None:
    roll_pitch_yaw = pin.rpy.matrixToRpy(placement.rotation)
    numbers = {"xyz": placement.translation, "rpy": roll_pitch_yaw}
    ElementTree.SubElement(parent, "origin", {k: " ".join(repr(float(x)) for x in v) for k, v in numbers.items()})
