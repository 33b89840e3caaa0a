"""Footholds on surfaces: where a foot finds room, how the surface lies there, and how rough it is."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, radians
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.clearance import CylinderInside, EndlessCylinder, TriangleMesh
from wbc.clearance.scene import Shape, Unbounded, patch_of
from wbc.climb.scene import Foothold
from wbc.errors import RangeError, ShapeError
from wbc.multibody import pin
from wbc.shapes import Cylinder, HalfSpace, HeightMap, Solid
from wbc.validation import Array

#: Faces of a surface that meet at less are one curved surface [rad]
SHARP = radians(25.0)
#: Triangles whose normals differ by less are one plane [rad]
COPLANAR = radians(0.05)
#: Footholds of neighbouring faces are no nearer than this share of the spacing
THINNED = 0.75
#: Places whose patches are looked at are no nearer than this share of it
CANDIDATES = 0.4
#: Facets round a cylinder without end
FACETS = 72


@dataclass(frozen=True)
class FootholdRules:
    """Which places of a surface are footholds.

    Attributes:
        spacing: between footholds of one face [m].
        edge: distance kept from where the surface ends and, unless a patch is asked for, faces meet sharply [m].
        max_slope: largest angle between normal and z of the world [rad].
        sole: radius of the patch that has to be even [m]; 0: not looked at.
        max_roughness: largest distance of the patch from the plane that fits it best [m].
        friction: of the footholds [1].
        extent: of surfaces without end, how far from their origin footholds are made [m].

    Raises:
        RangeError, ShapeError, NotFiniteError: a number that is none of these.
    """

    spacing: float = 0.1
    edge: float = 0.03
    max_slope: float = pi
    sole: float = 0.0
    max_roughness: float = 0.01
    friction: float = np.inf
    extent: float = 2.0

    def __post_init__(self) -> None:
        validation.own_scalars(self, "spacing", "extent", low=0.0, open_low=True, unit="m")
        validation.own_scalars(self, "edge", "sole", "max_roughness", low=0.0, unit="m")
        validation.own_scalars(self, "max_slope", low=0.0, high=pi, unit="rad")


def footholds_on(
    body: str, shape: Shape, placement: pin.SE3, rules: FootholdRules | None = None
) -> tuple[Foothold, ...]:
    """Footholds on the surface of a body, on a lattice of every plane face, thinned where faces are small.

    Their z is the outward normal (with ``sole`` that of the plane that fits the patch best), their x the direction on
    the surface nearest to the world's x, or y where x is nearly normal. Ids are the body's and a number.

    Args:
        body: its id in the scene. shape, placement: as of :class:`SceneBody`.

    Raises:
        ShapeError: a shape whose surface is not known.
    """
    given = FootholdRules() if rules is None else rules
    pose = validation.pose("placement", placement)
    triangles = _triangles(shape, given.extent) @ pose.rotation.T + pose.translation
    faces = _Faces.of(triangles)
    points, face = faces.lattice(given)
    if not len(points):
        return ()
    points, normals = _on_round(shape, pose, points, faces.normals[faces.first[face]])
    kept = normals[:, 2] >= cos(given.max_slope) - 1e-9
    if given.edge > 0.0:
        kept &= faces.from_edges(points, given.sole == 0.0) >= given.edge - 1e-9
    points, normals = points[kept], normals[kept]
    if given.sole > 0.0:
        few = _thinned(points, CANDIDATES * given.spacing)
        points, normals = points[few], normals[few]
        normals, rough = _fitted(triangles, points, normals, given.sole)
        points, normals = points[rough <= given.max_roughness], normals[rough <= given.max_roughness]
    chosen = _thinned(points, THINNED * given.spacing)
    return tuple(
        Foothold(f"{body} {k + 1}", frame_on(points[row], normals[row]), body, given.friction)
        for k, row in enumerate(chosen)
    )


def frame_on(point: Any, normal: Any) -> pin.SE3:
    """The frame at a point of a surface: z the normal, x nearest to the world's x, or y where x is nearly normal."""
    z = np.asarray(normal, dtype=np.float64)
    x = np.eye(3)[0] if abs(z[0]) < 0.9 else np.eye(3)[1]
    x = x - (x @ z) * z
    x = x / np.linalg.norm(x)
    return pin.SE3(np.column_stack([x, np.cross(z, x), z]), np.array(point, dtype=np.float64))


@dataclass(frozen=True, eq=False)
class _Faces:
    """Triangles, and the plane faces that they make.

    Attributes:
        triangles: [n, 3, 3]. normals: [n, 3]. face: of each triangle. first: a triangle of each face.
        borders: ends of edges where the surface ends, [m, 2, 3]. folds: of those where faces meet sharply.
    """

    triangles: Array
    normals: Array
    face: NDArray[np.intp]
    first: NDArray[np.intp]
    borders: Array
    folds: Array

    @classmethod
    def of(cls, triangles: Array) -> _Faces:
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import connected_components

        areas = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        size = np.linalg.norm(areas, axis=1)
        triangles = triangles[size > 1e-14]
        normals = areas[size > 1e-14] / size[size > 1e-14, None]
        scale = max(float(np.ptp(triangles.reshape(-1, 3), axis=0).max()), 1e-9)
        _, row = np.unique(np.round(triangles.reshape(-1, 3) / (1e-9 * scale)), axis=0, return_inverse=True)
        ring = row.reshape(-1, 3)
        ends = np.sort(np.concatenate([ring[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
        owner = np.tile(np.arange(len(triangles)), 3)
        order = np.lexsort(ends.T)
        ends, owner = ends[order], owner[order]
        start = np.flatnonzero(np.concatenate([[True], (ends[1:] != ends[:-1]).any(axis=1)]))
        count = np.diff(np.append(start, len(ends)))
        pairs = start[count == 2]
        one, other = owner[pairs], owner[pairs + 1]
        turn = (normals[one] * normals[other]).sum(axis=1)
        same = turn > cos(COPLANAR)
        number = len(triangles)
        graph = coo_matrix((np.ones(same.sum()), (one[same], other[same])), shape=(number, number))
        faces, face = connected_components(graph, directed=False)
        first = np.full(faces, number)
        np.minimum.at(first, face, np.arange(number))
        corner = np.zeros((ring.max() + 1, 3))
        corner[ring.ravel()] = triangles.reshape(-1, 3)
        borders, folds = corner[ends[start[count != 2]]], corner[ends[pairs[turn < cos(SHARP)]]]
        return cls(triangles, normals, face.astype(np.intp), first, borders, folds)

    def lattice(self, rules: FootholdRules) -> tuple[Array, NDArray[np.intp]]:
        """Points on the faces and the face of each; of a face without one its middle."""
        sides = np.linalg.norm(self.triangles - self.triangles[:, [1, 2, 0]], axis=2).max(axis=1)
        count, largest = np.bincount(self.face), np.zeros(len(self.first))
        np.maximum.at(largest, self.face, sides)
        # Most faces of a curved surface are one small triangle: its middle
        small = (count == 1) & (largest < rules.spacing)
        points = [self.triangles[self.first[small]].mean(axis=1)]
        owners = [np.flatnonzero(small)]
        order = np.argsort(self.face, kind="stable")
        for face, rows in enumerate(np.split(order, np.cumsum(count)[:-1])):
            normal = self.normals[self.first[face]]
            steep = normal[2] < cos(rules.max_slope) - 1e-9 and rules.sole == 0.0
            if small[face] or steep:
                continue
            frame = frame_on(self.triangles[rows[0], 0], normal)
            local = (self.triangles[rows] - frame.translation) @ frame.rotation
            found = _in_plane(local[:, :, :2], rules)
            points.append(np.column_stack([found, np.zeros(len(found))]) @ frame.rotation.T + frame.translation)
            owners.append(np.full(len(found), face))
        return np.concatenate(points), np.concatenate(owners)

    def from_edges(self, points: Array, folds: bool) -> Array:
        """Distance of points from the nearest border, or with ``folds`` also from where faces meet sharply [m]."""
        out = np.full(len(points), np.inf)
        for a, b in np.concatenate([self.borders, self.folds]) if folds else self.borders:
            span = b - a
            part = np.clip((points - a) @ span / max(float(span @ span), 1e-300), 0.0, 1.0)
            out = np.minimum(out, np.linalg.norm(points - a - part[:, None] * span, axis=1))
        return out


def _triangles(shape: Shape, extent: float) -> Array:
    """The surface, its corners counter-clockwise seen from outside."""
    if isinstance(shape, TriangleMesh):
        return shape.corners
    if isinstance(shape, Unbounded):
        low, high = ([-extent] * 2, [extent] * 2) if isinstance(shape, HalfSpace) else ([0, -extent], [2 * pi, extent])
        sides = patch_of(shape, low, high, FACETS)
        return sides if isinstance(shape, CylinderInside) else sides[:, ::-1]
    if isinstance(shape, HeightMap):
        rows, columns = shape.heights.shape
        return shape.triangles()[: 2 * (rows - 1) * (columns - 1), ::-1]
    if isinstance(shape, Solid):
        sides = shape.triangles()
        outwards = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
        inwards = ((sides.mean(axis=1) - shape.center) * outwards).sum(axis=1) < 0.0
        return np.where(inwards[:, None, None], sides[:, ::-1], sides)
    raise ShapeError("shape", shape, "no surface is known of this shape")


def _on_round(shape: Shape, pose: pin.SE3, points: Array, normals: Array) -> tuple[Array, Array]:
    """Points and normals of facets round a cylinder, brought onto the cylinder."""
    if not isinstance(shape, (Cylinder, EndlessCylinder, CylinderInside)):
        return points, normals
    local = (points - pose.translation) @ pose.rotation
    side = np.abs(normals @ pose.rotation[:, 2]) < 0.5
    across = local[:, :2] / np.maximum(np.linalg.norm(local[:, :2], axis=1, keepdims=True), 1e-12)
    local[side, :2] = shape.radius * across[side]
    outward = -1.0 if isinstance(shape, CylinderInside) else 1.0
    radial = np.column_stack([outward * across, np.zeros(len(points))]) @ pose.rotation.T
    return local @ pose.rotation.T + pose.translation, np.where(side[:, None], radial, normals)


def _in_plane(triangles: Array, rules: FootholdRules) -> Array:
    """Points of a lattice that are in one of some plane triangles ``(n, 3, 2)``; their middle where none is."""
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    axes = []
    for a, b in zip(low, high, strict=True):
        room = b - a - 2.0 * rules.edge
        count = max(1, int(room / rules.spacing + 1e-9) + 1)
        axes.append((a + b) / 2 + rules.spacing * (np.arange(count) - (count - 1) / 2))
    if len(axes[0]) * len(axes[1]) > 1_000_000:
        raise RangeError("spacing", rules.spacing, f"a face of {(high - low).tolist()} m has over a million footholds")
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    inside = np.zeros(len(grid), dtype=bool)
    for a, b, c in triangles:
        side = np.stack([_cross(p, q, grid) for p, q in ((a, b), (b, c), (c, a))])
        inside |= (side >= -1e-12).all(axis=0) | (side <= 1e-12).all(axis=0)
    if inside.any():
        return grid[inside]
    return np.asarray(triangles[len(triangles) // 2].mean(axis=0, keepdims=True))


def _cross(a: Array, b: Array, points: Array) -> Array:
    return np.asarray((b[0] - a[0]) * (points[:, 1] - a[1]) - (b[1] - a[1]) * (points[:, 0] - a[0]))


def _fitted(triangles: Array, points: Array, normals: Array, sole: float) -> tuple[Array, Array]:
    """Normals of the planes that fit the patches best, and the largest distance of the patches from them [m]."""
    from scipy.spatial import cKDTree

    cloud = np.concatenate([triangles.reshape(-1, 3), _middles(triangles, 0.8 * sole)])
    tree, out, rough = cKDTree(cloud), normals.copy(), np.zeros(len(points))
    for k, rows in enumerate(tree.query_ball_point(points, sole)):
        patch = np.vstack([cloud[rows], points[k]])
        centred = patch - patch.mean(axis=0)
        if len(patch) >= 4:
            axis = np.linalg.eigh(centred.T @ centred)[1][:, 0]
            out[k] = axis if axis @ normals[k] >= 0.0 else -axis
        rough[k] = float(np.abs(centred @ out[k]).max())
    return out, rough


def _middles(triangles: Array, step: float) -> Array:
    """Middles of triangles that are halved until no side is longer than a step."""
    parts, left = list[Array](), triangles
    for _ in range(24):
        sides = np.linalg.norm(left - left[:, [1, 2, 0]], axis=2)
        long = sides.max(axis=1) > step
        parts.append(left[~long])
        if not long.any():
            break
        k, left, sides = np.arange(int(long.sum())), left[long], sides[long]
        longest = sides.argmax(axis=1)
        a, b, c = (left[k, (longest + i) % 3] for i in range(3))
        middle = (a + b) / 2
        left = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return np.asarray(np.concatenate(parts).mean(axis=1))


def _thinned(points: Array, least: float) -> list[int]:
    """Rows of points that are no nearer to each other, in their order."""
    from scipy.spatial import cKDTree

    tree, free, out = cKDTree(points), np.ones(len(points), dtype=bool), list[int]()
    for row in range(len(points)):
        if free[row]:
            out.append(row)
            free[tree.query_ball_point(points[row], least * (1 - 1e-9))] = False
    return out
