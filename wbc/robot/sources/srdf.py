"""What an SRDF file says: named configurations, and links whose collisions are of no interest."""

from __future__ import annotations

import pathlib
from dataclasses import dataclass

import numpy as np

from wbc.errors import RobotFileError
from wbc.robot.sources.files import read_xml
from wbc.validation import Array


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


def read_collisions(path: pathlib.Path) -> CollisionRules:
    """The collision rules of an SRDF file.

    Raises:
        RobotFileError: the file cannot be read, is no SRDF, or a rule lacks a link's name.
    """
    _, tree = read_xml(path)
    if tree.tag != "robot":
        raise RobotFileError("srdf", str(path), f"no SRDF: the root element is <{tree.tag}>")

    def named(tag: str, *keys: str) -> list[tuple[str, ...]]:
        out = []
        for element in tree.findall(tag):
            names = tuple(element.get(key, "") for key in keys)
            if not all(names):
                raise RobotFileError("srdf", str(path), f"<{tag}> needs {' and '.join(keys)}: {element.attrib}")
            out.append((*sorted(names), element.get("reason", "")))
        return out

    return CollisionRules(
        {(a, b): reason for a, b, reason in named("disable_collisions", "link1", "link2")},
        frozenset((a, b) for a, b, _ in named("enable_collisions", "link1", "link2")),
        frozenset(link for link, _ in named("disable_default_collisions", "link")),
    )


def read_states(path: pathlib.Path) -> dict[str, dict[str, Array]]:
    """State name -> joint name -> its numbers in q, in the file's spelling.

    A joint may have several numbers (a free flyer: position, quaternion x, y, z, w).

    Raises:
        RobotFileError: the file cannot be read, or a value is not a number.
    """
    _, tree = read_xml(path)
    states: dict[str, dict[str, Array]] = {}
    for state in tree.findall("group_state"):
        values = states.setdefault(str(state.get("name")), {})
        for joint in state.findall("joint"):
            text = joint.get("value", "")
            try:
                values[str(joint.get("name"))] = np.array([float(x) for x in text.split()])
            except ValueError as error:
                raise RobotFileError("srdf", str(path), f"value of joint {joint.get('name')}: {text!r}") from error
    return states
