"""Pairs of links that must not touch, for robots of the table with its SRDF files."""

from __future__ import annotations

import pathlib
from typing import Any

from wbc import validation
from wbc.robot import Robot
from wbc.robot.pairs.collision_pairs import SelfPairs, find_self_pairs as find
from wbc.robot.pairs.search import Progress
from wbc.robot.sources.files import example_data_folder
from wbc.robots.catalogue import table


def find_self_pairs(
    robot: Robot,
    *,
    srdf: Any = "auto",
    samples: int = 10000,
    seed: int = 0,
    clearance: float = 0.0,
    progress: Progress | None = None,
) -> SelfPairs:
    """Chooses the pairs of links that must not touch each other, among all links with shapes; see
    :func:`wbc.robot.pairs.collision_pairs.find_self_pairs`, which states the rules, the errors and what it cannot do.

    Args:
        robot: with shapes.
        srdf: path of an SRDF file; ``auto``: the table's for a robot that was read from the table's file; None: none.
        samples: random configurations to look at; 0 looks at the neutral one only.
        seed: of those.
        clearance: links touch where their signed distance is at most this [m].
        progress: called with (steps done, steps in all).

    Example:
        >>> import wbc
        >>> robot = wbc.robots.load("ur5")
        >>> found = wbc.robots.find_self_pairs(robot, samples=200)
        >>> robot = robot.with_self_pairs(found.kept)
        >>> ("base_link", "wrist_2_link") in robot.self_pairs
        True
    """
    validation.instance("robot", robot, Robot, "a wbc Robot, see wbc.robots.load")
    path = srdf_of(robot) if isinstance(srdf, str) and srdf == "auto" else srdf
    return find(robot, srdf=path, samples=samples, seed=seed, clearance=clearance, progress=progress)


def srdf_of(robot: Robot) -> pathlib.Path | None:
    """The SRDF file that the table has for the file that a robot was read from."""
    folder = example_data_folder()
    for recipe in table():
        if recipe.srdf and robot.source == str(folder / recipe.file):
            return folder / recipe.srdf
    return None
