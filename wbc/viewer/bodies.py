"""Meshes of what is drawn: links by their visual meshes or shapes, and obstacles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wbc.robot import Robot
from wbc.shapes import HalfSpace, PlacedShape, Shape
from wbc.track import render
from wbc.track.scene import DARK, WHITE, link_meshes, simplified
from wbc.validation import Array

Colour = tuple[int, int, int]

#: Corners of a mesh closer than this part of the robot's characteristic length are one
DETAIL = 0.012
#: Meshes of fewer triangles are drawn as they are
FEW = 1000
#: Half side of the square that stands for a half-space [m]
GROUND = 1.5
OBSTACLE: Colour = (222, 176, 96)


class Mesh(NamedTuple):
    """A mesh in the frame of what it is part of: corners [n x 3] m, triangles [m x 3], colour."""

    corners: Array
    triangles: Array
    colour: Colour


def robot_meshes(robot: Robot, detail: float = DETAIL) -> dict[str, Mesh]:
    """Frame -> mesh of the link there. Links that carry a named tip are dark, as hands are."""
    parts: dict[str, list[Array]] = {}
    for link, triangles in link_meshes(robot):
        parts.setdefault(link, []).append(triangles)
    model = robot.model
    hands = [f for name, f in robot.frames.items() if name == "tip" or name.endswith("hand")]
    tips = {int(model.frames[model.getFrameId(hand)].parentJoint) for hand in hands} - {0}
    out = {}
    for link, groups in parts.items():
        dark = int(model.frames[model.getFrameId(link)].parentJoint) in tips
        merged = np.concatenate(groups)
        if len(merged) > FEW:
            merged = simplified(merged, detail * robot.characteristic_length)
        if len(merged):
            out[link] = indexed(merged, _bytes(DARK if dark else WHITE))
    return out


def shape_mesh(parts: tuple[Shape, ...], colour: Colour = OBSTACLE) -> Mesh:
    """The surface of shapes, in their common frame."""
    flat = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=float) * GROUND
    origin, surfaces = pin.SE3.Identity(), []
    for part in parts:
        if isinstance(part, HalfSpace):
            surfaces.append(flat.reshape(2, 3, 3))
        else:
            surfaces.append(render.triangles(PlacedShape(part, origin)))
    return indexed(np.concatenate(surfaces), colour)


def indexed(triangles: Array, colour: Colour) -> Mesh:
    """Corners that are the same are one."""
    corners, places = np.unique(triangles.reshape(-1, 3).round(5), axis=0, return_inverse=True)
    return Mesh(corners.astype(np.float32), places.reshape(-1, 3).astype(np.uint32), colour)


def wxyz(rotation: Array) -> Array:
    """A rotation as viser takes it."""
    x, y, z, w = pin.Quaternion(rotation).coeffs()
    return np.array([w, x, y, z])


def _bytes(colour: tuple[float, float, float]) -> Colour:
    red, green, blue = (round(255 * part) for part in colour)
    return red, green, blue
