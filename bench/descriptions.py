"""Robot descriptions that every contender can load: the same kinematics without meshes, as one URDF file.

pink and placo load it with Pinocchio, mink with MuJoCo. Meshes are removed because MuJoCo reads other mesh
formats; spheres on links and obstacles are written as collision geometry, which all of them understand.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

#: (centre [m] in the link's frame, radius [m])
Sphere = tuple[tuple[float, float, float], float]


def write_urdf(
    source: Path,
    target: Path,
    *,
    locked: Iterable[str] = (),
    spheres: Mapping[str, Sphere] | None = None,
    obstacles: Sequence[Sphere] = (),
) -> None:
    """Write a copy of a URDF without meshes.

    Args:
        source: URDF to read.
        target: file to write.
        locked: joints that become fixed.
        spheres: link -> one collision sphere.
        obstacles: spheres fixed to the root link, written as links ``obstacle0``, ``obstacle1``, ...
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
    for name, sphere in (spheres or {}).items():
        _add_sphere(links[name], name, sphere)
    base = _root_link(root)
    for k, sphere in enumerate(obstacles):
        name = f"obstacle{k}"
        link = ET.SubElement(root, "link", name=name)
        _add_sphere(link, name, ((0.0, 0.0, 0.0), sphere[1]))
        joint = ET.SubElement(root, "joint", name=f"{name}_fixed", type="fixed")
        ET.SubElement(joint, "parent", link=base)
        ET.SubElement(joint, "child", link=name)
        ET.SubElement(joint, "origin", xyz=_numbers(sphere[0]), rpy="0 0 0")
    target.parent.mkdir(parents=True, exist_ok=True)
    ET.ElementTree(root).write(target, encoding="unicode", xml_declaration=True)


def mujoco_urdf(text: str) -> str:
    """The same URDF with MuJoCo's extension element: keep fixed links as bodies, accept any inertia."""
    root = ET.fromstring(text)
    extension = ET.SubElement(root, "mujoco")
    ET.SubElement(
        extension,
        "compiler",
        fusestatic="false",
        discardvisual="false",
        balanceinertia="true",
        boundmass="1e-9",
        boundinertia="1e-12",
        strippath="false",
    )
    return ET.tostring(root, encoding="unicode")


def _root_link(root: ET.Element) -> str:
    children = {c.get("link") for j in root.iter("joint") for c in j.findall("child")}
    return next(str(link.get("name")) for link in root.iter("link") if link.get("name") not in children)


def _add_sphere(link: ET.Element, name: str, sphere: Sphere) -> None:
    collision = ET.SubElement(link, "collision", name=f"{name}_sphere")
    ET.SubElement(collision, "origin", xyz=_numbers(sphere[0]), rpy="0 0 0")
    ET.SubElement(ET.SubElement(collision, "geometry"), "sphere", radius=repr(sphere[1]))


def _numbers(values: Sequence[float]) -> str:
    return " ".join(repr(float(v)) for v in values)
