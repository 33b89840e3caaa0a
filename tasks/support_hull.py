"""The centre of mass stays over the contacts of a robot that stands on a floor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.robot.robot import Robot, checked_robot
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Input, Values
from wbc.tasks.expression import Expression
from wbc.tasks.limit import Limit

#: Contacts lie in one horizontal plane to within this [m]
LEVEL = 0.01
#: A hull with less area has no inside [m^2]
LEAST_AREA = 1e-6


def support_polygon(
    robot: Robot, contacts: Mapping[str, Any], q: Any = None, *, margin: float = 0.0, edges: int = 0
) -> Limit:
    """A constraint that keeps the centre of mass c over the convex hull of what the robot stands on:

        h_i = n_i' (c_x, c_y) - d_i >= 0                                                               [m]

    with one row an edge, n_i its inward normal and d_i so that h_i is the distance from the edge, less ``margin``.

    Args:
        robot: the robot. contacts: frame -> its corners in that frame, n x 3 [m], such as those of a sole.
        q: where the frames stand; default: the neutral configuration. margin: distance kept from the edges [m].
        edges: rows, for contacts that change: at least as many as any later hull has. Default: as this one has.

    A contact that comes or goes is a new hull, of the same number of rows:

        controller["polygon"].set(**support_planes(robot, {"left_sole": corners}, q, margin=0.01, edges=8))

    Example:
        >>> corners = [(0.1, 0.05, 0), (0.1, -0.05, 0), (-0.1, -0.05, 0), (-0.1, 0.05, 0)]
        >>> stack.add(support_polygon(robot, {"left_sole": corners, "right_sole": corners}), name="polygon")

    What it cannot do: contacts at several heights, on slopes or of hands, and motion so quick that inertia counts:
    there forces decide, as in stacks that command torques. The hull is where the frames are at ``q``: hold them.

    Raises:
        UnknownNameError, ShapeError, NotFiniteError: bad contacts. RangeError: they lie on a line or not in one plane,
            the margin leaves nothing, or the hull has more edges.
    """
    planes = support_planes(robot, contacts, q, margin=margin, edges=edges)
    count = len(planes["offsets"])
    inputs = (
        Input("normals", size=2 * count, default=planes["normals"]),
        Input("offsets", unit="m", size=count, default=planes["offsets"]),
    )
    labels = [f"edge[{k}]" for k in range(count)]
    return Limit(Expression(_distances, units="m", inputs=inputs, labels=labels), lower=0.0)


def support_planes(
    robot: Robot, contacts: Mapping[str, Any], q: Any = None, *, margin: float = 0.0, edges: int = 0
) -> dict[str, NDArray[np.float64]]:
    """Run-time values of :func:`support_polygon` for other contacts: ``normals`` and ``offsets``.

    Rows that a hull with fewer edges leaves over repeat its last edge.

    Raises:
        As :func:`support_polygon`.
    """
    checked_robot(robot)
    where = robot.neutral if q is None else robot.configuration("q", q)
    points = []
    for frame, corners in validation.mapping("contacts", contacts, "frames to corners").items():
        local = validation.ordinary_array(f"contacts[{frame}]", corners)
        if local.ndim != 2 or local.shape[1] != 3:
            raise ShapeError(f"contacts[{frame}]", corners, "expected corners, n x 3")
        pose = robot.pose(where, frame)
        points.append(local @ pose.rotation.T + pose.translation)
    placed = np.concatenate([np.zeros((0, 3)), *points])
    if len(placed) < 3 or np.ptp(placed[:, 2]) > LEVEL:
        raise RangeError("contacts", list(contacts), f"expected three corners or more, in one plane within {LEVEL} m")
    normals, offsets = _edges(placed[:, :2])
    middle = placed[:, :2].mean(axis=0)
    inside = float((normals @ middle - offsets).min())
    offsets = offsets + validation.scalar("margin", margin, low=0.0, high=inside, unit="m")
    left = max(edges, len(normals)) - len(normals)
    if 0 < edges < len(normals):
        raise RangeError("edges", edges, f"the hull has {len(normals)}")
    normals, offsets = np.vstack([normals, *[normals[-1:]] * left]), np.append(offsets, [offsets[-1]] * left)
    return {"normals": normals.ravel(), "offsets": offsets}


def _edges(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Inward normals and offsets of the edges of a hull."""
    # Imported here: most processes make no hull, and scipy takes longer to import than all the rest
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except QhullError as error:
        raise RangeError("contacts", points.tolist(), "the corners lie on a line: there is no polygon") from error
    if float(hull.volume) < LEAST_AREA:
        raise RangeError("contacts", points.tolist(), "the corners lie on a line: there is no polygon")
    equations = np.unique(np.round(hull.equations, 12), axis=0)
    return -equations[:, :2], equations[:, 2]


def _distances(kin: Tracer, p: Values) -> ca.SX:
    count = p["offsets"].numel()
    out: ca.SX = ca.reshape(p["normals"], 2, count).T @ kin.center_of_mass()[:2] - p["offsets"]
    return out
