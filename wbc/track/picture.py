"""One picture of a run: the robot at several times, its path and the obstacles."""

from __future__ import annotations

import math
import pathlib
from collections.abc import Sequence
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from wbc.robot import Robot
from wbc.track import render, solids, style
from wbc.track.clearance import bodies_of
from wbc.track.log import Log
from wbc.validation import Array

Colour = tuple[float, float, float]

WHITE: Colour = (0.93, 0.935, 0.945)
DARK: Colour = (0.34, 0.36, 0.40)
PATH: Colour = (0.12, 0.40, 0.75)
ELBOW: Colour = (0.90, 0.50, 0.10)
OBSTACLE: Colour = (0.86, 0.27, 0.22)
#: Tint of the robot at other times than the main one, and how much of it is seen
TINT: Colour = (0.62, 0.74, 0.90)
GHOST = 0.32
SUPERSAMPLING = 2
#: Surfaces nearer to each other than this count as one [m]
BIAS = 0.003
#: Part of the picture's width or height that the scene takes
FILLED = 0.90


def save_picture(
    log: Log, robot: Robot, file: pathlib.Path, main: float | None = None, size: tuple[int, int] = (960, 600)
) -> pathlib.Path | None:
    """Draw a run; returns the file, or None for a log without ticks.

    Args:
        main: time [s] at which the robot is drawn solid; default: where it is nearest to an obstacle, else the middle.
        size: width and height [pixels].
    """
    if len(log) == 0:
        return None
    meshes = _link_meshes(robot)
    solid = _main_tick(log) if main is None else int(np.argmin(np.abs(log["t"] - main)))
    others = _other_ticks(log, solid)
    poses = {
        k: _posed(robot, meshes, log.array("q")[k], log.meta["frame"], moving=k != solid) for k in [solid, *others]
    }
    things = [*_obstacles(log, float(log["t"][solid])), *_traces(log, robot)]
    # A point in thirty is enough to see how large the scene is
    camera = _camera(_points([m for meshes in [*poses.values(), things] for m in meshes])[::30], size)
    image = _render(camera, poses[solid], [poses[k] for k in others], things)
    _annotate(image, log, file)
    return file


def _main_tick(log: Log) -> int:
    gaps = log.array("clearance")
    return int(np.argmin(gaps.min(axis=1))) if gaps.size else len(log) // 2


def _other_ticks(log: Log, solid: int) -> list[int]:
    """Up to two ticks at which the frame is far from where it is at the main one, and far from each other."""
    place = log.array("pose")[:, :3]
    chosen: list[int] = []
    away = np.linalg.norm(place - place[solid], axis=1)
    least = 0.3 * float(away.max())
    while len(chosen) < 2 and away.max() > max(least, 0.02):
        chosen.append(int(np.argmax(away)))
        away = np.minimum(away, np.linalg.norm(place - place[chosen[-1]], axis=1))
    return chosen


def _link_meshes(robot: Robot) -> list[tuple[str, Array]]:
    """(frame, triangles in it): the URDF's visual meshes, else the collision shapes."""
    out = []
    for link, placement, geometry in bodies_of(robot, pin.GeometryType.VISUAL):
        if isinstance(geometry, coal.BVHModelBase):
            vertices = np.array(geometry.vertices()) @ placement.rotation.T + placement.translation
            faces = [(t[0], t[1], t[2]) for t in (geometry.tri_indices(k) for k in range(geometry.num_tris))]
            out.append((link, vertices[np.array(faces, dtype=np.int64)]))
    if out:
        return out
    return [(link, solids.triangles(placed)) for link, shapes in robot.shapes.items() for placed in shapes]


def _posed(
    robot: Robot, meshes: Sequence[tuple[str, Array]], q: Array, tip: str, moving: bool = False
) -> list[render.Mesh]:
    """The links at a configuration; with ``moving`` those that no joint moves are left out."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    last = robot.model.frames[robot.model.getFrameId(tip)].parentJoint
    out = []
    for link, triangles in meshes:
        index = robot.model.getFrameId(link)
        pose = data.oMf[index]
        if moving and robot.model.frames[index].parentJoint == 0:
            continue
        carried = robot.model.frames[index].parentJoint == last and last > 0
        moved = triangles @ pose.rotation.T + pose.translation
        out.append(render.Mesh(moved, DARK if carried else WHITE))
    return out


def _obstacles(log: Log, t: float) -> list[render.Mesh]:
    out = []
    for obstacle in log.meta["obstacles"].values():
        if obstacle["radius"] is not None:
            center = np.array(obstacle["pose"])[:3, 3] + t * np.array(obstacle["velocity"])
            out.append(render.sphere(center, obstacle["radius"], OBSTACLE))
    return out


def _traces(log: Log, robot: Robot) -> list[render.Mesh]:
    """The frame's way, and the elbow's where there is an elbow plane."""
    out = [render.tube(log.array("pose")[:, :3], 0.006, PATH)]
    if "plane.command" in log:
        out.append(render.tube(_elbow(log, robot), 0.004, ELBOW))
    return out


def _elbow(log: Log, robot: Robot) -> Array:
    data = robot.model.createData()
    index = robot.model.getFrameId(robot.frames["elbow"])
    points = []
    for q in log.array("q"):
        pin.framesForwardKinematics(robot.model, data, q)
        points.append(data.oMf[index].translation.copy())
    return np.array(points)


def _camera(points: Array, size: tuple[int, int]) -> render.Camera:
    """Looks from the front, the left and above, so that the points fill the picture."""
    azimuth, elevation, view = math.radians(16.0), math.radians(24.0), math.radians(16.0)
    width, height = (SUPERSAMPLING * s for s in size)
    flat, rise = math.cos(elevation), math.sin(elevation)
    direction = np.array([flat * math.cos(azimuth), flat * math.sin(azimuth), rise])
    target, distance = points.mean(axis=0), 6.0
    for _ in range(6):
        camera = render.Camera(target + distance * direction, target, view, width, height)
        screen = camera.project(points)[:, :2]
        low, high = screen.min(axis=0), screen.max(axis=0)
        off = (low + high) / 2 - np.array([width, height]) / 2
        right, up, _ = camera.axes
        target = target + (off[0] * right - off[1] * up) * distance / camera.focal
        distance *= float(np.max((high - low) / (FILLED * np.array([width, height]))))
    return render.Camera(target + distance * direction, target, view, width, height)


def _render(
    camera: render.Camera,
    solid: list[render.Mesh],
    ghosts: list[list[render.Mesh]],
    things: list[render.Mesh],
) -> Array:
    opaque = [*solid, *things]
    points = _points(opaque)
    shadows = render.Shadows(opaque)
    base = min(0.0, float(points[:, 2].min()))
    image, depth = render.floor(camera, shadows, base, points.mean(axis=0), 1.3)
    layer = render.draw(opaque, camera)
    seen, colours = render.shade(layer, camera, shadows)
    image[seen] = colours
    depth = np.where(seen, layer.depth, depth)
    for meshes in ghosts:
        tinted = [render.Mesh(m.triangles, TINT) for m in meshes]
        layer = render.draw(tinted, camera)
        seen, colours = render.shade(layer, camera, shadows)
        front = seen & (layer.depth < depth - BIAS)
        image[front] = (1.0 - GHOST) * image[front] + GHOST * colours[front[seen]]
    far = float(depth[np.isfinite(layer.depth)].max()) + 1.0
    darker = render.occlusion(np.minimum(depth, far), 5.0 * SUPERSAMPLING)
    image *= (1.0 - np.where(image.min(axis=-1) < 0.99, darker, 0.0))[..., None]
    return render.reduced(image, SUPERSAMPLING)


def _points(meshes: Sequence[render.Mesh]) -> Array:
    return np.concatenate([m.triangles.reshape(-1, 3) for m in meshes])


def _annotate(image: Array, log: Log, file: pathlib.Path) -> None:
    with style.pyplot() as plt:
        height, width = image.shape[:2]
        figure = plt.figure(figsize=(width / 100, height / 100), dpi=100)
        panel = figure.add_axes((0, 0, 1, 1))
        panel.imshow(np.clip(image, 0.0, 1.0), interpolation="none")
        panel.set_axis_off()
        _key(panel, log, width)
        figure.savefig(file, dpi=100)
        plt.close(figure)


def _key(panel: Any, log: Log, width: int) -> None:
    """The colours and what they mean, in the upper right corner."""
    entries: list[tuple[Colour, str]] = [(PATH, f"path of {log.meta['frame']}")]
    if "plane.command" in log:
        entries.append((ELBOW, "path of the elbow"))
    if any(obstacle["radius"] is not None for obstacle in log.meta["obstacles"].values()):
        entries.append((OBSTACLE, "obstacles"))
    for row, (colour, text) in enumerate(entries):
        y = 34.0 + 28.0 * row
        panel.plot([width - 50.0, width - 22.0], [y, y], color=colour, lw=6.0)
        panel.text(width - 62.0, y, text, va="center", ha="right", fontsize=12, color=style.INK)
