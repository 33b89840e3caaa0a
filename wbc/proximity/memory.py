"""Results of many pairs as numpy arrays, without a Python object a pair.

``pinocchio.computeDistances`` writes into a C++ vector of results. Reading them one by one through the bindings costs
1 us a pair, several times what a distance of primitives costs. The bindings do give numpy views of the normals; since
elements of a vector are equally spaced, one strided array shows them all. Where the distance and the witness point
lie next to the normal is found by experiment, on results that both ways of reading must agree on; where the experiment
fails, :class:`Results` reads through the bindings.
"""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Sequence
from typing import Any

import numpy as np

# isort: split
import pinocchio as pin

# isort: split
import coal
from numpy.typing import NDArray

from wbc.validation import Array

#: Numbers of pairs or bodies
Index = NDArray[np.intp]

WORD = 8


class Results:
    """Distances of all pairs of a geometry model but the first and the last, which only pad the vector.

    Attributes:
        numbers: one array that holds the results of all pairs; of pair k from ``start[k]`` on the unit normal from the
            first to the second body, from ``start[k] + place`` the witness on the first body in the world [m], and at
            ``start[k] + gap`` the signed distance [m].
        distance, normal, point: views of the same, n, n x 3, n x 3.
    """

    def __init__(self, data: pin.GeometryData, offsets: tuple[int, int] | None) -> None:
        # Held: the numbers may be views of its memory
        self._data = data
        count = len(data.distanceResults) - 2
        self._results = [data.distanceResults[k] for k in range(1, count + 1)]
        words = _memory_of([r.normal for r in data.distanceResults])
        self._direct = offsets is not None and words is not None
        if offsets is not None and words is not None:
            self.numbers, width = words
            self.gap, self.place = offsets
        else:
            width, self.gap, self.place = 7, 6, 3
            self.numbers = np.zeros(width * (count + 1))
        self.start: Index = width * np.arange(1, count + 1)
        self.distance = _rows(self.numbers, width, self.gap, count, 1)[:, 0]
        self.normal = _rows(self.numbers, width, 0, count, 3)
        self.point = _rows(self.numbers, width, self.place, count, 3)

    def refresh(self, which: Index) -> None:
        """Bring the numbers up to date for some pairs; nothing to do where they are the memory itself."""
        if self._direct:
            return
        for k in which.tolist():
            result = self._results[k]
            self.distance[k], self.normal[k] = result.min_distance, result.normal
            self.point[k] = result.getNearestPoint1()


def strided(views: Sequence[Array]) -> Array | None:
    """One array that shows all views, which lie equally spaced in memory; None where they do not."""
    addresses = np.array([v.__array_interface__["data"][0] for v in views], dtype=np.int64)
    steps = np.diff(addresses)
    if any(v.flags.owndata for v in views) or len(set(steps.tolist())) > 1:
        return None
    step = int(steps[0]) if len(steps) else 0
    out = np.lib.stride_tricks.as_strided(
        views[0], shape=(len(views), *views[0].shape), strides=(step, *views[0].strides)
    )
    return np.asarray(out)


def poses(placements: Sequence[pin.SE3]) -> Array | None:
    """Rotations (column by column) and translations of poses as one array, n x 12, that shows their memory; None where
    they do not lie equally spaced.
    """
    if not len(placements):
        return None
    rotations = [p.rotation.T for p in placements]
    turned = strided([r.reshape(9) for r in rotations])
    moved = strided([p.translation for p in placements])
    if turned is None or moved is None:
        return None
    starts = [a.__array_interface__["data"][0] for a in (turned, moved)]
    if starts[1] - starts[0] != 9 * WORD or turned.strides[0] != moved.strides[0]:
        return None
    out = np.lib.stride_tricks.as_strided(turned, shape=(len(placements), 12), strides=(turned.strides[0], WORD))
    return np.asarray(out)


@functools.cache
def offsets() -> tuple[int, int] | None:
    """Where distance and first witness lie, in words from the normal; None if that cannot be told."""
    model = pin.GeometryModel()
    for k in range(10):
        place = pin.SE3(np.eye(3), np.array([1.1 * k, 0.3 * k * k, 0.7 * k]))
        model.addGeometryObject(pin.GeometryObject(f"{k}", 0, place, coal.Sphere(0.1 + 0.01 * k)))
    for k in range(5):
        model.collisionPairs.append(pin.CollisionPair(2 * k, 2 * k + 1))
    data = model.createData()
    robot = pin.Model()
    pin.updateGeometryPlacements(robot, robot.createData(), model, data, np.zeros(0))
    pin.computeDistances(model, data)
    results = [data.distanceResults[k] for k in range(1, 4)]
    words = _memory_of([r.normal for r in data.distanceResults])
    if words is None:
        return None
    flat, width = words
    distance = _find(flat, width, np.array([[r.min_distance] for r in results]))
    point = _find(flat, width, np.array([r.getNearestPoint1() for r in results]))
    return None if distance is None or point is None else (distance, point)


def _memory_of(normals: Sequence[Any]) -> tuple[Array, int] | None:
    """(all numbers of a vector's elements from the first normal to the last, numbers an element)."""
    if strided(normals) is None or len(normals) < 3:
        return None
    first, second, last = (normals[k].__array_interface__["data"][0] for k in (0, 1, -1))
    if (second - first) % WORD or second <= first:
        return None
    memory = (ctypes.c_char * (last - first)).from_address(first)
    return np.frombuffer(memory, dtype=np.float64), (second - first) // WORD


def _rows(flat: Array, width: int, offset: int, count: int, size: int) -> Array:
    """``size`` numbers at ``offset`` from the normals of elements 1 to ``count``."""
    start = flat[width + offset :]
    return np.lib.stride_tricks.as_strided(start, shape=(count, size), strides=(width * WORD, WORD))


def _find(flat: Array, width: int, wanted: Array) -> int | None:
    """The only offset within an element's length at which the wanted rows stand."""
    count, size = wanted.shape
    found = [o for o in range(-width, width - size + 1) if np.array_equal(_rows(flat, width, o, count, size), wanted)]
    return found[0] if len(found) == 1 else None
