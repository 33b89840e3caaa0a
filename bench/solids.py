"""The solids of a problem as this package declares them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

import wbc
from bench.problems import Array, Problem, Solid
from wbc.shapes import Box, Capsule, Convex, PlacedShape, Shape, Sphere
from wbc.tasks import Constraint


def link_shapes(solids: Sequence[Solid]) -> dict[str, list[PlacedShape]]:
    """Those on links."""
    out: dict[str, list[PlacedShape]] = {}
    for solid in solids:
        if solid.link:
            out.setdefault(solid.link, []).append(PlacedShape(shape(solid), placement(solid)))
    return out


def keep_clear(problem: Problem) -> dict[str, Constraint]:
    """Constraint of each name: one obstacle a sphere, one for all boxes that are measured, one for the robot's own."""
    solids, out = problem.solids, {}
    own = [(a, b) for a, b in problem.pairs if solids[a].link and solids[b].link]
    fixed = sorted({k for pair in problem.pairs for k in pair if not solids[k].link})
    if own:
        links = list(dict.fromkeys((solids[a].link, solids[b].link) for a, b in own))
        method = "sensed" if problem.sensed else "symbolic"
        out["self"] = wbc.tasks.SelfCollision(
            links, margin=problem.margin, method=method, closest=max(1, problem.sensed)
        )
    if fixed and problem.sensed:
        parts = [Convex(corners(solids[k])) for k in fixed]
        out["boxes"] = wbc.tasks.Obstacle(
            parts, pose=pin.SE3.Identity(), margin=problem.margin, closest=min(problem.sensed, len(problem.pairs))
        )
    for k in [] if problem.sensed else fixed:
        out[f"solid{k}"] = wbc.tasks.Obstacle(shape(solids[k]), pose=placement(solids[k]), margin=problem.margin)
    return out


def shape(solid: Solid) -> Shape:
    """Without its place."""
    if solid.kind == "sphere":
        return Sphere(solid.size[0])
    if solid.kind == "capsule":
        return Capsule(solid.size[0], solid.size[1])
    return Box((solid.size[0], solid.size[1], solid.size[2]))


def placement(solid: Solid) -> pin.SE3:
    """In its link, or in the world."""
    return pin.XYZQUATToSE3(np.array([*solid.place, *solid.turn]))


def corners(solid: Solid) -> Array:
    """The corners of a box in its link's frame, 8 x 3 [m]."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    place = placement(solid)
    return np.asarray(0.5 * signs * np.array(solid.size) @ place.rotation.T + place.translation)
