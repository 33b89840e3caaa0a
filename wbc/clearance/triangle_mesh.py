"""Surfaces of triangles."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import ShapeError
from wbc.geometry import segments_from
from wbc.robot.geometry.meshes import read_mesh
from wbc.shapes import Geometry
from wbc.shapes.convex import LANES
from wbc.shapes.solid import Kind, Stored
from wbc.validation import Array

#: Triangles of a leaf of a tree of boxes
LEAF = 4


@dataclass(frozen=True, eq=False)
class TriangleMesh(Geometry):
    """A surface of triangles.

    Where the core of a body (of a capsule its segment) goes through the surface, the distance is what the ball on the
    core gives, -radius. A body whose core is wholly within a solid is as deep in it as its farthest point is below the
    surface next to the core.

    Attributes:
        corners: [n, 3, 3] m.
        solid: the surface is closed and its corners go round it one way, so that it has an inside; else it is a sheet,
            and what begins behind it is not seen.

    Raises:
        ShapeError, NotFiniteError: not n x 3 x 3 finite numbers; a solid whose surface is open or turns over.
    """

    corners: Array
    solid: bool = False

    kind = Kind.MESH

    def __post_init__(self) -> None:
        corners = validation.real_array("TriangleMesh.corners", self.corners)
        if corners.ndim != 3 or corners.shape[1:] != (3, 3) or not len(corners):
            raise ShapeError("TriangleMesh.corners", np.shape(self.corners), "expected n x 3 x 3, n at least 1")
        object.__setattr__(self, "corners", corners)
        object.__setattr__(self, "solid", validation.flag("TriangleMesh.solid", self.solid))
        if self.solid:
            _, row = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
            ring = row.reshape(-1, 3)
            edges = np.concatenate([ring[:, [k, (k + 1) % 3]] for k in range(3)])
            edges = edges[edges[:, 0] != edges[:, 1]]
            one, other = (np.unique(edges[:, order], axis=0) for order in ([0, 1], [1, 0]))
            if len(one) != len(edges) or not np.array_equal(one, other):
                raise ShapeError("TriangleMesh.solid", True, "the surface is open, or its triangles turn over")

    @classmethod
    def read(cls, path: str | os.PathLike[str], scale: float = 1.0, solid: bool = True) -> TriangleMesh:
        """The surface in a file (STL, OBJ, DAE), its lengths times ``scale``.

        Raises:
            RobotFileError: a file that cannot be read. RangeError: no scale. ShapeError: as of the class.
        """
        factor = validation.scalar("scale", scale, low=0.0, open_low=True)
        mesh = read_mesh(validation.file_path("path", path), np.full(3, factor))
        return cls(mesh.vertices[mesh.triangles], solid)

    def distance(self, points: Array) -> Array:
        """Distance [m] of points ``[..., 3]`` in the surface's frame; within a solid it is negative."""
        return segments_from(self, points, points)

    @property
    def reach(self) -> float:
        return float(np.linalg.norm(self.corners, axis=2).max())

    def stored(self) -> Stored:
        return self._stored

    @cached_property
    def _stored(self) -> Stored:
        tree, box, order = list[list[int]](), list[Array](), list[int]()
        _grow(self.corners, np.arange(len(self.corners)), tree, box, order)
        filled = np.concatenate([self.corners, np.repeat(self.corners[:, -1:], LANES - 3, axis=1)], axis=1)
        points = filled[order].transpose(0, 2, 1).ravel()
        count = len(self.corners) if self.solid else 0
        return Stored(count, points, np.array(tree, dtype=np.int32), np.array(box))

    def capsule(self) -> tuple[Array, Array, float]:
        """(end, end, radius) of a ball that contains the surface [m]."""
        points = self.corners.reshape(-1, 3)
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        return middle, middle, float(np.linalg.norm(points - middle, axis=1).max())


def _grow(corners: Array, rows: NDArray[np.intp], tree: list[list[int]], box: list[Array], order: list[int]) -> int:
    """A tree of boxes over some triangles, halved across the longest side; returns the number of its root."""
    mine, here = corners[rows], len(tree)
    low, high = mine.min(axis=(0, 1)), mine.max(axis=(0, 1))
    tree.append([0, 0])
    box.append(np.concatenate([low, high]))
    if len(rows) <= LEAF:
        tree[here] = [-1 - len(order), -len(order) - len(rows)]
        order += rows.tolist()
        return here
    along = np.argsort(mine.mean(axis=1)[:, int(np.argmax(high - low))])
    half = len(rows) // 2
    tree[here] = [_grow(corners, rows[along[k]], tree, box, order) for k in (slice(half), slice(half, None))]
    return here
