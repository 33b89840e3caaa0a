"""Triangle meshes: read from files, made around round bodies, cut into slabs and into connected components."""

from __future__ import annotations

import itertools
import pathlib
import xml.etree.ElementTree as ElementTree
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc import extras
from wbc.errors import RobotFileError
from wbc.multibody import pin
from wbc.quick_dataclasses import dataclass
from wbc.robot.sources.files import PARSER_ERRORS, captured_stderr
from wbc.validation import Array

Triangles = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh.

    Attributes:
        vertices: n x 3 [m].
        triangles: m x 3 numbers of vertices.
    """

    vertices: Array
    triangles: Triangles

    def moved(self, placement: pin.SE3) -> Mesh:
        """The mesh at a placement."""
        return Mesh(self.vertices @ placement.rotation.T + placement.translation, self.triangles)

    @cached_property
    def edges(self) -> Triangles:
        """Both ends of every edge, once [k x 2]."""
        edges = np.vstack([self.triangles[:, [0, 1]], self.triangles[:, [1, 2]], self.triangles[:, [2, 0]]])
        return np.unique(np.sort(edges, axis=1), axis=0)

    def slabs(self, axis: Array, cuts: Array) -> list[Array]:
        """The mesh cut by the planes axis . x = cut: for each slab the corners [n x 3] of the triangles' pieces in it.

        The hull of a slab's corners contains all of the surface within the slab and, for a closed surface, all of
        the body: a line through an inner point, parallel to the planes, leaves the body on both sides within the slab.
        """
        height = self.vertices @ axis
        starts, ends = self.vertices[self.edges[:, 0]], self.vertices[self.edges[:, 1]]
        low, high = height[self.edges[:, 0]], height[self.edges[:, 1]]
        rings = []
        for cut in cuts:
            crossing = (low - cut) * (high - cut) < 0.0
            share = (cut - low[crossing]) / (high[crossing] - low[crossing])
            rings.append(starts[crossing] + share[:, None] * (ends - starts)[crossing])
        borders = [-np.inf, *cuts, np.inf]
        return [
            np.vstack([self.vertices[(height >= lower) & (height <= upper)], *rings[max(k - 1, 0) : k + 1]])
            for k, (lower, upper) in enumerate(itertools.pairwise(borders))
        ]

    def components(self) -> list[Array]:
        """The vertices of each connected component [n x 3]; vertices at the same place are one.

        A vertex of no triangle is a component of its own.
        """
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        points, place = np.unique(self.vertices, axis=0, return_inverse=True)
        ends = place.ravel()[self.edges]
        graph = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(len(points), len(points)))
        count, label = connected_components(graph, directed=False)
        order = np.argsort(label, kind="stable")
        return np.split(points[order], np.cumsum(np.bincount(label, minlength=count))[:-1])


def read_mesh(path: pathlib.Path, scale: Array) -> Mesh:
    """The mesh in a file that Coal's loader reads (STL, OBJ, DAE, ...), in metres where a DAE says what its unit is.

    Raises:
        RobotFileError: missing, unreadable or empty. MissingPackageError: Coal is not installed.
    """
    if not path.is_file():
        raise RobotFileError("mesh", str(path), "there is no such file")
    try:
        import coal
    except ModuleNotFoundError as error:
        raise extras.missing("coal", "coal", "reading meshes") from error
    try:
        with captured_stderr() as noise:
            loaded = coal.MeshLoader().load(str(path), scale * _metres(path))
    except PARSER_ERRORS as error:
        raise RobotFileError("mesh", str(path), noise.reason or " ".join(str(error).split())) from error
    mesh = mesh_of(loaded)
    if mesh.vertices.ndim != 2 or len(mesh.vertices) == 0 or not np.isfinite(mesh.vertices).all():
        raise RobotFileError("mesh", str(path), "no finite vertices in it")
    return mesh


def _metres(path: pathlib.Path) -> float:
    """The unit of a Collada file, which Coal's loader takes for 1 [m]."""
    if path.suffix.lower() != ".dae":
        return 1.0
    try:
        asset = next((part for _, part in ElementTree.iterparse(path) if part.tag.endswith("}asset")), None)
        unit = None if asset is None else asset.find("{*}unit")
        metres = 1.0 if unit is None else float(unit.get("meter", "1"))
    except (ElementTree.ParseError, ValueError) as error:
        raise RobotFileError("mesh", str(path), f"its unit cannot be read: {error}") from error
    if not 0.0 < metres < np.inf:
        raise RobotFileError("mesh", str(path), f"its unit is {metres:g} m")
    return metres


def mesh_of(geometry: Any) -> Mesh:
    """The mesh of a Coal geometry."""
    corners = [geometry.tri_indices(k) for k in range(geometry.num_tris)]
    triangles = np.array([(c[0], c[1], c[2]) for c in corners], dtype=np.intp).reshape(-1, 3)
    return Mesh(np.array(geometry.vertices(), dtype=np.float64), triangles)


def hull_mesh(points: Array) -> Mesh:
    """The surface of the convex hull of points; of points in a plane the points alone."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return Mesh(points, np.asarray(ConvexHull(points).simplices, dtype=np.intp))
    except QhullError:
        return Mesh(points, np.zeros((0, 3), dtype=np.intp))


def box_mesh(half: Array) -> Mesh:
    """A box of these half sides."""
    signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    faces = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]
    triangles = [corners for a, b, c, d in faces for corners in ((a, b, c), (a, c, d))]
    return Mesh(signs * half, np.array(triangles, dtype=np.intp))


def cylinder_mesh(radius: float, half: float) -> tuple[Mesh, float]:
    """(a prism of 32 sides around a cylinder about z, how far it stands out of it [m])."""
    sides = 32
    turn = 2 * np.pi * np.arange(sides) / sides
    outer = radius / np.cos(np.pi / sides)
    ring = outer * np.column_stack([np.cos(turn), np.sin(turn), np.zeros(sides)])
    k, after = np.arange(sides), (np.arange(sides) + 1) % sides
    lower, upper = np.stack([k, after, k + sides]), np.stack([after, k + sides, after + sides])
    bottom = np.stack([np.zeros(sides, dtype=np.intp), k, after])
    triangles = np.hstack([lower, upper, bottom, bottom + sides]).T.astype(np.intp)
    return Mesh(np.vstack([ring - [0.0, 0.0, half], ring + [0.0, 0.0, half]]), triangles), outer - radius


def spread_directions(n: int) -> Array:
    """n unit vectors, evenly spread (Fibonacci lattice)."""
    i = np.arange(n) + 0.5
    z = 1 - 2 * i / n
    turn = np.pi * (1 + np.sqrt(5.0)) * i
    flat = np.sqrt(1 - z**2)
    return np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])


def ellipsoid_mesh(radii: Array) -> tuple[Mesh, float]:
    """(a polyhedron around an ellipsoid, a bound of how far it stands out of it [m])."""
    from scipy.spatial import ConvexHull

    unit = spread_directions(400)
    hull = ConvexHull(unit)
    # Scaled so that the nearest facet touches the unit ball; an affine map keeps the polyhedron around the ellipsoid
    scale = 1.0 / float((-hull.equations[:, 3]).min())
    return Mesh(scale * unit * radii, np.asarray(hull.simplices, dtype=np.intp)), (scale - 1.0) * float(max(radii))
