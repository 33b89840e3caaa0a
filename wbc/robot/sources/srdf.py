"""What an SRDF file says: named configurations, rotors, and links whose collisions are of no interest."""

from __future__ import annotations

import math
import pathlib
import xml.etree.ElementTree as ElementTree
from collections import Counter
from dataclasses import dataclass

import numpy as np

from wbc.errors import RobotFileError
from wbc.robot.sources.files import read_xml
from wbc.validation import Array

#: Elements that are read
READ = (
    "disable_collisions",
    "disable_default_collisions",
    "enable_collisions",
    "group_state",
    "passive_joint",
    "rotor_params",
)


@dataclass(frozen=True)
class CollisionRules:
    """Which pairs of links an SRDF file disables.

    Attributes:
        disabled: pair of names, sorted -> the file's reason, or "" where it gives none.
        enabled: pairs of names, sorted.
        quiet: links of which every pair is disabled that is not enabled by itself.
    """

    disabled: dict[tuple[str, str], str]
    enabled: frozenset[tuple[str, str]]
    quiet: frozenset[str]

    def of(self, first: str, second: str) -> tuple[bool, str] | None:
        """(whether the pair matters, why) for a pair that the file speaks of.

        As in MoveIt, <disable_collisions> has the last word, then <enable_collisions>, then
        <disable_default_collisions>.
        """
        pair = (min(first, second), max(first, second))
        if pair in self.disabled:
            return False, self.disabled[pair]
        if pair in self.enabled:
            return True, "enabled"
        if first in self.quiet or second in self.quiet:
            return False, "default of a link"
        return None

    @property
    def links(self) -> frozenset[str]:
        """Every link that the file names in its rules."""
        return frozenset(link for pair in (*self.disabled, *self.enabled) for link in pair) | self.quiet


@dataclass(frozen=True, eq=False)
class Srdf:
    """An SRDF file."""

    path: pathlib.Path
    root: ElementTree.Element

    def collisions(self) -> CollisionRules:
        """Which pairs of links are disabled.

        Raises:
            RobotFileError: a rule lacks a link's name.
        """

        def named(tag: str, *keys: str) -> list[tuple[str, ...]]:
            out = []
            for element in self.root.findall(tag):
                names = tuple(element.get(key, "") for key in keys)
                if not all(names):
                    raise self._error(f"<{tag}> needs {' and '.join(keys)}: {element.attrib}")
                out.append((*sorted(names), element.get("reason", "")))
            return out

        return CollisionRules(
            {(a, b): reason for a, b, reason in named("disable_collisions", "link1", "link2")},
            frozenset((a, b) for a, b, _ in named("enable_collisions", "link1", "link2")),
            frozenset(link for link, _ in named("disable_default_collisions", "link")),
        )

    def states(self) -> dict[str, dict[str, Array]]:
        """State name -> joint name -> its numbers in q, in the file's spelling.

        A joint may have several numbers (a free flyer: position, quaternion x, y, z, w).

        Raises:
            RobotFileError: a value is not a number.
        """
        states: dict[str, dict[str, Array]] = {}
        for state in self.root.findall("group_state"):
            values = states.setdefault(str(state.get("name")), {})
            for joint in state.findall("joint"):
                text = joint.get("value", "")
                try:
                    values[str(joint.get("name"))] = np.array([float(x) for x in text.split()])
                except ValueError as error:
                    raise self._error(f"value of joint {joint.get('name')}: {text!r}") from error
        return states

    def rotors(self) -> dict[str, tuple[float, float]]:
        """Joint name -> (inertia of its rotor [kg m^2; kg], which SRDF calls ``mass``; gear ratio).

        Raises:
            RobotFileError: a joint twice; an inertia or ratio that is missing or not finite, an inertia below 0.
        """
        rotors: dict[str, tuple[float, float]] = {}
        for joint in self.root.iterfind("rotor_params/joint"):
            name = str(joint.get("name"))
            try:
                inertia, ratio = (float(joint.get(key, "nan")) for key in ("mass", "gear_ratio"))
            except ValueError:
                inertia = ratio = math.nan
            if name in rotors or not (math.isfinite(inertia) and math.isfinite(ratio) and inertia >= 0.0):
                raise self._error(f"rotor of joint {name}: {joint.attrib}")
            rotors[name] = inertia, ratio
        return rotors

    def passive(self) -> list[str]:
        """Joints without a motor."""
        return [str(joint.get("name")) for joint in self.root.iterfind("passive_joint")]

    def ignored(self) -> str:
        """Elements that are not read, with their number; "" for none."""
        count = Counter(element.tag for element in self.root if element.tag not in READ)
        return ", ".join(f"{number} {tag}" for tag, number in sorted(count.items()))

    def _error(self, reason: str) -> RobotFileError:
        return RobotFileError("srdf", str(self.path), reason)


def read_srdf(path: pathlib.Path) -> Srdf:
    """Reads an SRDF file.

    Raises:
        RobotFileError: the file cannot be read, or is no SRDF.
    """
    _, root = read_xml(path)
    if root.tag != "robot":
        raise RobotFileError("srdf", str(path), f"no SRDF: the root element is <{root.tag}>")
    if root.find("link") is not None or root.find("joint") is not None:
        raise RobotFileError("srdf", str(path), "no SRDF: it has links or joints of its own, as a URDF file")
    return Srdf(path, root)
