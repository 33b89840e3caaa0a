"""Shapes of links as bodies of a constraint: which links have them, which can move, and the rows of sensed pairs."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import casadi as ca

from wbc import validation
from wbc.errors import MissingShapeError, RangeError, ShapeError, nearest
from wbc.proximity import MAX_PAIRS, Body
from wbc.robot import Robot
from wbc.shapes import Geometry, PlacedShape
from wbc.shapes.solid import why_apart
from wbc.tasks.base import Row, Values

#: Link, number of the shape within the link, shape
LinkShape = tuple[str, int, PlacedShape]


def shapes_of(robot: Robot, links: Iterable[str]) -> tuple[LinkShape, ...]:
    """Every shape of the links."""
    return tuple((link, k, placed) for link in links for k, placed in enumerate(robot.shapes.get(link, ())))


def label(link: str, number: int) -> str:
    """Name of shape ``number`` of a link."""
    return f"{link}[{number}]"


def body(link: str, number: int, placed: PlacedShape) -> Body:
    """A link's shape for the sensor."""
    return Body(label(link, number), link, placed.placement, placed.shape)


def sensed_labels(rows: int, corners: int) -> tuple[Row, ...]:
    """Rows of a sensor: which pairs they are about changes from tick to tick."""
    count = rows // (1 + corners)
    nearest = tuple(Row(f"closest[{k}]", "m") for k in range(count))
    return (*nearest, *(Row(f"closest[{k}].corner[{i}]", "m") for k in range(count) for i in range(corners)))


def sensed_margins(inputs: Values, count: int) -> ca.SX:
    """distance - margin of the sensed rows."""
    return inputs["distance"] - inputs["margin"] if count else ca.SX(0, 1)


#: Pairs, or corners of each, that have a row at most
MOST = 1000


def checked_count(field: str, value: Any, least: int = 1) -> int:
    """How many of the closest pairs, or of their corners, have a row.

    Raises:
        RangeError: not an integer from ``least`` to :data:`MOST`.
    """
    number = validation.scalar(field, value, low=float(least), high=float(MOST))
    if isinstance(value, bool) or number != int(number):
        raise RangeError(field, value, f"expected an integer >= {least}")
    return int(number)


def check_sensed(field: str, count: int) -> None:
    """Refuse more pairs than a sensor takes.

    Raises:
        RangeError: too many.
    """
    if count > MAX_PAIRS:
        raise RangeError(field, count, f"more pairs of shapes than a sensor measures, which are {MAX_PAIRS}")


def check_distances(field: str, pairs: Iterable[tuple[Geometry, Geometry]]) -> None:
    """Refuse pairs of shapes that have no distance.

    Raises:
        ShapeError: such a pair.
    """
    for one, other in pairs:
        if reason := why_apart(one, other):
            raise ShapeError(field, (one, other), reason)


def check_shaped(robot: Robot, field: str, link: Any, available: Iterable[str]) -> None:
    """Refuse a name that is no frame or that has no shapes.

    Raises:
        UnknownNameError, MissingShapeError: with the names that have shapes.
    """
    robot.check_frame(field, link)
    if not robot.shapes.get(link):
        reason = "this link has no collision shapes (give it some with robot.with_shapes)"
        raise MissingShapeError(field, link, reason + meshes_instead(robot), nearest(link, available))


def meshes_instead(robot: Robot) -> str:
    """What to do where a description has meshes in place of shapes, as the end of a reason."""
    unread = "meshes, not read" in robot.notes.get("shapes", "")
    return "; its description has meshes: wbc.robots.load(..., shapes='fit') fits capsules to them" if unread else ""
