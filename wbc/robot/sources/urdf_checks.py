"""What a URDF file says that no robot can be: refused where it moves or weighs otherwise, else said in the log."""

from __future__ import annotations

import logging
import pathlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping

import numpy as np

from wbc.errors import RobotFileError
from wbc.validation import Array

log = logging.getLogger("wbc")

#: Joint types of one degree of freedom
SINGLE = ("revolute", "continuous", "prismatic")
_ENDS = ("parent", "child")
#: A shorter axis is what is left of one that was meant to be 0
_SHORTEST = 1e-6
#: The square of a longer one is no number
_LONGEST = 1e150
#: Principal moments that break a rule by less than so much of the largest are rounded numbers of a body
MOMENT_DIGITS = 1e-2
#: What is less than so much of the largest moment in the file moves nothing otherwise: 1e-6 kg m^2 of empty links
FELT = 1e-4
#: Elements that are read, of the robot, of a link and of a joint
_READ = {
    "robot": ("link", "joint"),
    "link": ("inertial", "visual", "collision"),
    "joint": ("parent", "child", "origin", "axis", "limit", "dynamics", "mimic", "safety_controller"),
}
#: Those that say nothing of how a robot moves and weighs
_NO_MECHANICS = ("material", "transmission", "gazebo", "sensor", "ros2_control", "calibration")
#: Elements of a joint -> (attributes that must be numbers where they are, those that must be there)
NUMBERS = {
    "limit": (("lower", "upper", "effort", "velocity"), ("effort", "velocity")),
    "safety_controller": (("soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity"), ("k_velocity",)),
    "calibration": (("rising", "falling"), ()),
    "mimic": (("multiplier", "offset"), ("joint",)),
    "dynamics": (("damping", "friction"), ()),
}
#: Attributes of elements of a joint whose misspelt ones are said
_ATTRIBUTES = {
    "origin": ("xyz", "rpy", "quat_xyzw"),
    "axis": ("xyz",),
    "limit": (*NUMBERS["limit"][0], "acceleration", "deceleration", "jerk"),
    "dynamics": NUMBERS["dynamics"][0],
    "mimic": sum(NUMBERS["mimic"], ()),
}
#: Share of letters from which a name was meant to be another one
_MISSPELT = 0.8


class Remarks:
    """What is said about a file: sentences by the key that they have in ``Robot.notes``."""

    def __init__(self, path: pathlib.Path) -> None:
        self._path = path
        self._sentences: dict[str, list[str]] = {}
        self._loud: dict[str, list[str]] = {}

    def add(self, key: str, sentence: str, *, loud: bool = True) -> None:
        """One more sentence; ``loud``: for the log, too."""
        self._sentences.setdefault(key, []).append(sentence)
        if loud:
            self._loud.setdefault(key, []).append(sentence)

    def said(self) -> dict[str, str]:
        """The notes; writes a line a key to the log."""
        for sentences in self._loud.values():
            log.warning("%s: %s", self._path, "; ".join(sentences))
        return {key: "; ".join(sentences) for key, sentences in self._sentences.items()}


def number(element: ElementTree.Element, key: str, default: float = 0.0) -> float:
    """A number of the file; the default where there is none, or none that the parser takes."""
    try:
        return float(element.get(key, default))
    except ValueError:
        return default


def axis_of(joint: ElementTree.Element) -> Array:
    """The axis of a joint as the file has it; x where there is no element, 0 where that has no numbers."""
    axis = joint.find("axis")
    text = "1 0 0" if axis is None else axis.get("xyz", "0 0 0")
    try:
        return np.array([float(x) for x in text.split()])
    except ValueError:
        return np.ones(3)  # for the parser to refuse


def has_direction(axis: Array) -> bool:
    """Whether an axis can be made a unit vector."""
    return bool(_SHORTEST < np.abs(axis).max(initial=0.0) < _LONGEST)


def check_tree(path: pathlib.Path, tree: ElementTree.Element) -> None:
    """Every link hangs on one joint and in the end on the root; joints that move have an axis.

    Raises:
        RobotFileError: they do not.
    """
    above: dict[str, tuple[str, str]] = {}  # child -> joint, parent
    for joint in tree.findall("joint"):
        name = str(joint.get("name"))
        parent, child = (str(end.get("link")) if (end := joint.find(key)) is not None else "" for key in _ENDS)
        if above.setdefault(child, (name, parent))[0] != name:
            reason = f"link {child!r} hangs on two joints, {above[child][0]!r} and {name!r}: a closed chain is no tree"
            raise RobotFileError("robot", str(path), reason)
        moves = joint.get("type") in (*SINGLE, "planar")
        if moves and not has_direction(axis := axis_of(joint)):
            reason = f"joint {name!r} has no direction: its axis is {shown(axis)}"
            raise RobotFileError("robot", str(path), reason)
    hangs: dict[str, bool] = {}  # whether a link's way up ends
    for link in above:
        way = [link]
        while way[-1] in above and way[-1] not in hangs and len(way) <= len(above):
            way.append(above[way[-1]][1])
        hangs |= dict.fromkeys(way, hangs.get(way[-1], way[-1] not in above))
    if circle := [link for link in above if not hangs[link]]:
        reason = f"these links hang on each other, not on the root: {', '.join(circle)}"
        raise RobotFileError("robot", str(path), reason)


def check_links(path: pathlib.Path, tree: ElementTree.Element, remarks: Remarks) -> None:
    """Masses are refused below 0, and inertias looked at.

    Raises:
        RobotFileError: a negative mass.
    """
    tensors = dict[str, Array]()
    for link in tree.findall("link"):
        name, mass, inertia = str(link.get("name")), link.find("inertial/mass"), link.find("inertial/inertia")
        if mass is None or inertia is None:
            continue
        if number(mass, "value") < 0.0:
            raise RobotFileError("robot", str(path), f"link {name!r} has a mass of {mass.get('value')} kg")
        xx, xy, xz, yy, yz, zz = (number(inertia, key) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
        tensors[name] = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    check_inertias(tensors, remarks)


def check_inertias(tensors: Mapping[str, Array], remarks: Remarks) -> None:
    """Of links by name, at their centres of mass: principal moments that no body has, a < 0 or c > a + b, are said."""
    moments = np.linalg.eigvalsh(np.array(list(tensors.values())).reshape(-1, 3, 3))
    largest = float(np.abs(moments).max(initial=0.0))
    wrong, slightly = list[str](), list[str]()
    for name, m in zip(tensors, moments, strict=True):
        excess = max(-m[0], m[2] - m[0] - m[1])
        if excess > MOMENT_DIGITS * np.abs(m).max():
            (wrong if excess > FELT * largest else slightly).append(f"link {name!r} {shown(m)}")
    for links, loud in ((wrong, True), (slightly, False)):
        if links:
            remarks.add("inertia", f"principal moments that no body has [kg m^2]: {'; '.join(links)}", loud=loud)


def check_elements(tree: ElementTree.Element, remarks: Remarks) -> None:
    """What is not read is said: elements and attributes without a meaning, those that stand twice, of which the first
    counts, and soft limits that are narrower than the limits.
    """
    for element in (tree, *tree.findall("link"), *tree.findall("joint")):
        read, tags = _READ["robot" if element is tree else element.tag], [str(part.tag) for part in element]
        whose = "" if element is tree else f" of {element.tag} {element.get('name')!r}"
        for tag in dict.fromkeys(tags):
            if tag in read:
                several = tags.count(tag) if element is not tree and tag not in ("visual", "collision") else 1
                if several > 1:
                    remarks.add("elements", f"<{tag}>{whose} is there {several} times, the first counts")
            elif tag not in _NO_MECHANICS and not tag.startswith("{"):
                near = meant(tag, read)
                remarks.add("elements", f"not read: <{tag}>{whose}{near}", loud=bool(near) or element.tag != "link")
        for part in element if element.tag == "joint" else ():
            for name in set(part.attrib) - set(_ATTRIBUTES.get(str(part.tag), part.attrib)):
                if near := meant(name, _ATTRIBUTES[str(part.tag)]):
                    remarks.add("elements", f"not read: {name} in <{part.tag}>{whose}{near}")
    narrower = list[str]()
    for joint in tree.findall("joint"):
        limit, soft = joint.find("limit"), joint.find("safety_controller")
        if limit is None or soft is None or soft.get("soft_lower_limit") == soft.get("soft_upper_limit"):
            continue
        low, high = number(soft, "soft_lower_limit"), number(soft, "soft_upper_limit")
        if joint.get("type") != "continuous" and (low > number(limit, "lower") or high < number(limit, "upper")):
            narrower.append(f"{joint.get('name')} {low:g} to {high:g}")
    if narrower:
        text = f"soft limits of position are not held, with_limits gives them: {', '.join(narrower)}"
        remarks.add("soft limits", text, loud=False)


def meant(name: str, known: Iterable[str]) -> str:
    """Which of the known names a misspelt one was meant to be, in words."""
    # Imported for a mistake only
    import difflib

    near = difflib.get_close_matches(name, known, 1, _MISSPELT)
    return f" (did you mean {near[0]}?)" if near else ""


def shown(values: Array) -> str:
    """Numbers of a file in a sentence."""
    return ", ".join(f"{x:.6g}" for x in values)
