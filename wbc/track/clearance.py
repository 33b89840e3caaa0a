"""Distances between links and obstacles, computed anew with Coal and Pinocchio: the referee of the margins."""

from __future__ import annotations

import logging
import pathlib
from collections.abc import Mapping
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from wbc.proximity.geometry import geometry_of
from wbc.robot import Robot
from wbc.robot.files import captured_stderr
from wbc.shapes import Shape
from wbc.track.setup import Moving
from wbc.validation import Array

log = logging.getLogger("wbc")

#: A body of a link: the frame it is fixed to, its place there, and its geometry
Body = tuple[int, pin.SE3, Any]


def clearances(robot: Robot, q: Array, obstacles: Mapping[str, Moving], t: Array) -> dict[str, Array]:
    """Smallest distance of each moving link's shapes to any obstacle, tick by tick [m].

    Args:
        q: configurations, n x nq.
        t: times, n, at which the obstacles are looked at.
    """
    bodies: dict[str, list[Body]] = {}
    for link, placed in robot.shapes.items():
        if _moves(robot, link):
            bodies[link] = [(int(robot.model.getFrameId(link)), *_geometry(p.shape, p.placement)) for p in placed]
    return _distances(robot, bodies, q, obstacles, t)


def least_mesh_clearance(
    robot: Robot, q: Array, obstacles: Mapping[str, Moving], t: Array, lower: Mapping[str, Array]
) -> tuple[float, str, float] | None:
    """(distance [m], link, time [s]) where the URDF's collision bodies come nearest to an obstacle.

    Args:
        lower: the result of :func:`clearances`. Its shapes contain the bodies, so these are lower bounds: ticks are
            looked at in the order of the bounds, until the next bound is above the least distance found.

    Returns None without obstacles, or where no bodies can be read or no link has both bodies and shapes.
    """
    bodies: dict[str, list[Body]] = {}
    for name, placement, geometry in bodies_of(robot, pin.GeometryType.COLLISION) if obstacles and len(q) else ():
        if name in lower:
            bodies.setdefault(name, []).append((int(robot.model.getFrameId(name)), placement, geometry))
    best: tuple[float, str, float] | None = None
    for link, group in bodies.items():
        for k in np.argsort(lower[link], kind="stable"):
            if best is not None and lower[link][k] >= best[0]:
                break
            here = _distances(robot, {link: group}, q[k : k + 1], obstacles, t[k : k + 1])
            if best is None or here[link][0] < best[0]:
                best = (float(here[link][0]), link, float(t[k]))
    return best


def bodies_of(robot: Robot, kind: pin.GeometryType) -> list[tuple[str, pin.SE3, Any]]:
    """(link, placement in the link's frame, coal geometry) of the URDF's bodies; [] where there are none to read."""
    if not robot.source.endswith(".urdf"):
        return []
    folders = [str(folder) for folder in pathlib.Path(robot.source).parents]
    try:
        with captured_stderr():
            model = pin.buildModelFromUrdf(robot.source)
            geometry = pin.buildGeomFromUrdf(model, robot.source, kind, package_dirs=folders)
    except (ValueError, RuntimeError) as error:
        log.warning("bodies of %s: %s", robot.source, " ".join(str(error).split()))
        return []
    out = []
    for body in geometry.geometryObjects:
        frame = model.frames[body.parentFrame]
        if str(frame.name) in robot.frame_names:
            out.append((str(frame.name), frame.placement.inverse() * body.placement, body.geometry))
    return out


def _distances(
    robot: Robot, bodies: Mapping[str, list[Body]], q: Array, obstacles: Mapping[str, Moving], t: Array
) -> dict[str, Array]:
    out = {link: np.full(len(q), np.inf) for link, group in bodies.items() if group and obstacles}
    data = robot.model.createData()
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    for k in range(len(q) if out else 0):
        pin.framesForwardKinematics(robot.model, data, q[k])
        for obstacle in obstacles.values():
            geometry, where = _obstacle(obstacle, t[k])
            for link in out:
                for frame, placement, shape in bodies[link]:
                    pose = data.oMf[frame] * placement
                    result.clear()
                    place = coal.Transform3s(pose.rotation, pose.translation)
                    out[link][k] = min(out[link][k], coal.distance(shape, place, geometry, where, request, result))
    return out


def _obstacle(obstacle: Moving, t: float) -> tuple[Any, Any]:
    pose, geometry = _geometry(obstacle.shape, obstacle.at(t))
    return geometry, coal.Transform3s(pose.rotation, pose.translation)


def _geometry(shape: Shape, pose: pin.SE3) -> tuple[pin.SE3, Any]:
    """(pose of Coal's geometry, geometry) of a shape at a pose."""
    geometry = geometry_of(shape)
    return pose * geometry.offset, geometry.geometry


def _moves(robot: Robot, link: str) -> bool:
    return int(robot.model.frames[robot.model.getFrameId(link)].parentJoint) > 0
