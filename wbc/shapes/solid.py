"""What every shape says of itself: to the kernel of distances, to pictures, to a simulator and to inertias."""

from __future__ import annotations

from dataclasses import field
from enum import IntEnum
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from wbc.errors import ShapeError
from wbc.multibody import pin
from wbc.quick_dataclasses import dataclass
from wbc.validation import Array

if TYPE_CHECKING:
    import mujoco

#: Distance [m] that stands for nothing in reach.
FAR = 1e3


class Kind(IntEnum):
    """What the kernel makes of a shape; the same numbers stand in ``geometry/native/shapes.h``."""

    SUM = 0
    HULL = 1
    ELLIPSOID = 2
    PLANE = 3
    TUBE = 4
    ROD = 5
    MESH = 6
    FIELD = 7


@dataclass(frozen=True, eq=False)
class Stored:
    """Numbers of a shape that are more than its sizes, as ``shape_t`` of ``geometry/native/shapes.h`` has them.

    Attributes:
        count: of points, of triangles of a closed surface, or of columns of heights.
        points: flat [m]. tree: children of boxes, n x 2. box: least and greatest corners, n x 6 [m].
    """

    count: int = 0
    points: Array = field(default_factory=lambda: np.zeros(0))
    tree: NDArray[np.int32] = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int32))
    box: Array = field(default_factory=lambda: np.zeros((0, 6)))


class Geometry:
    """What a distance is measured to. Kinds before ``PLANE`` are convex and end somewhere: a pair needs one of these.

    Attributes:
        kind: how the kernel measures it.
    """

    kind: ClassVar[Kind]

    @property
    def center(self) -> Array:
        """Centre of a sphere round the shape, in the shape's frame [m]."""
        return np.zeros(3)

    @property
    def reach(self) -> float:
        """Radius of that sphere [m]; infinite where there is none."""
        return np.inf

    @property
    def sizes(self) -> tuple[float, float, float, float, float]:
        """Half sides or semi-axes along x, y and z, radius of a disc across z, radius of a ball: a shape of kind
        ``SUM`` is their sum [m].
        """
        return (0.0, 0.0, 0.0, 0.0, 0.0)

    @property
    def is_round(self) -> bool:
        """Whether the shape is a ball or a capsule: all points within a radius of a point or a segment."""
        x, y, _, disc, _ = self.sizes
        return self.kind == Kind.SUM and x == y == disc == 0.0

    def row_corners(self) -> Array:
        """Corners, centres of round ends, points on rims; about the centre, n x 3 [m]. Nearest points jump to them."""
        return np.zeros((0, 3))

    def inertia(self, mass: float) -> pin.Inertia:
        """Inertia of a homogeneous body of this mass [kg], about the origin of the shape's frame.

        Raises:
            ShapeError: it is not computed for this shape.
        """
        name = type(self).__name__
        raise ShapeError("inertia", None, f"the inertia of a {name} is not computed: give inertia=pin.Inertia(...)")

    def stored(self) -> Stored:
        """What the kernel needs beside the sizes, about the centre."""
        return Stored()


@dataclass(frozen=True, eq=False)
class Solid(Geometry):
    """A body of finite size, which links can have. A subclass is a new shape: all that measures, draws or simulates
    shapes asks these methods.

    Attributes:
        geom: MuJoCo's kind of geom.
    """

    geom: ClassVar[str]

    def capsule(self) -> tuple[Array, Array, float]:
        """(end, end, radius) of a capsule that contains the shape, in its frame [m]."""
        return self.center, self.center, self.reach

    def triangles(self) -> Array:
        """The surface as triangles, n x 3 x 3 [m].

        Raises:
            ShapeError: it is not known of this shape.
        """
        raise ShapeError("triangles", self, "no surface is known of this shape")

    def become(self, geom: mujoco.MjsGeom, spec: mujoco.MjSpec, name: str) -> None:
        """Give a geom of a MuJoCo model this shape; ``name`` is for what else the model needs for it."""
        import mujoco

        x, y, z, disc, ball = self.sizes
        # MuJoCo has no capsules without length
        kind = "SPHERE" if self.is_round and z == 0.0 else self.geom
        geom.type = getattr(mujoco.mjtGeom, f"mjGEOM_{kind}")
        geom.size = [x, y, z] if x else [disc + ball, z, 0.0]


@dataclass(frozen=True)
class HalfSpace(Geometry):
    """Points with z <= 0: the boundary is the plane z = 0 of the shape's frame, outward normal +z."""

    kind = Kind.PLANE


Shape = Solid | HalfSpace


def why_apart(a: Geometry, b: Geometry) -> str:
    """Why two shapes have no distance; "" where they have one."""
    if min(a.kind, b.kind) < Kind.PLANE:
        return ""
    return f"{type(a).__name__} and {type(b).__name__} have no distance: one of the two must be convex and have an end"
