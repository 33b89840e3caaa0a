"""A scene as triangles, near the way of a climber, and the colours of its limbs."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc.clearance import CylinderInside, EndlessCylinder, TriangleMesh
from wbc.clearance.scene import patch_of
from wbc.climb.climber import Climber
from wbc.climb.scene import ClimbScene
from wbc.multibody import pin
from wbc.shapes import HalfSpace, PlacedShape
from wbc.style import CYCLE
from wbc.symbolic.kinematics import joint_of
from wbc.track import render
from wbc.track.scene import link_meshes
from wbc.validation import Array

#: Red, green and blue, 0 to 1
Colour = tuple[float, float, float]
#: Colour of bodies without end
SURFACE: Colour = (0.80, 0.835, 0.875)
#: Colour of other bodies
BODY: Colour = (0.76, 0.72, 0.65)
#: Colour of footholds that no limb holds
FREE: Colour = (0.56, 0.60, 0.66)
#: Share of white in the colour of a limb
PALE_LIMB = 0.6
#: The same of the link at its tip
PALE_TIP = 0.05
#: Footholds within this of the way of the body are shown, as a share of the shortest limb's reach
SHOWN = 0.8
#: Radius of a foothold as it is drawn, as a share of that reach
STUD = 0.0175
#: Height of one above its surface, as a share of its radius
TALL = 0.6
#: Corners of a foothold as it is drawn
CORNERS = 10
#: How far bodies without end are drawn beyond footholds, as a share of that reach
EDGE = 0.09
#: How far such a body lies under its footholds, as a share of that reach: what lies in one plane flickers
UNDER = 0.002
#: Facets round such a cylinder, for a whole turn
FACETS = 96


def limb_colour(limb: int) -> str:
    """Colour of a limb in plots and pictures."""
    return CYCLE[limb % len(CYCLE)]


def mixed(colour: str, white: float) -> Colour:
    """A colour such as ``#1f5fa8`` as red, green, blue, with a share of white in it."""
    red, green, blue = (white + (1.0 - white) * int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return red, green, blue


def link_colours(climber: Climber) -> dict[str, Colour]:
    """Link that is drawn -> colour, of those that limbs move: each limb its own, darker at its tip."""
    robot, out = climber.robot, dict[str, Colour]()
    carrier = {link: joint_of(robot.model, link) for link, _ in link_meshes(robot)}
    for row, chain in enumerate(climber.chains):
        moved = {link: joint for link, joint in carrier.items() if set(robot.model.supports[joint]) & set(chain)}
        last = max(moved.values(), key=lambda joint: len(robot.model.supports[joint]), default=0)
        for link, joint in moved.items():
            out[link] = mixed(limb_colour(row), PALE_TIP if joint == last else PALE_LIMB)
    return out


def near_footholds(scene: ClimbScene, way: Array, reach: float) -> NDArray[np.intp]:
    """Rows of footholds within a distance [m] of the way of a body ``(n, 3)``, measured along their surfaces."""
    off = scene.positions[:, None] - way[:: max(1, len(way) // 60)]
    above = np.einsum("hni,hi->hn", off, scene.normals)
    across = np.sqrt(np.maximum(np.einsum("hni,hni->hn", off, off) - above**2, 0.0))
    return np.flatnonzero(((across < reach) & (np.abs(above) < 2.0 * reach)).any(axis=1))


def surface_triangles(scene: ClimbScene, rows: NDArray[np.intp], reach: float) -> Array:
    """Bodies without end under some footholds ``(m, 3, 3)`` [m]; the inside of a cylinder is not drawn."""
    parts = [np.zeros((0, 3, 3))]
    for name, body in scene.bodies.items():
        mine = [row for row in rows.tolist() if scene.footholds[row].on == name]
        if len(mine) and isinstance(body.shape, (HalfSpace, EndlessCylinder)):
            parts.append(_patch(body.shape, body.placement, scene.positions[mine], reach))
    return np.concatenate(parts)


def body_triangles(scene: ClimbScene, way: Array, reach: float, rows: Iterable[int] = ()) -> Array:
    """Bodies that end somewhere, those within a distance [m] of the way of the body and under the footholds of these
    rows ``(m, 3, 3)`` [m].
    """
    parts, line = [np.zeros((0, 3, 3))], way[:: max(1, len(way) // 60)]
    under = {scene.footholds[row].on for row in rows}
    for name, body in scene.bodies.items():
        shape, pose = body.shape, body.placement
        if isinstance(shape, (HalfSpace, EndlessCylinder, CylinderInside)):
            continue
        if isinstance(shape, TriangleMesh):
            sides = shape.corners @ pose.rotation.T + pose.translation
            away = np.linalg.norm(sides.mean(axis=1)[:, None] - line, axis=2).min(axis=1)
            parts.append(sides[away < 2.0 * reach])
            continue
        sides = render.triangles(PlacedShape(shape, pose))
        corners = sides.reshape(-1, 3)
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2.0
        radius = float(np.linalg.norm(corners - middle, axis=1).max())
        if name in under or float(np.linalg.norm(line - middle, axis=1).min()) < radius + reach:
            parts.append(sides)
    return np.concatenate(parts)


def stud_triangles(scene: ClimbScene, rows: Any, radius: float) -> Array:
    """Discs where footholds are ``(m, 3, 3)`` [m]."""
    angle = 2.0 * np.pi * np.arange(CORNERS) / CORNERS
    ring = radius * np.stack([np.cos(angle), np.sin(angle), np.zeros(CORNERS)], axis=1)
    top = ring + [0.0, 0.0, TALL * radius]
    after, middle = np.roll(np.arange(CORNERS), -1), np.broadcast_to(top.mean(axis=0), ring.shape)
    faces = ([top, top[after], middle], [ring, ring[after], top], [ring[after], top[after], top])
    stud = np.concatenate([np.stack(corners, axis=1) for corners in faces])
    poses = [scene.footholds[int(row)].pose for row in rows]
    placed = [stud @ pose.rotation.T + pose.translation for pose in poses]
    return np.concatenate([np.zeros((0, 3, 3)), *placed])


def upwards(scene: ClimbScene, rows: Any) -> Array:
    """Direction that is up for who looks ``(3)``: against gravity; without it out of what some footholds are on."""
    up = -np.asarray(scene.gravity) if np.any(scene.gravity) else scene.normals[list(rows)].sum(axis=0)
    size = float(np.linalg.norm(up))
    return np.asarray(up / size) if size > 1e-6 else np.array([0.0, 0.0, 1.0])


def _patch(shape: HalfSpace | EndlessCylinder, pose: pin.SE3, places: Array, reach: float) -> Array:
    """The part of a body without end that is under some places."""
    local, edge, under = (places - pose.translation) @ pose.rotation, EDGE * reach, UNDER * reach
    if isinstance(shape, HalfSpace):
        sides = patch_of(shape, local[:, :2].min(axis=0) - edge, local[:, :2].max(axis=0) + edge, FACETS)
        return np.asarray((sides - [0.0, 0.0, under]) @ pose.rotation.T + pose.translation)
    inner, angle = EndlessCylinder(shape.radius - under), np.arctan2(local[:, 1], local[:, 0])
    middle = np.arctan2(np.sin(angle).mean(), np.cos(angle).mean())
    spread = (angle - middle + np.pi) % (2.0 * np.pi) - np.pi
    ends = np.clip([spread.min() - edge / inner.radius, spread.max() + edge / inner.radius], -np.pi, np.pi) + middle
    low, high = local[:, 2].min() - edge, local[:, 2].max() + edge
    sides = patch_of(inner, [ends[0], low], [ends[1], high], FACETS)
    return np.asarray(sides @ pose.rotation.T + pose.translation)
