"""Pairs of links that carry shapes, and those among them that are neighbours."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from wbc.symbolic.kinematics import joint_of

if TYPE_CHECKING:
    from wbc.robot.robot import Robot

#: Joints closer to each other than this [m] are one joint drawn as several (a universal or spherical joint).
SAME_PLACE = 1e-6


def shaped_links(robot: Robot) -> tuple[str, ...]:
    """Links that carry shapes, in the robot's order."""
    return tuple(link for link, shapes in robot.shapes.items() if shapes)


def link_pairs(robot: Robot) -> tuple[tuple[str, str], ...]:
    """Every two links that carry shapes, once."""
    return tuple(itertools.combinations(shaped_links(robot), 2))


def neighbours(robot: Robot) -> dict[tuple[str, str], str]:
    """Pair of :func:`link_pairs` -> ``same body`` (welded, or joints between them locked) or ``adjacent``.

    Adjacent are the bodies on the two sides of one joint. Joints whose origins coincide and between which no link
    carries a shape count as one: universal and spherical joints are often drawn so.
    """
    carriers = {link: joint_of(robot.tree, link) for link in shaped_links(robot)}
    above = {joint: _body_above(robot, joint, set(carriers.values())) for joint in set(carriers.values())}
    out = {}
    for first, second in link_pairs(robot):
        a, b = carriers[first], carriers[second]
        if a == b:
            out[first, second] = "same body"
        elif above[a] == b or above[b] == a:
            out[first, second] = "adjacent"
    return out


def _body_above(robot: Robot, joint: int, shaped: set[int]) -> int:
    """The body on the other side of a joint; -1 above the world, which no joint carries."""
    model = robot.tree
    if joint == 0:
        return -1
    parent = int(model.parents[joint])
    while parent > 0 and parent not in shaped and np.linalg.norm(model.jointPlacements[joint].translation) < SAME_PLACE:
        joint, parent = parent, int(model.parents[parent])
    return parent
