"""Meshes of what is drawn: links by their visual meshes or shapes, and obstacles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wbc.multibody import pin
from wbc.robot import Robot
from wbc.shapes import HalfSpace, PlacedShape, Shape
from wbc.symbolic.kinematics import joint_of
from wbc.track import render
from wbc.track.scene import link_meshes, simplified
from wbc.validation import Array

Colour = tuple[int, int, int]

#: Corners of a mesh closer than this part of the robot's characteristic length are one, where OF_LINK agrees
DETAIL = 0.007
#: They are also closer than this part of the link's least side: of a thin link on a long robot nothing would be left
OF_LINK = 0.045
#: Cosine of the angle between faces from which there is an edge
EDGE = 0.6
#: Meshes of fewer triangles are drawn as they are
FEW = 2500
#: Half side of the square that stands for a half-space [m]
GROUND = 1.5
OBSTACLE: Colour = (222, 166, 78)
LINK: Colour = (206, 211, 219)
HAND: Colour = (70, 78, 92)


class DrawnMesh(NamedTuple):
    """A mesh in the frame of what it is part of: corners [n x 3] m, triangles [m x 3], colour."""

    corners: Array
    triangles: NDArray[np.uint32]
    colour: Colour


#: Link -> what is drawn with it [m x 3 x 3] in its frame, and its colour
Dress = Mapping[str, tuple[Array, Colour]]


def robot_meshes(robot: Robot, detail: float = DETAIL, dress: Dress | None = None) -> dict[str, DrawnMesh]:
    """Frame -> mesh of the link there. Links that carry a named tip are dark, as hands are, unless ``dress`` says."""
    dress = {} if dress is None else dress
    parts: dict[str, list[Array]] = {link: [triangles] for link, (triangles, _) in dress.items()}
    for link, triangles in link_meshes(robot):
        parts.setdefault(link, []).append(triangles)
    model = robot.model
    hands = [f for name, f in robot.frames.items() if name == "tip" or name.endswith("hand")]
    tips = {joint_of(model, hand) for hand in hands} - {0}
    out = {}
    for link, groups in parts.items():
        dark = joint_of(model, link) in tips
        merged = np.concatenate(groups)
        if len(merged) > FEW:
            least = float(np.ptp(merged.reshape(-1, 3), axis=0).min())
            merged = simplified(merged, min(detail * robot.characteristic_length, OF_LINK * least))
        if len(merged):
            out[link] = indexed(merged, dress[link][1] if link in dress else HAND if dark else LINK)
    return out


def bounded(parts: tuple[Shape, ...]) -> tuple[Shape, ...]:
    """Those that end somewhere."""
    return tuple(part for part in parts if not isinstance(part, HalfSpace))


def shape_mesh(parts: tuple[Shape, ...]) -> DrawnMesh:
    """The surface of shapes, in their common frame."""
    flat = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=float) * GROUND
    origin, surfaces = pin.SE3.Identity(), []
    for part in parts:
        if isinstance(part, HalfSpace):
            surfaces.append(flat.reshape(2, 3, 3))
        else:
            surfaces.append(render.triangles(PlacedShape(part, origin)))
    return indexed(np.concatenate(surfaces), OBSTACLE)


def indexed(triangles: Array, colour: Colour) -> DrawnMesh:
    """Corners that are the same are one, but not across an edge.

    A page shades a corner by the mean normal of its faces, which is none where both sides of a thin wall meet.
    """
    corners, owner = np.unique(triangles.reshape(-1, 3).round(5), axis=0, return_inverse=True)
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    areas = np.linalg.norm(across, axis=1)
    normals = np.repeat(across / np.maximum(areas, 1e-12)[:, None], 3, axis=0)
    owner, first = owner.reshape(-1), np.zeros((len(corners), 3))
    places, parts, left = np.empty(len(owner), dtype=np.uint32), list[Array](), np.argsort(-np.repeat(areas, 3))
    while len(left):
        # Of the faces that are left at a corner, the largest and what is turned little against it
        used, largest = np.unique(owner[left], return_index=True)
        first[used] = normals[left[largest]]
        near = np.einsum("ij,ij->i", normals[left], first[owner[left]]) > EDGE
        near[largest] = True
        places[left[near]] = sum(map(len, parts)) + np.searchsorted(used, owner[left[near]])
        parts.append(corners[used])
        left = left[~near]
    return DrawnMesh(np.concatenate(parts).astype(np.float32), places.reshape(-1, 3), colour)
