"""What a collision body becomes: the capsule around it, several capsules or spheres, or itself."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.multibody import own
from wbc.robot.geometry.bodies import Raw, RawBox, RawCylinder, RawEllipsoid
from wbc.robot.geometry.convex_parts import parts_of
from wbc.robot.geometry.covering import cover, largest_excess
from wbc.robot.geometry.meshes import Mesh, box_mesh, cylinder_mesh, ellipsoid_mesh
from wbc.shapes import Box, Capsule, Cylinder, Ellipsoid, HeightMap, PlacedShape, Solid, Sphere
from wbc.shapes.around import around_cylinder, around_ellipsoid
from wbc.validation import Array

#: Kind of shapes -> how many a body gets at most, where nobody says.
COUNTS = {"capsule": 1, "spheres": 4, "convex": 1}


#: Shapes around one body at most
MOST = 32


@dataclass(frozen=True)
class Style:
    """How bodies become shapes.

    Attributes:
        kind: one of :data:`COUNTS`.
        count: most shapes a body; None: as in :data:`COUNTS`. Convex parts are as many as the mesh has.
        tolerance: fewer shapes do where they stand out by at most this [m].

    Raises:
        UnknownNameError, ShapeError, RangeError: a kind, count or tolerance that makes no sense.
    """

    kind: str = "capsule"
    count: int | None = None
    tolerance: float = 0.0

    def __post_init__(self) -> None:
        validation.one_of("kind", self.kind, COUNTS)
        if self.count is not None:
            validation.integer("count", self.count, 1, MOST)
            if self.kind == "convex":
                raise RangeError("count", self.count, "convex parts are as many as the mesh has")
        validation.scalar("tolerance", self.tolerance, low=0.0, unit="m")

    def shapes(self, raw: Raw, placement: own.SE3) -> tuple[tuple[PlacedShape, ...], tuple[str, ...]]:
        """(shapes of a body in its link's frame, remarks about components without volume).

        Together the shapes contain the body. Spheres, capsules and height maps stay themselves.

        Raises:
            RobotFileError: a mesh without a volume, for convex parts. RangeError: a box or cylinder of size 0, for
                exact ones.
        """
        if self.kind == "convex" and isinstance(raw, Mesh):
            found = parts_of(raw)
            return tuple(PlacedShape(part, placement) for part in found.parts), found.remarks
        return self._fitted(raw, placement), ()

    def _fitted(self, raw: Raw, placement: own.SE3) -> tuple[PlacedShape, ...]:
        if isinstance(raw, (Sphere, Capsule, HeightMap)):
            return (PlacedShape(raw, placement),)
        count = COUNTS[self.kind] if self.count is None else self.count
        if isinstance(raw, Mesh):
            return cover(raw.moved(placement), self.kind, count, self.tolerance)
        if self.kind == "convex":
            return (PlacedShape(exact_shape(raw), placement),)
        if self.kind == "spheres":
            return _covered(raw, placement, self, count)
        one = (_capsule(raw, placement),)
        if count == 1 or largest_excess(one) <= self.tolerance:
            return one
        return min(one, _covered(raw, placement, self, count), key=largest_excess)


def _covered(
    raw: RawBox | RawCylinder | RawEllipsoid, placement: own.SE3, style: Style, count: int
) -> tuple[PlacedShape, ...]:
    """Shapes around the polyhedron around a body; what that stands out by is added to their excess, a bound then."""
    mesh, slack = polyhedron(raw)
    found = cover(mesh.moved(placement), style.kind, count, max(style.tolerance - slack, 0.0))
    return tuple(replace(shape, excess=shape.excess + slack) for shape in found)


def polyhedron(raw: RawBox | RawCylinder | RawEllipsoid) -> tuple[Mesh, float]:
    """(a polyhedron around a body, a bound of how far it stands out of it [m])."""
    if isinstance(raw, RawBox):
        return box_mesh(raw.half), 0.0
    if isinstance(raw, RawCylinder):
        return cylinder_mesh(raw.radius, raw.half)
    return ellipsoid_mesh(raw.radii)


def exact_shape(raw: Sphere | Capsule | HeightMap | RawBox | RawCylinder | RawEllipsoid) -> Solid:
    """A body as a shape of the same size.

    Raises:
        RangeError: a box, cylinder or ellipsoid of size 0.
    """
    if isinstance(raw, RawBox):
        return Box((2 * raw.half[0], 2 * raw.half[1], 2 * raw.half[2]))
    if isinstance(raw, RawCylinder):
        return Cylinder(raw.radius, 2 * raw.half)
    return Ellipsoid(tuple(raw.radii)) if isinstance(raw, RawEllipsoid) else raw


def _capsule(raw: RawBox | RawCylinder | RawEllipsoid, placement: own.SE3) -> PlacedShape:
    """The least capsule on the body's longest axis, with the exact excess."""
    if isinstance(raw, RawCylinder):
        radius, half, gap = around_cylinder(raw.radius, raw.half)
        turn = own.SE3.Identity()
    elif isinstance(raw, RawBox):
        longest = int(np.argmax(raw.half))
        across: Array = np.delete(raw.half, longest)
        size = float(np.hypot(*across))
        radius, half, gap = around_cylinder(size, float(raw.half[longest]), float(across.min()))
        turn = _axis_to_z(longest)
    else:
        radius, half, gap = around_ellipsoid(raw.radii)
        turn = _axis_to_z(int(np.argmax(raw.radii)))
    shape = Sphere(radius) if half <= 0.0 else Capsule(radius, 2 * half)
    return PlacedShape(shape, placement * turn, gap)


def _axis_to_z(axis: int) -> own.SE3:
    """A rotation whose z axis is the given axis."""
    return own.SE3(np.roll(np.eye(3), 2 - axis, axis=1), np.zeros(3))
