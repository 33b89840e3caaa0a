"""Distances between links and obstacles, computed anew with Coal and Pinocchio: the referee of the margins."""

from __future__ import annotations

import itertools
import logging
import pathlib
from collections.abc import Iterable, Mapping
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from wbc import validation
from wbc.errors import MissingShapeError, ShapeError
from wbc.robot import Robot
from wbc.robot.geometry.coal_shapes import geometry_of
from wbc.robot.robot import checked_robot
from wbc.robot.sources.files import captured_stderr
from wbc.shapes import Shape
from wbc.track.setup import MovingObstacle
from wbc.validation import Array

log = logging.getLogger("wbc")

#: A body of a link: the frame it is fixed to, its place there, and its geometry
Body = tuple[int, pin.SE3, Any]


def clearances(robot: Robot, q: Array, obstacles: Mapping[str, MovingObstacle], t: Array) -> dict[str, Array]:
    """Smallest distance of each moving link's shapes to any obstacle, tick by tick [m].

    Args:
        q: configurations, n x nq.
        t: times, n, at which the obstacles are looked at.
    """
    q, t = _states(robot, q), validation.ordinary_array("t", t)
    if t.shape != (len(q),):
        raise ShapeError("t", t, f"expected {len(q)} times, one for each configuration")
    for name, one in validation.mapping("obstacles", obstacles, "names to Movings").items():
        validation.instance(f"obstacles[{name}]", one, MovingObstacle, "a MovingObstacle")
    bodies = {link: _bodies(robot, link) for link in robot.shapes if _moves(robot, link)}
    return _distances(robot, bodies, q, obstacles, t)


def self_clearances(robot: Robot, q: Array, pairs: Iterable[tuple[str, str]]) -> dict[tuple[str, str], Array]:
    """Signed distance of the shapes of two links, tick by tick [m], for each of some pairs of links.

    Args:
        q: configurations, n x nq.
        pairs: names of links with shapes.

    Raises:
        UnknownNameError: no such frame. MissingShapeError: no shapes on it.
    """
    q = _states(robot, q)
    both = [validation.strings("pairs", pair) for pair in validation.items("pairs", pairs, "pairs of links")]
    if any(len(pair) != 2 for pair in both):
        raise ShapeError("pairs", pairs, "expected pairs of links")
    out = {(pair[0], pair[1]): np.full(len(q), np.inf) for pair in both}
    bodies = {link: _bodies(robot, robot.check_frame("pairs", link)) for pair in out for link in pair}
    for link, group in bodies.items():
        if not group:
            raise MissingShapeError("pairs", link, "this link has no collision shapes")
    data, request, result = robot.model.createData(), coal.DistanceRequest(), coal.DistanceResult()
    for k, configuration in enumerate(q):
        pin.framesForwardKinematics(robot.model, data, configuration)
        where = {link: [_placed(data, body) for body in group] for link, group in bodies.items()}
        for (first, second), gaps in out.items():
            for a, b in itertools.product(where[first], where[second]):
                result.clear()
                gaps[k] = min(gaps[k], coal.distance(*a, *b, request, result))
    return out


def _states(robot: Robot, q: Any) -> Array:
    """Configurations, n x nq."""
    checked_robot(robot)
    states = validation.ordinary_array("q", q)
    if states.ndim != 2 or states.shape[1] != robot.nq:
        raise ShapeError("q", q, f"expected configurations, n x {robot.nq}")
    return states


def least_mesh_clearance(
    robot: Robot, q: Array, obstacles: Mapping[str, MovingObstacle], t: Array, lower: Mapping[str, Array]
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
    robot: Robot, bodies: Mapping[str, list[Body]], q: Array, obstacles: Mapping[str, MovingObstacle], t: Array
) -> dict[str, Array]:
    out = {link: np.full(len(q), np.inf) for link, group in bodies.items() if group and obstacles}
    data = robot.model.createData()
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    for k in range(len(q) if out else 0):
        pin.framesForwardKinematics(robot.model, data, q[k])
        for obstacle in obstacles.values():
            geometry, where = _obstacle(obstacle, t[k])
            for link in out:
                for body in bodies[link]:
                    result.clear()
                    gap = coal.distance(*_placed(data, body), geometry, where, request, result)
                    out[link][k] = min(out[link][k], gap)
    return out


def _bodies(robot: Robot, link: str) -> list[Body]:
    frame = int(robot.model.getFrameId(link))
    return [(frame, *_geometry(p.shape, p.placement)) for p in robot.shapes.get(link, ())]


def _placed(data: pin.Data, body: Body) -> tuple[Any, Any]:
    """(geometry, its pose in the world) for Coal."""
    frame, placement, geometry = body
    pose = data.oMf[frame] * placement
    return geometry, coal.Transform3s(pose.rotation, pose.translation)


def _obstacle(obstacle: MovingObstacle, t: float) -> tuple[Any, Any]:
    pose, geometry = _geometry(obstacle.shape, obstacle.at(t))
    return geometry, coal.Transform3s(pose.rotation, pose.translation)


def _geometry(shape: Shape, pose: pin.SE3) -> tuple[pin.SE3, Any]:
    """(pose of Coal's geometry, geometry) of a shape at a pose."""
    geometry = geometry_of(shape)
    return pose * geometry.offset, geometry.geometry


def _moves(robot: Robot, link: str) -> bool:
    return int(robot.model.frames[robot.model.getFrameId(link)].parentJoint) > 0
