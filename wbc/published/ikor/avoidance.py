"""What a step must not do: joints beyond their limits, links and the platform within spheres and polygons."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wbc.published.ikor.machines import ArmMachine
from wbc.published.ikor.polygons import from_polygon
from wbc.published.ikor.settings import Settings
from wbc.resolvers.fsp import EqualityRow, joint_row, point_row
from wbc.validation import Array

#: The platform among links
PLATFORM = -1


@dataclass(frozen=True, eq=False)
class ObstacleGap:
    """Between an obstacle and a link: least distance, less than 0 within the obstacle, nearest point of the link, and
    the unit normal along which that gets away. The platform, link -1, is a disc on the ground.
    """

    size: float
    link: int
    point: Array
    normal: Array
    obstacle: str

    def row(self, machine: ArmMachine, q: Array) -> EqualityRow:
        """The point goes clear along the normal in one step."""
        name = "platform" if self.link == PLATFORM else f"link {self.link + 1}"
        J = machine.point_jacobian(q, self.link, self.point) if self.link >= 0 else np.eye(3, len(q), len(q) - 3)
        if self.link == PLATFORM:
            J[2] = 0.0
        return point_row(f"{name}, {self.obstacle}", J, self.normal, -self.size)


def gaps(
    machine: ArmMachine, q: Array, spheres: Array, margin: float = 0.0, whole: bool = True,
    polygons: Sequence[Sequence[Array]] = (),
) -> list[ObstacleGap]:  # fmt: skip
    """Of every obstacle and link; ``whole``: of tool and platform, too, which the published driver left out.

    ``polygons``: of planar arms, each as its convex parts, corners [k, 2] to the left around.
    """
    points, out = machine.points(q), list[ObstacleGap]()
    links = len(points) - (1 if whole else 2)
    ways = np.diff(points, axis=0)[:links]
    lengths = np.maximum((ways * ways).sum(axis=1), 1e-300)
    for number, polygon in enumerate(polygons, 1):
        for k, part in enumerate(polygon, 1):
            name = f"polygon {number}" if len(polygon) == 1 else f"polygon {number}, part {k}"
            for link in range(links):
                normal, sizes, places = from_polygon(points[link : link + 2, :2], part)
                ends = ("",) if len(sizes) == 1 else (", first end", ", last end")
                for size, place, end in zip(sizes.tolist(), places, ends, strict=True):
                    point, away = np.append(place, points[link, 2]), np.append(normal, 0.0)
                    out.append(ObstacleGap(size - margin, link, point, away, name + end))
    for number, (*centre, radius) in enumerate(spheres, 1):
        shares = np.clip(((centre - points[:links]) * ways).sum(axis=1) / lengths, 0.0, 1.0)
        near = points[:links] + shares[:, None] * ways
        for link in range(links):
            size, normal = _away(near[link] - centre, ways[link])
            out.append(ObstacleGap(size - radius - margin, link, near[link], normal, f"sphere {number}"))
        across = (radius + margin) ** 2 - centre[2] ** 2
        if whole and machine.base != "none" and across >= 0.0:
            middle = np.array([q[-3], q[-2], centre[2]])
            size, normal = _away(middle - centre, np.array([0.0, 0.0, 1.0]))
            out.append(
                ObstacleGap(size - machine.plate - math.sqrt(across), PLATFORM, middle, normal, f"sphere {number}")
            )
    return out


def broken(
    machine: ArmMachine, settings: Settings, q: Array, v: Array, spheres: Array,
    polygons: Sequence[Sequence[Array]] = (),
) -> list[EqualityRow]:  # fmt: skip
    """Constraints that q + v breaks, the worst first: back by all of it in one step."""
    out = list[tuple[float, EqualityRow]]()
    if settings.limits:
        low, high = machine.lower - q, machine.upper - q
        for joint in np.flatnonzero((v > high + 1e-12) | (v < low - 1e-12)).tolist():
            step = float(np.clip(v[joint], low[joint], high[joint]))
            out.append((abs(step - v[joint]), joint_row(f"joint {joint + 1}", joint, len(q), step)))
    if settings.obstacles:
        # No point moves by more than ten times what all columns move together
        reach = 10.0 * float(np.abs(v).sum())
        for gap in gaps(machine, q, spheres, settings.margin, settings.ahead, polygons):
            if gap.size < 0.0 or gap.size < reach:
                row = gap.row(machine, q)
                late = row.value - float(row.a @ v)
                if late > 1e-12:
                    out.append((late, row))
    return [row for _, row in sorted(out, key=lambda one: -one[0])]


def _away(off: Array, along: Array) -> tuple[float, Array]:
    """(distance, unit vector); across the link where its point is the centre, which has no normal of its own."""
    size = float(np.linalg.norm(off))
    if size < 1e-9:
        size, off = 0.0, np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
    return size, off / np.linalg.norm(off)
