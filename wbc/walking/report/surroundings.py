"""What pictures show of a structure: surface, holds and obstacles as triangles, and how the picture is turned."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbc.clearance import TriangleMesh
from wbc.multibody import pin
from wbc.shapes import PlacedShape
from wbc.style import BLUE, ORANGE, PURPLE, TEAL
from wbc.track import render
from wbc.validation import Array
from wbc.walking.holds.structure import Structure
from wbc.walking.holds.surface import CylinderSurface, PlaneSurface
from wbc.walking.log.log import WalkLog

Colour = tuple[float, float, float]

SURFACE: Colour = (0.80, 0.835, 0.875)
HOLD: Colour = (0.56, 0.60, 0.66)
OBSTACLE: Colour = (0.70, 0.62, 0.52)
BODY: Colour = (0.93, 0.935, 0.945)
#: Of arms, as in plots
ARMS = (BLUE, ORANGE, TEAL, PURPLE)
#: A hold is drawn as a stud [m]: radius, height above the surface, and how many corners
STUD, TALL, CORNERS = 0.035, 0.02, 10
#: What is shown of the surface beyond the holds [m], how far under them it lies, and the side of a patch
EDGE, UNDER, PATCH = 0.18, 0.004, 0.12


def arm_colour(arm: int) -> str:
    """The colour of an arm in plots and pictures."""
    return ARMS[arm % len(ARMS)]


def mixed(colour: str, white: float) -> Colour:
    """A colour as red, green, blue, with a part of white in it."""
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    r, g, b = (white + (1.0 - white) * part for part in parts)
    return r, g, b


def upright(log: WalkLog) -> pin.SE3:
    """Structure -> picture: up is out of the structure where the walk is half over, x is where the body goes."""
    pose = pin.XYZQUATToSE3(log.pose_body_in_structure[len(log) // 2])
    up, way = -pose.rotation[:, 2], log.pose_body_in_structure[-1, :3] - log.pose_body_in_structure[0, :3]
    x = way - (way @ up) * up
    x = x if np.linalg.norm(x) > 0.05 else pose.rotation[:, 0]
    x = x / np.linalg.norm(x)
    return pin.SE3(np.stack([x, np.cross(up, x), up]), np.zeros(3))


def surface_triangles(structure: Structure, rows: NDArray[np.int64]) -> Array:
    """The surface under some holds, [m, 3, 3] [m]; none where the structure has no surface."""
    surface = structure.surface
    if surface is None or not len(rows):
        return np.zeros((0, 3, 3))
    local = (structure.positions[rows] - surface.pose.translation) @ surface.pose.rotation
    if isinstance(surface, PlaneSurface):
        low, high = local[:, :2].min(axis=0) - EDGE, local[:, :2].max(axis=0) + EDGE
        x, y = np.meshgrid(*(_stations(low[k], high[k], PATCH) for k in (0, 1)), indexing="ij")
        points = np.stack([x, y, np.full_like(x, -UNDER)], axis=-1)
    else:
        points = _bent(surface, local)
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    quads = np.concatenate([np.stack(corners, axis=2).reshape(-1, 3, 3) for corners in ([a, b, c], [a, c, d])])
    return np.asarray(quads @ surface.pose.rotation.T + surface.pose.translation)


def stud_triangles(structure: Structure, rows: NDArray[np.int64], size: float = 1.0) -> Array:
    """Studs where holds are, [m, 3, 3] [m]."""
    angle = 2.0 * np.pi * np.arange(CORNERS) / CORNERS
    ring = size * STUD * np.stack([np.cos(angle), np.sin(angle), np.zeros(CORNERS)], axis=1)
    top, after = ring + [0.0, 0.0, -size * TALL], np.roll(np.arange(CORNERS), -1)
    middle = np.broadcast_to([0.0, 0.0, -size * TALL], ring.shape)
    stud = np.concatenate(
        [
            np.stack([top, top[after], middle], axis=1),
            np.stack([ring, ring[after], top], axis=1),
            np.stack([ring[after], top[after], top], axis=1),
        ]
    )
    frames = structure.frames[rows]
    placed = np.einsum("hij,tcj->htci", frames[:, :3, :3], stud) + frames[:, None, None, :3, 3]
    return np.asarray(placed.reshape(-1, 3, 3))


def obstacle_triangles(structure: Structure, rows: NDArray[np.int64]) -> Array:
    """Obstacles, [m, 3, 3] [m]; where there is a surface, those that are near some holds."""
    places, parts = structure.positions[rows], []
    for obstacle in structure.obstacles:
        if structure.surface is None or (len(rows) and obstacle.distance(places).min() < EDGE + PATCH):
            shape, place = obstacle.shape, obstacle.placement
            if isinstance(shape, TriangleMesh):
                parts.append(np.asarray(shape.corners @ place.rotation.T + place.translation))
            else:
                parts.append(render.triangles(PlacedShape(shape, place)))
    return np.concatenate(parts) if parts else np.zeros((0, 3, 3))


def near_rows(structure: Structure, log: WalkLog, reach: float) -> NDArray[np.int64]:
    """Holds within ``reach`` [m] of the way of the body, measured along the surface."""
    places = log.pose_body_in_structure[:: max(1, len(log) // 60), :3]
    off = structure.positions[:, None] - places
    axes = structure.axes[:, None]
    across = off - (off * axes).sum(axis=2, keepdims=True) * axes
    return np.nonzero((np.linalg.norm(across, axis=2) < reach).any(axis=1))[0]


def _bent(surface: CylinderSurface, local: Array) -> Array:
    """Points on the surface under holds, in its frame: angles about its axis by heights along it, [n, m, 3]."""
    middle = np.arctan2(local[:, 1].mean(), local[:, 0].mean())
    angle = (np.arctan2(local[:, 1], local[:, 0]) - middle + np.pi) % (2.0 * np.pi) - np.pi
    radius = surface.radius - UNDER
    edge, patch = EDGE / radius, PATCH / radius
    at = middle + _stations(angle.min() - edge, angle.max() + edge, patch)
    z = _stations(local[:, 2].min() - EDGE, local[:, 2].max() + EDGE, PATCH)
    angles, heights = np.meshgrid(at, z, indexing="ij")
    return np.stack([radius * np.cos(angles), radius * np.sin(angles), heights], axis=-1)


def _stations(low: float, high: float, step: float) -> Array:
    return np.linspace(low, high, int(np.ceil((high - low) / step)) + 1)
