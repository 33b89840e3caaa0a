"""Robot descriptions that every contender can load: the same kinematics without meshes, as one URDF file.

pink and placo load it with Pinocchio, mink with MuJoCo. Meshes are removed because MuJoCo reads other mesh
formats; spheres on links and obstacles are written as collision geometry, which all of them understand.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from bench.problems import Solid

#: Prefix of the links that carry what is fixed in the world
FIXED = "fixed"


def write_robot(robot: Any, target: Path, solids: Sequence[Solid] = ()) -> None:
    """As :func:`write_urdf`, of a robot of the table: what is no joint of it is fixed."""
    joints = ET.parse(robot.source).getroot().iter("joint")
    movable = {str(joint.get("name")) for joint in joints if joint.get("type") not in (None, "fixed")}
    write_urdf(Path(robot.source), target, locked=movable - set(robot.joint_names), solids=solids)


def write_urdf(source: Path, target: Path, *, locked: Iterable[str] = (), solids: Sequence[Solid] = ()) -> None:
    """Write a copy of a URDF without meshes.

    Args:
        source: URDF to read.
        target: file to write.
        locked: joints that become fixed.
        solids: shapes; the collision body of number k is named :func:`solid_name`, and a solid that is fixed in
            the world is on a link ``fixed<k>``.
    """
    root = ET.parse(source).getroot()
    for link in root.iter("link"):
        for tag in ("visual", "collision"):
            for child in link.findall(tag):
                link.remove(child)
    for unused in [c for c in root if c.tag not in ("link", "joint")]:
        root.remove(unused)
    fixed = set(locked)
    for joint in root.iter("joint"):
        if joint.get("name") in fixed:
            joint.set("type", "fixed")
            for tag in ("axis", "limit", "mimic", "dynamics", "safety_controller"):
                for child in joint.findall(tag):
                    joint.remove(child)
    links = {link.get("name"): link for link in root.iter("link")}
    base = _root_link(root)
    for k, solid in enumerate(solids):
        _add_solid(root, links, base, k, solid)
    target.parent.mkdir(parents=True, exist_ok=True)
    ET.ElementTree(root).write(target, encoding="unicode", xml_declaration=True)


def mujoco_urdf(text: str) -> str:
    """The same URDF with MuJoCo's extension element: keep fixed links as bodies, accept any inertia."""
    root = ET.fromstring(text)
    extension = ET.SubElement(root, "mujoco")
    kept = dict.fromkeys(("fusestatic", "discardvisual", "strippath"), "false")
    ET.SubElement(extension, "compiler", kept, balanceinertia="true", boundmass="1e-9", boundinertia="1e-12")
    return ET.tostring(root, encoding="unicode")


def _root_link(root: ET.Element) -> str:
    children = {c.get("link") for j in root.iter("joint") for c in j.findall("child")}
    return next(str(link.get("name")) for link in root.iter("link") if link.get("name") not in children)


def solid_name(number: int) -> str:
    """Name of the collision body of a solid; MuJoCo keeps it."""
    return f"solid{number}"


def solid_index(solids: Sequence[Solid], number: int) -> str:
    """Name that Pinocchio gives it: that of the link, and its number there."""
    link = solids[number].link
    before = sum(solid.link == link for solid in solids[:number])
    return f"{link}_{before}" if link else f"{FIXED}{number}_0"


def _add_solid(root: ET.Element, links: Mapping[str | None, ET.Element], base: str, k: int, solid: Solid) -> None:
    link = links[solid.link] if solid.link else ET.SubElement(root, "link", name=f"{FIXED}{k}")
    if not solid.link:
        joint = ET.SubElement(root, "joint", name=f"{FIXED}{k}_joint", type="fixed")
        ET.SubElement(joint, "parent", link=base)
        ET.SubElement(joint, "child", link=f"{FIXED}{k}")
    collision = ET.SubElement(link, "collision", name=solid_name(k))
    ET.SubElement(
        collision,
        "origin",
        xyz=_numbers(solid.place),
        rpy=_numbers(pin.rpy.matrixToRpy(pin.Quaternion(np.array(solid.turn)).matrix())),
    )
    geometry = ET.SubElement(collision, "geometry")
    if solid.kind == "sphere":
        ET.SubElement(geometry, "sphere", radius=repr(solid.size[0]))
    elif solid.kind == "box":
        ET.SubElement(geometry, "box", size=_numbers(solid.size))
    else:
        # Pinocchio takes a cylinder for a capsule where this element names it; in MuJoCo the contender does so
        ET.SubElement(geometry, "cylinder", radius=repr(solid.size[0]), length=repr(solid.size[1]))
        ET.SubElement(ET.SubElement(link, "collision_checking"), "capsule", name=solid_name(k))


def _numbers(values: Sequence[float]) -> str:
    return " ".join(repr(float(v)) for v in values)
