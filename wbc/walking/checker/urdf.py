"""A URDF as the checker reads it: joints, limits and collision capsules, with nothing but an XML reader."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from wbc.errors import RobotFileError, UnknownNameError, UnsupportedJointError
from wbc.validation import Array

TURNING = ("revolute", "continuous")
#: A ball at a cylinder's end this near to it [m] makes it round
SAME = 1e-9


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """A joint: ``origin`` [4, 4] in the parent's frame, then a turn about ``axis``; ``turns`` is False for a weld."""

    name: str
    parent: str
    child: str
    origin: Array
    axis: Array
    turns: bool
    lower: float
    upper: float
    velocity: float


@dataclass(frozen=True, eq=False)
class CapsuleOfLink:
    """Ends [m] in the link's frame, and radius [m]."""

    link: str
    a: Array
    b: Array
    radius: float


@dataclass(frozen=True, eq=False)
class Urdf:
    """A tree of links.

    Attributes:
        root: the link that no joint carries.
        joints: parents before children.
        capsules: of all links.
    """

    root: str
    joints: tuple[UrdfJoint, ...]
    capsules: tuple[CapsuleOfLink, ...]

    @property
    def links(self) -> tuple[str, ...]:
        """All links, the root first."""
        return (self.root, *(joint.child for joint in self.joints))

    def joint(self, name: str) -> UrdfJoint:
        """The turning joint of a name.

        Raises:
            UnknownNameError: no such joint.
        """
        found = {joint.name: joint for joint in self.joints if joint.turns}
        if name not in found:
            raise UnknownNameError("joint", name, found)
        return found[name]

    def carried_with(self, link: str) -> tuple[str, ...]:
        """The links that move with ``link``, itself among them.

        Raises:
            UnknownNameError: no such link.
        """
        if link not in self.links:
            raise UnknownNameError("hand", link, self.links)
        body = {self.root: self.root}
        for joint in self.joints:
            body[joint.child] = joint.child if joint.turns else body[joint.parent]
        return tuple(name for name in self.links if body[name] == body[link])

    def neighbours(self) -> set[frozenset[str]]:
        """Pairs of links with capsules that are next to each other: links between them have none."""
        shaped, out = {capsule.link for capsule in self.capsules}, set()
        below = {self.root: self.root}
        for joint in self.joints:
            near = joint.parent if joint.parent in shaped else below[joint.parent]
            below[joint.child] = near
            if joint.child in shaped:
                out.add(frozenset((near, joint.child)))
        return out


def read_urdf(path: str | os.PathLike[str]) -> Urdf:
    """The tree in a file.

    Raises:
        RobotFileError: a file that cannot be read, is no tree, or has shapes other than spheres and cylinders.
        UnsupportedJointError: a joint that neither turns nor is fixed.
    """
    try:
        top = ElementTree.parse(path).getroot()
    except (OSError, ElementTree.ParseError) as error:
        raise RobotFileError("urdf", str(path), f"cannot be read: {error}") from error
    joints = [_joint(element) for element in top.findall("joint")]
    links = [_named(element, "link") for element in top.findall("link")]
    roots = [link for link in links if link not in {joint.child for joint in joints}]
    if len(roots) != 1:
        raise RobotFileError("urdf", roots, "expected one link that no joint carries")
    ordered: list[UrdfJoint] = []
    known = {roots[0]}
    while len(ordered) < len(joints):
        ready = [joint for joint in joints if joint.parent in known and joint.child not in known]
        if not ready:
            raise RobotFileError("urdf", str(path), "its joints are no tree")
        ordered += ready
        known |= {joint.child for joint in ready}
    capsules = [c for element in top.findall("link") for c in _capsules(_named(element, "link"), element)]
    return Urdf(roots[0], tuple(ordered), tuple(capsules))


def _named(element: ElementTree.Element, kind: str) -> str:
    name = element.get("name")
    if not name:
        raise RobotFileError("urdf", element.tag, f"a {kind} without a name")
    return name


def _joint(element: ElementTree.Element) -> UrdfJoint:
    name, kind = _named(element, "joint"), element.get("type", "")
    if kind not in (*TURNING, "fixed"):
        raise UnsupportedJointError(f"joint {name}", kind, "the checker knows", (*TURNING, "fixed"))
    ends = [found.get("link", "") for tag in ("parent", "child") if (found := element.find(tag)) is not None]
    if len(ends) != 2:
        raise RobotFileError(f"joint {name}", ends, "expected a parent and a child")
    axis_element, limit = element.find("axis"), element.find("limit")
    axis = np.array([1.0, 0.0, 0.0]) if axis_element is None else _numbers(name, axis_element.get("xyz", ""), 3)
    lower, upper, velocity = -inf, inf, inf
    if limit is not None:
        velocity = float(_numbers(name, limit.get("velocity", "inf"), 1)[0])
        if kind == "revolute":
            lower, upper = (float(_numbers(name, limit.get(side, "0"), 1)[0]) for side in ("lower", "upper"))
    length = float(np.linalg.norm(axis))
    if not length > 0.0:
        raise RobotFileError(f"joint {name}", axis.tolist(), "expected an axis of non-zero length")
    origin = _origin(name, element)
    return UrdfJoint(name, ends[0], ends[1], origin, axis / length, kind in TURNING, lower, upper, velocity)


def _origin(name: str, element: ElementTree.Element) -> Array:
    """[4, 4]: translation xyz, then turns by roll, pitch and yaw about the fixed axes x, y, z."""
    found, out = element.find("origin"), np.eye(4)
    if found is None:
        return out
    out[:3, 3] = _numbers(name, found.get("xyz", "0 0 0"), 3)
    (cr, cp, cy), (sr, sp, sy) = (f(_numbers(name, found.get("rpy", "0 0 0"), 3)) for f in (np.cos, np.sin))
    out[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return out


def _capsules(link: str, element: ElementTree.Element) -> list[CapsuleOfLink]:
    """Cylinders, rounded outwards at their ends, and the balls that are not at such an end."""
    cylinders, balls = [], []
    for body in element.findall("collision"):
        place, shape = _origin(link, body), body.find("geometry/*")
        tag = "none" if shape is None else shape.tag
        if shape is None or tag not in ("cylinder", "sphere"):
            raise RobotFileError(f"link {link}", tag, "the checker knows collision bodies", ("cylinder", "sphere"))
        radius = float(_numbers(link, shape.get("radius", ""), 1)[0])
        if tag == "sphere":
            balls.append(CapsuleOfLink(link, place[:3, 3], place[:3, 3], radius))
        else:
            half = float(_numbers(link, shape.get("length", ""), 1)[0]) / 2 * place[:3, 2]
            cylinders.append(CapsuleOfLink(link, place[:3, 3] - half, place[:3, 3] + half, radius))
    return cylinders + [ball for ball in balls if not _inside(ball, cylinders)]


def _inside(ball: CapsuleOfLink, cylinders: Sequence[CapsuleOfLink]) -> bool:
    ends = [(end, c.radius) for c in cylinders for end in (c.a, c.b)]
    return any(float(np.linalg.norm(ball.a - end)) <= SAME and ball.radius <= radius + SAME for end, radius in ends)


def _numbers(name: str, text: str, count: int) -> Array:
    try:
        out = np.array([float(x) for x in text.split()])
    except ValueError as error:
        raise RobotFileError(name, text, f"expected {count} numbers") from error
    if out.shape != (count,) or np.isnan(out).any():
        raise RobotFileError(name, text, f"expected {count} numbers")
    return out


@dataclass(frozen=True, eq=False)
class Placements:
    """Rotations [s, 3, 3] and positions [s, 3] of links in the root link's frame, by name."""

    rotation: dict[str, Array]
    position: dict[str, Array]

    def point(self, link: str, local: Array) -> Array:
        """A point of a link, [s, 3]."""
        out: Array = self.position[link] + self.rotation[link] @ local
        return out


def forward(urdf: Urdf, joints: Sequence[str], q: Array) -> Placements:
    """T_child = T_parent T_origin Rot(axis, q), link by link.

    Args:
        joints: names of the columns of ``q``, [s, m] rad. Joints that are not among them stay at 0.
    """
    count, column = len(q), {name: k for k, name in enumerate(joints)}
    rotation = {urdf.root: np.broadcast_to(np.eye(3), (count, 3, 3))}
    position = {urdf.root: np.zeros((count, 3))}
    for joint in urdf.joints:
        parent = rotation[joint.parent]
        position[joint.child] = position[joint.parent] + parent @ joint.origin[:3, 3]
        # Turned such that the axis is z: then a turn mixes two columns
        to_z = _frame_about(joint.axis)
        placed = _times(parent, joint.origin[:3, :3] @ to_z)
        if joint.turns and joint.name in column:
            angle = q[:, column[joint.name], None]
            c, s = np.cos(angle), np.sin(angle)
            turned = placed.copy()
            turned[:, :, 0] = c * placed[:, :, 0] + s * placed[:, :, 1]
            turned[:, :, 1] = c * placed[:, :, 1] - s * placed[:, :, 0]
            placed = turned
        rotation[joint.child] = _times(placed, to_z.T)
    return Placements(rotation, position)


def _times(many: Array, one: Array) -> Array:
    out: Array = np.reshape(np.reshape(many, (-1, 3)) @ one, (-1, 3, 3))
    return out


def _frame_about(axis: Array) -> Array:
    """A rotation whose z column is ``axis``."""
    if axis[2] == 1.0:
        return np.eye(3)
    side = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(side, axis)
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])
