"""Shapes that no posture brings far apart: they lie about a joint, or are larger than their links."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from wbc.geometry import segment_distances
from wbc.robot.pairs.descent import Descent
from wbc.robot.pairs.distances import Links
from wbc.robot.sampling import draw
from wbc.shapes import PlacedShape

if TYPE_CHECKING:
    from wbc.robot.robot import Robot

#: Configurations that all pairs are looked at in, and those that are not apart in one of these
FEW = 16
MANY = 1000

#: Climbs of the distance, from the farthest of those
STARTS = 3


def most_apart(
    robot: Robot, shapes: Mapping[str, tuple[str, PlacedShape]], pairs: Sequence[tuple[str, str]], enough: float
) -> dict[tuple[str, str], float]:
    """The largest signed distance found [m] of each pair of shapes that no configuration found brings ``enough`` apart.

    Looked for in the neutral configuration, in random ones within the position limits, and by climbs of the distance
    from the farthest of these. What is found depends on the arguments alone.

    Args:
        shapes: name -> link and shape.

    Cannot do: prove that no posture brings shapes farther apart. The climbs end in local maxima.
    """
    links, rng = Links(robot, shapes), np.random.default_rng(0)
    scene = links.place(np.vstack([np.zeros((1, robot.nv)), draw(robot, FEW, rng)]))
    sides = [[links.parts[pair[k]][0] for pair in pairs] for k in (0, 1)]
    if not pairs:
        return {}
    ends = [np.stack([scene.ends(part)[end] for part in parts]) for parts in sides for end in (0, 1)]
    radii = np.array([a.radius + b.radius for a, b in zip(*sides, strict=True)])
    left = np.flatnonzero(segment_distances(*ends).max(axis=1) - radii <= enough)
    if not len(left):
        return {}
    steps = np.vstack([np.zeros((1, robot.nv)), draw(robot, MANY, rng)])
    scene, climb, out = links.place(steps), Descent(robot, links, enough, away=True), {}
    for pair in (pairs[k] for k in left.tolist()):
        bounds = scene.bounds(*pair)
        order = np.argsort(-bounds, kind="stable")[:STARTS].tolist()
        best = float(bounds[order[0]])
        for n in order:
            if best > enough:
                break
            best = max(best, climb.run(pair[0], pair[1], steps[n]))
        if best <= enough:
            out[pair] = best
    return out
