"""The planner in C: trees, projections and shorter paths, a call for some samples at a time."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from wbc.clearance.native import SOURCES as SWEEP, NativeSweep
from wbc.errors import RangeError
from wbc.geometry.kernel import HEADERS, checked
from wbc.native.kernel import kernel
from wbc.native.library import load_library
from wbc.plan.rows import PlanningRows
from wbc.plan.scene import OPEN, PlanningScene
from wbc.validation import Array

_SOURCES = Path(__file__).parent / "native"
#: Nodes of a tree at most
NODES = 200_000
#: Points of a path at most
POINTS = 20_000
#: What :meth:`NativePlanner.grow` ends with when the trees are full
FULL = -1
#: Places that are looked at together
LANES = 8
#: Numbers that an ``outline_t`` takes the room of
_OUTLINE = 6
#: Numbers of the motion of a core: ``WAYS`` of ``native/plan.h``
_WAYS = 11
#: Pairs that were too near last and are looked at first
RECENT = 3


class _KeptRows(ctypes.Structure):
    """``kept_rows_t`` of ``native/plan.h``."""

    _fields_ = [
        ("function", ctypes.c_void_p),
        ("equalities", ctypes.c_int),
        ("margins", ctypes.c_int),
        *((name, ctypes.c_void_p) for name in ("p", "value", "slope", "w", "iw")),
    ]


class _PlanStruct(ctypes.Structure):
    """``plan_t`` of ``native/plan.h``."""

    _fields_ = [
        *((name, ctypes.c_void_p) for name in ("sweep", "gone", "normals")),
        ("open", ctypes.c_double),
        *((name, ctypes.c_void_p) for name in ("boxes", "reaches", "offs", "lane_pose", "lane_centre", "lane_ends")),
        *((name, ctypes.c_void_p) for name in ("lane_ways", "lane_stamp", "outlines")),
        ("recent", ctypes.c_int * RECENT),
        *((name, ctypes.c_void_p) for name in ("low", "high", "sample_low", "sample_high", "weight", "scale")),
        *((name, ctypes.c_int) for name in ("n", "pairs", "capacity", "seeds")),
        ("count", ctypes.c_int * 2),
        *((name, ctypes.c_double) for name in ("range", "step", "tolerance", "drift", "near_enough", "longest")),
        ("random", ctypes.c_ulonglong),
        ("path", _KeptRows),
        ("goal", _KeptRows),
        ("node", ctypes.c_void_p * 2),
        ("lanes", ctypes.c_void_p * 2),
        ("domain", ctypes.c_void_p * 2),
        ("parent", ctypes.c_void_p * 2),
        ("work", ctypes.c_void_p),
        ("meet", ctypes.c_int * 2),
        ("heading", ctypes.c_double),
        *((name, ctypes.c_int) for name in ("rolls", "struck", "counts", "alive", "lane_node", "lane")),
    ]


class _Contiguous:
    """An argument type: an array as contiguous numbers, which a function may write where it is that already."""

    @classmethod
    def from_param(cls, array: Array) -> Any:
        return np.ascontiguousarray(array).ctypes


@functools.cache
def library() -> ctypes.CDLL:
    """The compiled code.

    Raises:
        CompileError: as of :func:`wbc.geometry.kernel.library`.
    """
    held = checked(load_library(kernel(_SOURCES / "plan.c", SWEEP, HEADERS)), wbc_plan_size=_PlanStruct)
    # Other threads run meanwhile
    found = ctypes.CDLL(held._name, handle=held._handle)
    place, number = _Contiguous, ctypes.c_int
    kinds: dict[str, Sequence[object]] = {
        "prepare": (), "free": (place,), "margin": (place,), "edge": (place, place),
        "walk": (place, place, place, number), "project": (place,),
        "broken": (place,), "reach": (place,), "draw": (place,), "root": (number, place),
        "away": (place, ctypes.c_double, ctypes.c_double), "grow": (number,), "path": (place, number),
        "shorten": (place, number, number, number, number, place, number), "length": (place, number),
    }  # fmt: skip
    for name, arguments in kinds.items():
        getattr(found, f"wbc_plan_{name}").argtypes = [ctypes.c_void_p, *arguments]
    for name in ("away", "broken", "length", "margin"):
        getattr(found, f"wbc_plan_{name}").restype = ctypes.c_double
    return found


class NativePlanner:
    """A scene, its rows and two trees in memory.

    Attributes:
        scene: whose pairs are kept apart. path_rows: of every configuration of a path.
        low, high: limits of x. sample_low, sample_high: where samples are drawn.
    """

    def __init__(self, scene: PlanningScene, rows: PlanningRows, p: Array, limits: tuple[Array, Array]) -> None:
        coordinates = scene.coordinates
        n = coordinates.count
        self.scene, self.path_rows, self._call = scene, rows, library()
        self.low, self.high, self.sample_low, self.sample_high = (side.copy() for side in (*limits, *limits))
        self.bounded = bool(np.isfinite(limits).all())
        self._p, self._scale, self._weight = p, 1.0 / coordinates.scale, coordinates.scale**-2.0
        self._struct = it = _PlanStruct(
            n=n, capacity=NODES, range=1.0, step=0.1, tolerance=1e-8, drift=1e-3, longest=np.inf
        )
        if (rolling := coordinates.rolling) is not None:
            it.rolls, it.heading = 1 + (rolling.heading is None), rolling.heading or 0.0
        self._trees: dict[str, list[Any]] = {
            name: [np.empty((NODES, n)) for _ in range(2)] for name in ("node", "lanes")
        }
        self._trees["domain"] = [np.empty(NODES) for _ in range(2)]
        self._trees["parent"] = [np.empty(NODES, dtype=np.int32) for _ in range(2)]
        self._points, self._others = np.empty((POINTS, n)), np.empty((POINTS, n))
        for both in (*self._trees.values(), [self._points, self._others]):
            for array in both:
                array[:1] = 0  # The system gives memory where it is first written: not within a query
        for name in ("low", "high", "sample_low", "sample_high", "_weight", "_scale"):
            setattr(it, name.strip("_"), getattr(self, name).ctypes.data)
        for name, pair in self._trees.items():
            getattr(it, name)[:] = [array.ctypes.data for array in pair]
        self._kept: dict[str, list[Array]] = {}
        self.use("path", rows)
        self.use("goal", rows)
        swept = scene.swept()
        self._required = swept.required - OPEN
        self._sweep = NativeSweep(swept)
        bodies, pairs, frames = len(scene.bodies), len(scene.pairs), len(coordinates.tree.frames)
        it.sweep, it.pairs = self._sweep.address, pairs
        depth = max([1, *(len(chain) for chain in swept.chain)])
        self._arrays: dict[str, Array] = {
            "gone": np.zeros((frames, LANES)), "normals": np.zeros((pairs, 3)),
            "boxes": np.zeros((bodies, 15)),
            "reaches": np.zeros((bodies, depth)), "offs": np.zeros((bodies, depth + 1, LANES)),
            "lane_pose": np.zeros((frames, 12, LANES)), "lane_centre": np.zeros((bodies, 3, LANES)),
            "lane_ends": np.zeros((bodies, 6, LANES)), "lane_ways": np.zeros((bodies, depth + 1, _WAYS, LANES)),
            "lane_stamp": np.zeros(bodies, dtype=np.int32), "outlines": np.zeros((pairs, _OUTLINE)),
        }  # fmt: skip
        for name, array in self._arrays.items():
            setattr(it, name, array.ctypes.data)
        self.at = ctypes.c_void_p(ctypes.addressof(it))
        self._margins = dict[bytes, float]()
        self._call.wbc_plan_prepare(self.at)
        self.pad(0.0)

    def limit(self, low: Array, high: Array) -> None:
        """Other limits of x, within the first ones."""
        self.low[:] = self.sample_low[:] = low
        self.high[:] = self.sample_high[:] = high
        self._call.wbc_plan_prepare(self.at)

    def use(self, name: str, rows: PlanningRows) -> None:
        """Other rows of the goal, or of the path."""
        address, integers, reals = rows.compiled
        n, m = self.scene.coordinates.count, max(rows.count, self.path_rows.count)
        arrays = [np.zeros(max(1, size)) for size in (rows.count, rows.count * n, reals)]
        self._kept[name] = arrays = [*arrays, np.zeros(max(1, integers), dtype=np.int64)]
        pointers = [self._p.ctypes.data, *(array.ctypes.data for array in arrays)]
        setattr(self._struct, name, _KeptRows(address, rows.equalities, rows.margins, *pointers))
        self._work = np.zeros(m * n + m * m + 2 * m + 2 * n + 8)
        self._struct.work = self._work.ctypes.data

    def pad(self, pad: float) -> None:
        """Distances are kept longer by ``pad`` [m], which spares looking closely at what is nearly too near."""
        self._sweep.require(self._required + pad)
        # Proven is what is required without the pad
        self._struct.open = pad
        self._margins.clear()

    def set(self, **numbers: float) -> None:
        """Numbers of ``native/plan.h``: range, step, tolerance, drift, near_enough, longest."""
        for name, value in numbers.items():
            setattr(self._struct, name, value)

    def begin(self, seed: int) -> None:
        """Empty trees, and another stream of samples."""
        it = self._struct
        it.count[0] = it.count[1] = it.seeds = 0
        it.longest = np.inf
        # What was learnt before must not change what is found now
        self._arrays["normals"][:] = 0.0
        it.recent[:] = [-1] * RECENT
        it.random = (seed * 0x9E3779B97F4A7C15 + 0x1234567) & (2**64 - 1) or 1

    def root(self, tree: int, x: Array) -> None:
        """A root of the tree from the start, 0, or from the goals, 1."""
        self._call.wbc_plan_root(self.at, tree, x)

    def free(self, x: Array) -> bool:
        """Whether x is within limits, keeps the rows and is clear."""
        return bool(self._call.wbc_plan_free(self.at, x))

    def margin(self, x: Array) -> float:
        """The least distance of a pair at x, less what it keeps [m]; infinite where there is no pair."""
        key = x.tobytes()
        if key not in self._margins:
            self._margins[key] = float(self._call.wbc_plan_margin(self.at, x))
        return float(self._margins[key] + self._struct.open - OPEN)

    def away(self, x: Array, room: float) -> Array:
        """A configuration near x that has ``room`` [m] on all sides, and is reached from it straight; x where it has
        that room, or where there is none.
        """
        out = np.array(x, dtype=np.float64)
        self.margin(x)
        before = self._margins[x.tobytes()]
        margin = self._call.wbc_plan_away(self.at, out, room - self._struct.open, before)
        self._margins[out.tobytes()] = margin
        return x if (out == x).all() else out

    def edge(self, x: Array, y: Array) -> bool:
        """Whether what is straight between two free configurations is free."""
        return bool(self._call.wbc_plan_edge(self.at, x, y))

    def way(self, x: Array, y: Array) -> Array:
        """What leads straight, or by the pieces of a base that rolls, from x to y [points, n]; x alone: not free."""
        count = self._call.wbc_plan_walk(self.at, x, y, self._points, POINTS)
        return np.concatenate([x[None], self._points[:count]])

    def projected(self, x: Array) -> Array | None:
        """The nearest configuration that keeps the rows of the path; None: not found."""
        out = np.array(x, dtype=np.float64)
        return out if self._call.wbc_plan_project(self.at, out) else None

    def broken(self, x: Array) -> float:
        """How far rows of the path are broken at x at most."""
        return float(self._call.wbc_plan_broken(self.at, x))

    def reach(self, x: Array) -> tuple[int, Array]:
        """(0: goals are not met; 1: met, but not free; 2: free; the configuration), by a descent from x."""
        out = np.array(x, dtype=np.float64)
        return int(self._call.wbc_plan_reach(self.at, out)), out

    def drawn(self) -> Array:
        """A sample."""
        out = np.empty(len(self.low))
        self._call.wbc_plan_draw(self.at, out)
        return out

    def grow(self, samples: int) -> int:
        """Trees with more samples: 1: they met; 0: not yet; :data:`FULL`."""
        return int(self._call.wbc_plan_grow(self.at, samples))

    def path(self) -> Array:
        """The path through where the trees met, [points, n]."""
        count = self._call.wbc_plan_path(self.at, self._points, POINTS)
        if count < 0:
            raise RangeError("path", POINTS, "a path of more points than there is room for")
        return self._points[:count].copy()

    def shortened(self, points: Array, cuts: int, rounds: int) -> Array:
        """A path that is no longer: after so many tries of cuts, and rounds in which corners are pulled in."""
        self._points[: len(points)] = points
        arguments = (self._points, len(points), POINTS, cuts, rounds, self._others, POINTS)
        return self._points[: self._call.wbc_plan_shorten(self.at, *arguments)].copy()

    def length(self, points: Array) -> float:
        """Sum of the distances of points."""
        return float(self._call.wbc_plan_length(self.at, points, len(points)))

    @property
    def nodes(self) -> tuple[int, int]:
        """Of both trees."""
        return int(self._struct.count[0]), int(self._struct.count[1])

    def node(self, tree: int) -> Array:
        """All nodes of a tree."""
        nodes: Array = self._trees["node"][tree]
        return nodes[: self._struct.count[tree]]
