"""Shapes in the memory of the kernel, and distances of many of them, or of many segments, in one call."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc.errors import CompileError
from wbc.native.kernel import kernel
from wbc.native.library import load_library
from wbc.shapes import Geometry
from wbc.validation import Array

#: Headers of the kernel, which the sensor of a tick, the sweep and the planner include
HEADERS = Path(__file__).parent / "native"


class ShapeNumbers(ctypes.Structure):
    """``shape_t`` of ``native/shapes.h``."""

    _fields_ = [
        ("kind", ctypes.c_int),
        ("count", ctypes.c_int),
        ("size", ctypes.c_double * 6),
        *((name, ctypes.c_void_p) for name in ("points", "tree", "box")),
    ]


class Tolerance(ctypes.Structure):
    """``tolerance_t`` of ``native/shapes.h``: how near shapes without their balls touch, what counts as equal, and
    how far a distance may be above what its normal proves where shapes are near contact [m].
    """

    _fields_ = [(name, ctypes.c_double) for name in ("touch", "tie", "trust")]

    @classmethod
    def of(cls, length: float) -> Tolerance:
        """Those of bodies of this size [m]."""
        return cls(1e-10 * length, 1e-9 * length, 1e-5 * length)


@functools.cache
def library() -> ctypes.PyDLL:
    """The compiled kernel.

    Raises:
        CompileError: it was not compiled ahead, and there is no compiler, or it fails; or it is of another layout.
    """
    # Loading a robot with shapes asks for it, and may not wait for a compiler
    return checked(load_library(kernel(HEADERS / "geometry.c", at_once=True)), wbc_shape_size=ShapeNumbers)


def checked(found: ctypes.PyDLL, **sizes: type[ctypes.Structure]) -> ctypes.PyDLL:
    """A library whose structures have the size of those here, by the functions that say so.

    Raises:
        CompileError: they have not.
    """
    for name, structure in sizes.items():
        size = getattr(found, name)
        size.restype = ctypes.c_longlong
        if size() != ctypes.sizeof(structure):
            raise CompileError(name, size(), f"expected {ctypes.sizeof(structure)} bytes")
    return found


class ShapeTable:
    """Shapes as the kernel reads them; their numbers live as long as this.

    Args:
        begun: a table that has some of them already, whose numbers are taken over.

    Attributes:
        address: of the first one.
    """

    def __init__(self, shapes: Sequence[Geometry], begun: ShapeTable | None = None) -> None:
        self._rows, self._kept = (ShapeNumbers * max(1, len(shapes)))(), list[object]([begun])
        self._known: dict[int, ShapeNumbers] = {} if begun is None else dict(begun._known)
        for k, shape in enumerate(shapes):
            # The same mesh in many places is stored once
            if id(shape) not in self._known:
                self._known[id(shape)] = self._numbers(shape)
                self._kept.append(shape)
            self._rows[k] = self._known[id(shape)]
        self.address = ctypes.addressof(self._rows)

    def _numbers(self, shape: Geometry) -> ShapeNumbers:
        stored = shape.stored()
        points, box = (np.ascontiguousarray(array, dtype=np.float64) for array in (stored.points, stored.box))
        tree = np.ascontiguousarray(stored.tree, dtype=np.int32)
        self._kept += [points, box, tree]
        size = (ctypes.c_double * 6)(*shape.sizes, shape.reach)
        at = (array.ctypes.data for array in (points, tree, box))
        return ShapeNumbers(int(shape.kind), stored.count, size, *at)


def distances(
    table: ShapeTable, poses: Array, first: NDArray[np.intp], second: NDArray[np.intp], length: float = 1.0
) -> Array:
    """Signed distance [m], normal from the first to the second, and point of the first of n pairs of shapes, [n, 7].

    Args:
        poses: of the shapes' centres in the world, [shapes, 12]: rotation row by row, then position [m].
        first, second: their numbers in the table; one of each pair is convex and of finite size.
        length: of which tolerances are parts [m].

    Raises:
        CompileError: as of :func:`library`.
    """
    out, how = np.empty((len(first), 7)), Tolerance.of(length)
    at, one, other = np.ascontiguousarray(poses, dtype=np.float64), _integers(first), _integers(second)
    shapes, count = ctypes.c_void_p(table.address), ctypes.c_long(len(out))
    library().wbc_distances(ctypes.byref(how), shapes, _at(at), count, _at(one), _at(other), _at(out))
    return out


def segment_distances(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Distance [m] of the segments a b and c d, ``[..., 3]`` each.

    Raises:
        CompileError: as of :func:`library`.
    """
    given = [np.ascontiguousarray(x, dtype=np.float64) for x in np.broadcast_arrays(a, b, c, d)]
    out = np.empty(given[0].shape[:-1])
    library().wbc_segment_distances(ctypes.c_long(out.size), *map(_at, (*given, out)))
    return out


def segments_from(shape: Geometry, a: Array, b: Array) -> Array:
    """Signed distance [m] of the segments from ``a`` to ``b``, ``[..., 3]`` each in a shape's frame, from the shape.

    Raises:
        CompileError: as of :func:`library`.
    """
    given = [np.ascontiguousarray(x - shape.center, dtype=np.float64) for x in np.broadcast_arrays(a, b)]
    out, table, how = np.empty(given[0].shape[:-1]), ShapeTable([shape]), Tolerance.of(1.0)
    library().wbc_segments_from(
        ctypes.byref(how), ctypes.c_void_p(table.address), ctypes.c_long(out.size), *map(_at, (*given, out))
    )
    return out


def _integers(numbers: NDArray[np.intp]) -> NDArray[np.int32]:
    return np.ascontiguousarray(numbers, dtype=np.int32)


def _at(array: NDArray[Any]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
