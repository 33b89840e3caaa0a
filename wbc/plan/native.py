"""The planner in C: trees, projections and shorter paths, a call for some samples at a time."""

from __future__ import annotations

import ctypes
import functools
from pathlib import Path

import numpy as np

from wbc.clearance.blocks import in_blocks
from wbc.clearance.native import SOURCES as SWEEP, NativeSweep
from wbc.errors import RangeError
from wbc.geometry.kernel import HEADERS, checked
from wbc.native.kernel import kernel
from wbc.native.library import load_library
from wbc.native.structures import CStructures
from wbc.plan.rows import PlanningRows
from wbc.plan.scene import OPEN, PlanningScene
from wbc.validation import Array

_SOURCES = Path(__file__).parent / "native"
_HEADER = CStructures(_SOURCES / "plan.h")
_PlanStruct, _OutlineStruct = _HEADER.structure("plan_t"), _HEADER.structure("outline_t")
#: Nodes of a tree at most
NODES = 200_000
#: Points of a path at most
POINTS = 20_000
#: Places that are looked at together
LANES = 8


@functools.cache
def library() -> ctypes.CDLL:
    """The compiled code.

    Raises:
        CompileError: as of :func:`wbc.geometry.kernel.library`.
    """
    held = checked(load_library(kernel(_SOURCES / "plan.c", SWEEP, HEADERS)), wbc_plan_size=_PlanStruct)
    # Other threads run meanwhile
    found = ctypes.CDLL(held._name, handle=held._handle)
    found.wbc_plan_away.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_double, ctypes.c_double]
    for name in ("away", "broken", "length", "margin"):
        getattr(found, f"wbc_plan_{name}").restype = ctypes.c_double
    return found


def _address(array: Array) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


class NativePlanner:
    """A scene, its rows and two trees in memory.

    Attributes:
        scene: whose pairs are kept apart. path_rows: of every configuration of a path.
        low, high: limits of x. sample_low, sample_high: where samples are drawn.
        period: x and x + period are one configuration; 0: no others are.
    """

    def __init__(self, scene: PlanningScene, rows: PlanningRows, p: Array, limits: tuple[Array, Array]) -> None:
        coordinates = scene.coordinates
        swept, block_end = in_blocks(coordinates.tree, scene.bodies, scene.pairs)
        n, bodies, pairs, frames = coordinates.count, len(swept.bodies), len(scene.pairs), len(coordinates.tree.frames)
        self.scene, self.path_rows, self._p, self._call = scene, rows, p, library()
        self.low, self.high, self.sample_low, self.sample_high = (side.copy() for side in (*limits, *limits))
        self.period = np.zeros(n)
        self.bounded = bool(np.isfinite(limits).all())
        self._sweep, self._required = NativeSweep(swept), swept.required - OPEN
        self._struct = it = _PlanStruct(
            n=n, capacity=NODES, range=1.0, step=0.1, tolerance=1e-8, drift=1e-3, longest=np.inf,
            sweep=self._sweep.address, pairs=pairs, blocks=len(block_end),
        )  # fmt: skip
        if (rolling := coordinates.rolling) is not None:
            it.rolls, it.heading = 1 + (rolling.heading is None), rolling.heading or 0.0
        depth, ways = max([1, *(len(chain) for chain in swept.chain)]), _HEADER.constants["WAYS"]
        self._normals, outline = np.zeros((pairs, 3)), ctypes.sizeof(_OutlineStruct)
        self._arrays: dict[str, Array] = {
            "low": self.low, "high": self.high, "sample_low": self.sample_low, "sample_high": self.sample_high,
            "scale": 1.0 / coordinates.scale, "weight": coordinates.scale**-2.0, "period": self.period,
            "gone": np.zeros((frames, LANES)), "normals": self._normals, "boxes": np.zeros((bodies, 15)),
            "reaches": np.zeros((bodies, depth)), "offs": np.zeros((bodies, depth + 1, LANES)),
            "lane_pose": np.zeros((frames, 12, LANES)), "lane_centre": np.zeros((bodies, 3, LANES)),
            "lane_ends": np.zeros((bodies, 6, LANES)), "lane_ways": np.zeros((bodies, depth + 1, ways, LANES)),
            "lane_stamp": np.zeros(bodies, dtype=np.int32), "ball_stamp": np.zeros(bodies, dtype=np.int32),
            "outlines": np.zeros(len(swept.pairs) * outline, dtype=np.uint8), "block_end": block_end,
        }  # fmt: skip
        for name, array in self._arrays.items():
            setattr(it, name, array.ctypes.data)
        self._trees: dict[str, Array] = {
            "node": np.empty((2, NODES, n)), "lanes": np.empty((2, NODES, n)),
            "domain": np.empty((2, NODES)), "parent": np.empty((2, NODES), dtype=np.int32),
        }  # fmt: skip
        for name, trees in self._trees.items():
            getattr(it, name)[:] = [tree.ctypes.data for tree in trees]
        self._points, self._others = room = np.empty((2, POINTS, n))
        for pair in (*self._trees.values(), room):
            pair[:, :500] = 0  # The system gives memory where it is first written: not within a query
        self._ends, self._none = np.empty((2, n)), [-1] * len(it.recent)
        self._x, self._y = self._ends
        self._at_x, self._at_y, self._at_points = map(_address, (self._x, self._y, self._points))
        self._kept: dict[str, list[Array]] = {}
        self.use("path", rows)
        self.use("goal", rows)
        self.at = ctypes.c_void_p(ctypes.addressof(it))
        self._margins = dict[bytes, float]()
        self._call.wbc_plan_prepare(self.at)
        self._sweep.require(self._required)

    def limit(self, low: Array, high: Array) -> None:
        """Other limits of x, within the first ones."""
        self.low[:] = self.sample_low[:] = low
        self.high[:] = self.sample_high[:] = high
        self._call.wbc_plan_prepare(self.at)

    def use(self, name: str, rows: PlanningRows) -> None:
        """Other rows of the goal, or of the path."""
        code, n, m = rows.compiled, len(self.low), max(rows.count, self.path_rows.count)
        arrays = [np.zeros(max(1, size)) for size in (rows.count, rows.count * n, code.reals)]
        self._kept[name] = arrays = [self._p, *arrays, np.zeros(max(1, code.integers), dtype=np.int64)]
        addresses = [array.ctypes.data for array in arrays]
        kept = _HEADER.structure("kept_rows_t")(code.address, rows.equalities, rows.margins, *addresses)
        setattr(self._struct, name, kept)
        self._work = np.zeros(m * n + m * m + 2 * m + 2 * n + 8)
        self._struct.work = self._work.ctypes.data

    def pad(self, pad: float) -> None:
        """Distances are kept longer by ``pad`` [m], which spares looking closely at what is nearly too near."""
        if pad == self._struct.open:
            return
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
        self._normals.fill(0.0)
        it.recent[:] = self._none
        self._margins.clear()
        it.random = (seed * 0x9E3779B97F4A7C15 + 0x1234567) & (2**64 - 1) or 1

    def root(self, tree: int, x: Array) -> None:
        """A root of the tree from the start, 0, or from the goals, 1."""
        self._x[:] = x
        self._call.wbc_plan_root(self.at, tree, self._at_x)

    def go_round(self, rounds: bool) -> None:
        """Whether joints without end turn either way to a configuration, else the short one."""
        free = [k for k in self.scene.coordinates.circles if np.isinf(self.low[k]) and self._arrays["weight"][k] > 0.0]
        self.period[free] = 2.0 * np.pi if rounds else 0.0

    def free(self, x: Array) -> bool:
        """Whether x is within limits, keeps the rows and is clear."""
        self._x[:] = x
        return bool(self._call.wbc_plan_free(self.at, self._at_x))

    def margin(self, x: Array) -> float:
        """The least distance of a pair at x, less what it keeps [m]; infinite where there is no pair."""
        key = x.tobytes()
        if key not in self._margins:
            self._x[:] = x
            self._margins[key] = self._call.wbc_plan_margin(self.at, self._at_x)
        return float(self._margins[key] + self._struct.open - OPEN)

    def away(self, x: Array, room: float) -> Array:
        """A configuration near x that has ``room`` [m] on all sides, and is reached from it straight; x where it has
        that room, or where there is none.
        """
        self.margin(x)
        before = self._margins[x.tobytes()]
        if before >= room - self._struct.open:
            return x
        self._x[:] = x
        self._margins[self._x.tobytes()] = self._call.wbc_plan_away(
            self.at, self._at_x, room - self._struct.open, before
        )
        return x if (self._x == x).all() else self._x.copy()

    def edge(self, x: Array, y: Array) -> bool:
        """Whether what is straight between two free configurations is free."""
        self._x[:], self._y[:] = x, y
        return bool(self._call.wbc_plan_edge(self.at, self._at_x, self._at_y))

    def way(self, x: Array, y: Array) -> Array:
        """What leads straight, or by the pieces of a base that rolls, from x to y [points, n]; x alone: not free."""
        self._x[:], self._y[:] = x, y
        count = self._call.wbc_plan_walk(self.at, self._at_x, self._at_y, self._at_points, POINTS)
        return np.concatenate([x[None], self._points[:count]])

    def projected(self, x: Array) -> Array | None:
        """The nearest configuration that keeps the rows of the path; None: not found."""
        self._x[:] = x
        return self._x.copy() if self._call.wbc_plan_project(self.at, self._at_x) else None

    def broken(self, x: Array) -> float:
        """How far rows of the path are broken at x at most."""
        self._x[:] = x
        return float(self._call.wbc_plan_broken(self.at, self._at_x))

    def reach(self, x: Array | None) -> tuple[int, Array]:
        """(0: goals are not met; 1: met, but not free; 2: free; the configuration) by a descent from x, or a sample."""
        if x is None:
            self._call.wbc_plan_draw(self.at, self._at_x)
        else:
            self._x[:] = x
        return int(self._call.wbc_plan_reach(self.at, self._at_x)), self._x.copy()

    def grow(self, samples: int) -> int:
        """Trees with more samples: 1: they met; 0: not yet; -1: they are full."""
        return int(self._call.wbc_plan_grow(self.at, samples))

    def path(self) -> Array:
        """The path through where the trees met, [points, n]."""
        count = self._call.wbc_plan_path(self.at, self._at_points, POINTS)
        if count < 0:
            raise RangeError("path", POINTS, "a path of more points than there is room for")
        return self._points[:count].copy()

    def shortened(self, points: Array, cuts: int, rounds: int) -> Array:
        """A path that is no longer: after so many tries of cuts, and rounds in which corners are pulled in."""
        self._points[: len(points)] = points
        arguments = (self._at_points, len(points), POINTS, cuts, rounds, _address(self._others), POINTS)
        return self._points[: self._call.wbc_plan_shorten(self.at, *arguments)].copy()

    def distance(self, x: Array, y: Array) -> float:
        """What counts as the distance of two points [rad, or characteristic lengths]."""
        self._x[:], self._y[:] = x, y
        return float(self._call.wbc_plan_length(self.at, self._at_x, 2))

    def length(self, points: Array) -> float:
        """Sum of the distances of points."""
        points = np.ascontiguousarray(points)
        return float(self._call.wbc_plan_length(self.at, _address(points), len(points)))

    @property
    def nodes(self) -> tuple[int, int]:
        """Of both trees."""
        return int(self._struct.count[0]), int(self._struct.count[1])

    def node(self, tree: int) -> Array:
        """All nodes of a tree."""
        return np.asarray(self._trees["node"][tree, : self._struct.count[tree]])
