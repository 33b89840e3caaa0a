"""The model in the elements of a URDF file, joint by joint: branches depth first, joints of a link by their names.

A file is refused where a number is none, where links and joints make no tree, and where a joint lacks what its type
needs: https://wiki.ros.org/urdf/XML, and urdfdom, whose verdicts and whose order of joints these are.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence

import numpy as np

from wbc.errors import RobotFileError
from wbc.multibody import own, single_joint
from wbc.quick_dataclasses import dataclass
from wbc.robot.sources.description import root_name
from wbc.robot.sources.urdf_checks import NUMBERS, SINGLE, Remarks
from wbc.validation import Array

#: A number as the format has it: no inf, no nan, nothing behind it
_NUMBER = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_VERSION = re.compile(r"\s*\+?(\d+)\.\s*\+?(\d+)")
#: Types of joints that move as they like: their axis and limits say nothing of their numbers
_FREE = {"floating": own.JointModelFreeFlyer, "planar": own.JointModelPlanar}
_TYPES = (*SINGLE, *_FREE, "fixed")
_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
#: What stands for no limit of the numbers of a turn, which are at most 1
PAST_UNIT = 1.01
#: Version of the format from which poses may have a quaternion
_QUATERNIONS_SINCE = 1


class NotUrdf(RobotFileError):
    """A text that is no URDF."""


def _refusal(reason: str) -> NotUrdf:
    return NotUrdf("urdf", "a text", reason)


@dataclass(frozen=True)
class UrdfJoint:
    """A joint element: its ends, its placement in the parent link, and its axis as the file has it."""

    element: ElementTree.Element
    name: str
    kind: str
    parent: str
    child: str
    pose: own.SE3
    axis: Array


class UrdfElements:
    """Links and joints of a file, each checked for itself, and whether they make a tree.

    Attributes:
        root: the link that hangs on no joint.

    Raises:
        NotUrdf: they do not, or one of them is none.
    """

    def __init__(self, tree: ElementTree.Element, remarks: Remarks) -> None:
        self._remarks = remarks
        self.name = tree.get("name", "")
        if tree.get("name") is None:
            raise _refusal("the robot has no name")
        self._quaternions = self._minor(tree.get("version")) >= _QUATERNIONS_SINCE
        self.inertias: dict[str, own.Inertia] = {}
        for link in tree.findall("link"):
            name = link.get("name", "")
            if name in self.inertias:
                raise _refusal(f"two links have the name {name!r}")
            self.inertias[name] = self._inertia(name, link.find("inertial"))
        if not self.inertias:
            raise _refusal("there are no links")
        joints: dict[str, UrdfJoint] = {}
        for element in tree.findall("joint"):
            joint = self._joint(element)
            if joint.name in joints:
                raise _refusal(f"two joints have the name {joint.name!r}")
            joints[joint.name] = joint
        self.below: dict[str, list[UrdfJoint]] = {link: [] for link in self.inertias}
        for _, joint in sorted(joints.items()):
            for end, name in (("parent", joint.parent), ("child", joint.child)):
                if name not in self.inertias:
                    raise _refusal(f"joint {joint.name!r} has a {end} link {name!r} that the file does not have")
            self.below[joint.parent].append(joint)
        carried = {joint.child for joint in joints.values()}
        roots = [name for name in self.inertias if name not in carried]
        if len(roots) != 1:
            raise _refusal(f"links without a joint that carries them: {', '.join(map(repr, roots))}; one is the root")
        self.root = roots[0]

    def _minor(self, version: str | None) -> int:
        if version is None:
            return 0
        parts = _VERSION.fullmatch(version)
        if parts is None or int(parts[1]) != 1 or int(parts[2]) > 2:
            raise _refusal(f"version {version!r} is none of 1.0, 1.1 and 1.2")
        return int(parts[2])

    def _number(self, text: str, what: str) -> float:
        value = float(text) if _NUMBER.fullmatch(text) else math.nan
        if not math.isfinite(value):
            raise _refusal(f"{what} is {text!r}, expected a number")
        return value

    def _numbers(self, text: str, count: int, what: str) -> Array:
        """Of a text with blanks between them."""
        values = [self._number(piece, what) for piece in text.split(" ") if piece]
        if len(values) != count:
            raise _refusal(f"{what} is {text!r}, expected {count} numbers")
        return np.array(values)

    def _pose(self, origin: ElementTree.Element | None, what: str) -> own.SE3:
        if origin is None:
            return own.SE3.Identity()
        place = self._numbers(origin.get("xyz", "0 0 0"), 3, f"xyz of {what}")
        rpy, quaternion = origin.get("rpy"), origin.get("quat_xyzw")
        if quaternion is not None and not self._quaternions:
            self._remarks.add("version", f"quat_xyzw of {what} is not read: the file's version is below 1.1")
        elif quaternion is not None:
            if rpy is not None:
                raise _refusal(f"{what} has both rpy and quat_xyzw")
            turn = self._numbers(quaternion, 4, f"quat_xyzw of {what}")
            length = float(np.linalg.norm(turn))
            return own.SE3(own.Quaternion(turn / length).matrix() if length > 0.0 else np.eye(3), place)
        return own.SE3(_turned(self._numbers(rpy, 3, f"rpy of {what}")) if rpy is not None else np.eye(3), place)

    def _inertia(self, link: str, element: ElementTree.Element | None) -> own.Inertia:
        """Of a link at its own frame; of none where the element is incomplete, which is said."""
        if element is None:
            return own.Inertia.Zero()
        try:
            pose = self._pose(element.find("origin"), f"the inertial of link {link!r}")
            mass, moments = (element.find(key) for key in ("mass", "inertia"))
            if mass is None or moments is None:
                raise _refusal(f"the inertial of link {link!r} has no <{'mass' if mass is None else 'inertia'}>")
            kilograms = self._number(mass.get("value", ""), f"the mass of link {link!r}")
            xx, xy, xz, yy, yz, zz = (self._number(moments.get(k, ""), f"{k} of link {link!r}") for k in _MOMENTS)
        except NotUrdf as error:
            self._remarks.add("inertia", f"link {link!r} weighs nothing: {error.reason}")
            return own.Inertia.Zero()
        moments_there = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        # Pinocchio's constructor refuses moments that no body has, which files do have
        out = own.Inertia.Zero()
        out.mass, out.lever, out.inertia = kilograms, pose.translation, pose.rotation @ moments_there @ pose.rotation.T
        return out

    def _joint(self, element: ElementTree.Element) -> UrdfJoint:
        name, kind = element.get("name"), element.get("type")
        if name is None:
            raise _refusal("a joint has no name")
        what = f"joint {name!r}"
        if kind not in _TYPES:
            raise _refusal(f"{what} is of type {kind!r}, which is none of {', '.join(_TYPES)}")
        ends = [end.get("link", "") if (end := element.find(key)) is not None else "" for key in ("parent", "child")]
        if not all(ends):
            raise _refusal(f"{what} has no {'child' if ends[0] else 'parent'} link")
        pose, axis, found = self._pose(element.find("origin"), what), np.array([1.0, 0.0, 0.0]), element.find("axis")
        if found is not None and kind not in ("floating", "fixed"):
            axis = self._numbers(found.get("xyz", "0 0 0"), 3, f"the axis of {what}")
        for tag, (numbers, needed) in NUMBERS.items():
            self._check(element.find(tag), numbers, needed, f"<{tag}> of {what}")
        if kind in ("revolute", "prismatic") and element.find("limit") is None:
            raise _refusal(f"{what} is {kind} and has no <limit>")
        return UrdfJoint(element, name, kind, ends[0], ends[1], pose, axis)

    def _check(
        self, element: ElementTree.Element | None, numbers: Sequence[str], needed: Sequence[str], what: str
    ) -> None:
        if element is None:
            return
        for key in needed:
            if element.get(key) is None:
                raise _refusal(f"{what} has no {key}")
        for key in numbers:
            if (text := element.get(key)) is not None:
                self._number(text, f"{key} in {what}")
        if element.tag == "dynamics" and not any(element.get(key) is not None for key in numbers):
            raise _refusal(f"{what} has neither {' nor '.join(numbers)}")


def _turned(rpy: Array) -> Array:
    """The rotation matrix of roll, pitch, yaw, by way of the quaternion."""
    (a, b, c), (p, q, r) = ([f(0.5 * angle) for angle in rpy.tolist()] for f in (math.sin, math.cos))
    turn = np.array([a * q * r - p * b * c, p * b * r + a * q * c, p * q * c - a * b * r, p * q * r + a * b * c])
    x, y, z, w = turn.tolist()
    return np.asarray(own.Quaternion(turn / math.sqrt(x * x + y * y + z * z + w * w)).matrix())


def build_model(elements: UrdfElements, base: own.JointModel | None) -> own.Model:
    """The model, whose root link the joint of a base carries, or the world; limits are the file's.

    Frames: each joint's, moving or fixed, and each link's, with the link's inertia.
    """
    out, limits = own.Model(), _UrdfLimits()
    out.name = elements.name
    joint, frame = 0, 0
    if base is not None:
        moving = [joint.name for joints in elements.below.values() for joint in joints if joint.kind != "fixed"]
        joint = out.addJoint(0, base, own.SE3.Identity(), root_name(moving))
        frame = out.addJointFrame(joint, 0)
        limits.add(None, out, joint)
    for made, parent, at in _depth_first(elements):
        if made is not None:
            joint, frame = at[parent]
            above = out.frames[frame]
            if made.kind == "fixed":
                placed = above.placement * made.pose
                added = own.Frame(made.name, joint, frame, placed, own.FrameType.FIXED_JOINT)
            else:
                joint = out.addJoint(joint, _joint_model(made), above.placement * made.pose, made.name)
                added = own.Frame(made.name, joint, frame, own.SE3.Identity(), own.FrameType.JOINT)
                limits.add(made, out, joint)
            frame = out.addFrame(added)
        link, placement = (elements.root if made is None else made.child), out.frames[frame].placement
        body = own.Frame(link, joint, frame, placement, own.FrameType.BODY, elements.inertias[link])
        at[link] = joint, out.addFrame(body)
    limits.write(out)
    return out


def _depth_first(
    elements: UrdfElements,
) -> Iterator[tuple[UrdfJoint | None, str, dict[str, tuple[int, int]]]]:
    """(joint, its parent link, link -> (joint, frame) to be filled), first (None, "", ...) of the root."""
    at: dict[str, tuple[int, int]] = {}
    yield None, "", at
    waiting = elements.below[elements.root][::-1]
    while waiting:
        joint = waiting.pop()
        yield joint, joint.parent, at
        waiting += elements.below[joint.child][::-1]


def _joint_model(joint: UrdfJoint) -> own.JointModel:
    if joint.kind in _FREE:
        return _FREE[joint.kind]()
    axis = joint.axis / np.linalg.norm(joint.axis)
    return single_joint(axis, slides=joint.kind == "prismatic", endless=joint.kind == "continuous")


class _UrdfLimits:
    """Limits, damping and friction of joints in the order in which these are added."""

    def __init__(self) -> None:
        self._values: dict[str, list[float]] = {}

    def add(self, joint: UrdfJoint | None, model: own.Model, index: int) -> None:
        """Those of a joint element, None for a base."""
        nq, nv = int(model.nqs[index]), int(model.nvs[index])
        found = joint.element.find if joint is not None and joint.kind in SINGLE else lambda tag: None
        limit, dynamics = found("limit"), found("dynamics")
        effort, velocity = (_value(limit, key, math.inf) for key in ("effort", "velocity"))
        lower, upper = (_value(limit, key, 0.0) for key in ("lower", "upper"))
        friction = _value(dynamics, "friction", 0.0)
        ends = [[lower], [upper]]
        if nq != nv:
            turns = {7: 4, 4: 2, 2: 2}[nq]
            ends = [[sign * math.inf] * (nq - turns) + [sign * PAST_UNIT] * turns for sign in (-1.0, 1.0)]
        for key, values in (
            ("lowerPositionLimit", ends[0]),
            ("upperPositionLimit", ends[1]),
            ("lowerVelocityLimit", [-velocity] * nv),
            ("upperVelocityLimit", [velocity] * nv),
            ("lowerEffortLimit", [-effort] * nv),
            ("upperEffortLimit", [effort] * nv),
            ("lowerDryFrictionLimit", [-friction] * nv),
            ("upperDryFrictionLimit", [friction] * nv),
            ("damping", [_value(dynamics, "damping", 0.0)] * nv),
        ):
            self._values.setdefault(key, []).extend(values)

    def write(self, model: own.Model) -> None:
        """Into the model."""
        for key, values in self._values.items():
            setattr(model, key, np.array(values))


def _value(element: ElementTree.Element | None, key: str, default: float) -> float:
    text = None if element is None else element.get(key)
    return default if text is None else float(text)
