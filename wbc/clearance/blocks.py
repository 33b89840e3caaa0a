"""Pairs of a scene by the frames that carry them, so that most are seen to be apart together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.clearance.scene import Pair, SweptBody, SweptScene, Unbounded
from wbc.clearance.tree import Tree
from wbc.multibody import pin
from wbc.shapes import Sphere
from wbc.validation import Array

#: Fewer pairs are not in blocks, which would take as long to make as they spare in some queries
MANY = 200
#: A ball is so much larger than what it holds, against rounding [m]
WIDER = 1e-9


def in_blocks(tree: Tree, bodies: Sequence[SweptBody], pairs: Sequence[Pair]) -> tuple[SweptScene, Array]:
    """A scene whose pairs are in blocks, and behind them one a block, of balls about all that a frame carries and of
    bodies in the world; the number of the pair behind the last one of each block [blocks].
    """
    if len(pairs) < MANY:
        return SweptScene(tree, bodies, pairs), np.zeros(0, dtype=np.int32)
    scene, holders = SweptScene(tree, bodies, ()), {body.name: body.name for body in bodies}
    held = list(scene.bodies)
    ending = np.array([not isinstance(body.shape, Unbounded) for body in held], dtype=bool)
    for frame in sorted(set(scene.frame.tolist()) - {-1}):
        carried = np.flatnonzero((scene.frame == frame) & ending).tolist()
        if len(carried) > 1:
            held.append(_ball(scene, carried))
            holders |= {scene.bodies[k].name: held[-1].name for k in carried}
    blocks = dict[tuple[str, str], list[Pair]]()
    for pair in pairs:
        one, other = holders[pair.first], holders[pair.second]
        blocks.setdefault((one, other) if one < other else (other, one), []).append(pair)
    ordered = [pair for block in blocks.values() for pair in block]
    ordered += [Pair(*ends, max(pair.required for pair in block)) for ends, block in blocks.items()]
    return SweptScene(tree, held, ordered), np.cumsum([len(block) for block in blocks.values()], dtype=np.int32)


def _ball(scene: SweptScene, carried: list[int]) -> SweptBody:
    """A ball about some bodies of a frame."""
    ends, radii = scene.line[carried, :6].reshape(-1, 2, 3), scene.line[carried, 6]
    middles, halves = ends.mean(axis=1), 0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    centre = 0.5 * (middles.min(axis=0) + middles.max(axis=0))
    radius = float((np.linalg.norm(middles - centre, axis=1) + halves + radii).max()) + WIDER
    first = scene.bodies[carried[0]]
    _, on_frame = scene.tree.link("link", first.link)
    return SweptBody(
        f"ball about {first.name}", Sphere(radius), first.link, on_frame.inverse() * pin.SE3(np.eye(3), centre)
    )
