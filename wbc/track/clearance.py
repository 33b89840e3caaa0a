"""Distances between links and obstacles, measured anew at the logged configurations."""

from __future__ import annotations

import logging
import pathlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from wbc import validation
from wbc.clearance import TriangleMesh
from wbc.errors import MissingShapeError, ShapeError
from wbc.geometry import ShapeTable, distances
from wbc.multibody import PINOCCHIO, pin
from wbc.robot import Robot
from wbc.robot.geometry.bodies import raw_of
from wbc.robot.geometry.meshes import Mesh
from wbc.robot.geometry.styles import exact_shape
from wbc.robot.robot import checked_robot
from wbc.robot.sources.files import captured_stderr
from wbc.shapes import Geometry
from wbc.symbolic.joint_steps import place
from wbc.symbolic.kinematics import joint_of
from wbc.track.setup import MovingObstacle
from wbc.validation import Array

log = logging.getLogger("wbc")

#: A body: its shape, and where that is at a configuration (of frames that were placed, and its number)
Body = tuple[Geometry, Callable[[pin.Data, int], pin.SE3]]


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
    bodies = {link: _bodies(robot, link) for link in robot.shapes if joint_of(robot.model, link)}
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
    names = list(dict.fromkeys((pair[0], pair[1]) for pair in both))
    bodies = {link: _bodies(robot, robot.check_frame("pairs", link)) for pair in names for link in pair}
    for link, group in bodies.items():
        if not group:
            raise MissingShapeError("pairs", link, "this link has no collision shapes")
    found = _least(robot, q, [(bodies[a], bodies[b]) for a, b in names])
    return dict(zip(names, found, strict=True))


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
            bodies.setdefault(name, []).append(_on_link(robot, name, placement, _shape_of(geometry)))
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
    if not PINOCCHIO:
        log.warning("bodies of %s: Pinocchio reads them, which is not installed", robot.source)
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
    around = [_moving(one, t) for one in obstacles.values()]
    links = [link for link, group in bodies.items() if group and obstacles]
    return dict(zip(links, _least(robot, q, [(bodies[link], around) for link in links]), strict=True))


def _least(robot: Robot, q: Array, pairs: Sequence[tuple[Sequence[Body], Sequence[Body]]]) -> list[Array]:
    """The least signed distance between two groups of bodies at every configuration [m], for each of some pairs."""
    if not pairs:
        return []
    every = list({id(body): body for pair in pairs for group in pair for body in group}.values())
    number = {id(body): k for k, body in enumerate(every)}
    table, center = ShapeTable([shape for shape, _ in every]), [shape.center for shape, _ in every]
    both = [[(number[id(a)], number[id(b)]) for a in one for b in other] for one, other in pairs]
    (first, second), begin = np.concatenate(both).T, np.cumsum([0, *map(len, both[:-1])])
    data, poses, out = robot.model.createData(), np.empty((len(every), 12)), np.empty((len(q), len(pairs)))
    for k, configuration in enumerate(q):
        pin.framesForwardKinematics(robot.model, data, configuration)
        for i, (_, where) in enumerate(every):
            poses[i] = place(where(data, k) * pin.SE3(np.eye(3), center[i]))
        out[k] = np.minimum.reduceat(distances(table, poses, first, second)[:, 0], begin)
    return list(out.T)


def _bodies(robot: Robot, link: str) -> list[Body]:
    return [_on_link(robot, link, placed.placement, placed.shape) for placed in robot.shapes.get(link, ())]


def _on_link(robot: Robot, link: str, placement: pin.SE3, shape: Geometry) -> Body:
    frame = int(robot.model.getFrameId(link))
    return shape, lambda data, _: data.oMf[frame] * placement


def _moving(obstacle: MovingObstacle, t: Array) -> Body:
    return obstacle.shape, lambda _, k: obstacle.at(t[k])


def _shape_of(geometry: Any) -> Geometry:
    """A body of a description as a shape."""
    raw = raw_of(geometry)
    return TriangleMesh(raw.vertices[raw.triangles]) if isinstance(raw, Mesh) else exact_shape(raw)
