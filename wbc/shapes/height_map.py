"""Maps of heights: the ground as a grid."""

from __future__ import annotations

import hashlib
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wbc import pickling, validation
from wbc.errors import RangeError, ShapeError
from wbc.quick_dataclasses import dataclass
from wbc.shapes.solid import Kind, Solid, Stored
from wbc.shapes.surfaces import between_rows
from wbc.validation import Array

if TYPE_CHECKING:
    import mujoco

#: Cells of a map at most: the kernel keeps a box and a half of 48 bytes for each
CELLS = 1_000_000


@dataclass(frozen=True, eq=False)
class HeightMap(Solid):
    """The ground below a grid of heights, down to ``base`` below z = 0.

    Height ``heights[i, j]`` is above the point

        x = (j / (columns - 1) - 1/2) size[0],   y = (i / (rows - 1) - 1/2) size[1]       [m]

    Every four of them are two triangles, cut from the corner of least x and y, as MuJoCo cuts its height fields. A body
    in the ground leaves it upwards: it is as deep as it has to be lifted along z, times the cosine of the slope on
    which it then stands. Of a sphere or capsule that is said of its centre or segment.

    Attributes:
        heights: rows x columns [m], each 2 at least and no more than 1e6 cells in all.
        size: lengths along x and y [m].
        base: how far the ground goes down below z = 0 [m].

    Raises:
        ShapeError, NotFiniteError: heights that are no grid, sizes that are not two numbers.
        RangeError: a size that is not above 0, too many cells, a height that is not above the base.
    """

    heights: Array
    size: tuple[float, float]
    base: float

    kind = Kind.FIELD
    geom = "HFIELD"

    def __post_init__(self) -> None:
        heights = validation.ordinary_array("HeightMap.heights", self.heights)
        if heights.ndim != 2 or min(heights.shape) < 2:
            raise ShapeError("HeightMap.heights", heights.shape, "expected rows x columns, 2 at least of each")
        if heights.size > CELLS:
            raise RangeError("HeightMap.heights", heights.shape, f"expected at most {CELLS} heights")
        sides = validation.real_array("HeightMap.size", self.size, (2,)).tolist()
        checked = tuple(validation.scalar("HeightMap.size", x, low=0.0, open_low=True, unit="m") for x in sides)
        base = validation.scalar("HeightMap.base", self.base, unit="m")
        if heights.min() <= -base:
            raise RangeError("HeightMap.base", base, f"the least height is {heights.min():g} m: it must be above -base")
        kept = np.array(heights)
        kept.flags.writeable = False
        for name, value in (("heights", kept), ("size", checked), ("base", base)):
            object.__setattr__(self, name, value)

    def __setstate__(self, state: dict[str, Any]) -> None:
        pickling.restore(self, state, {"heights", "size", "base"})
        pickling.freeze(self)

    def __getstate__(self) -> dict[str, Any]:
        return pickling.declared(self)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, HeightMap) and self._told == other._told

    def __hash__(self) -> int:
        return hash(self._told)

    def __repr__(self) -> str:
        rows, columns = self.heights.shape
        return f"HeightMap({rows} x {columns}, size={self.size}, base={self.base}, {self._told[-1][:16]})"

    @cached_property
    def _told(self) -> tuple[Any, ...]:
        return self.heights.shape, self.size, self.base, hashlib.sha256(self.heights.tobytes()).hexdigest()

    @property
    def reach(self) -> float:
        x, y = self.size
        return float(np.linalg.norm([x / 2, y / 2, max(self.base, np.abs(self.heights).max())]))

    @property
    def sizes(self) -> tuple[float, float, float, float, float]:
        (rows, columns), (x, y) = self.heights.shape, self.size
        return (x / (columns - 1), y / (rows - 1), self.base, y / 2, 0.0)

    def stored(self) -> Stored:
        return self._stored

    @cached_property
    def _stored(self) -> Stored:
        tree, box = _boxes(self.heights, self.sizes)
        return Stored(self.heights.shape[1], self.heights.ravel(), tree, box)

    def triangles(self) -> Array:
        (rows, columns), (x, y) = self.heights.shape, self.size
        grid = np.meshgrid(np.linspace(-x / 2, x / 2, columns), np.linspace(-y / 2, y / 2, rows))
        top = np.stack([*grid, self.heights], axis=2)
        rim = np.concatenate([top[0], top[1:, -1], top[-1, -2::-1], top[-2::-1, 0]])
        bottom = rim * [1.0, 1.0, 0.0] - [0.0, 0.0, self.base]
        walls = between_rows(np.stack([bottom, rim]))
        floor = between_rows(top[:: rows - 1, :: columns - 1] * [1.0, 1.0, 0.0] - [0.0, 0.0, self.base])
        return np.concatenate([between_rows(top), walls, floor[:, ::-1]])

    def become(self, geom: mujoco.MjsGeom, spec: mujoco.MjSpec, name: str) -> None:
        import mujoco

        super().become(geom, spec, name)
        low, rise = self.heights.min(), np.ptp(self.heights)
        field = spec.add_hfield(name=name, nrow=self.heights.shape[0], ncol=self.heights.shape[1])
        field.size = [self.size[0] / 2, self.size[1] / 2, rise or 1.0, self.base + low]
        field.userdata = ((self.heights - low) / (rise or 1.0)).ravel()
        geom.hfieldname = name
        lift = np.zeros(3)
        mujoco.mju_rotVecQuat(lift, np.array([0.0, 0.0, low]), np.array(geom.quat))
        geom.pos = geom.pos + lift


def _boxes(heights: Array, sizes: tuple[float, ...]) -> tuple[NDArray[np.int32], Array]:
    """A tree of boxes over the cells of a grid, each of two pieces; halved across the longer side, level by level."""
    rows, columns = heights.shape
    step, middle = np.array([sizes[1], sizes[0]]), np.array([sizes[3], sizes[0] * (columns - 1) / 2])
    # first row, first column, last row, last column of each node
    level, first, levels = np.array([[0, 0, rows - 1, columns - 1]]), 0, list[tuple[Any, Any]]()
    while len(level):
        span = level[:, 2:] - level[:, :2]
        large = np.flatnonzero(span.max(axis=1) > 1)
        one, other, k = level[large], level[large], np.arange(len(large))
        side = np.argmax(step * span[large] * (span[large] > 1), axis=1)
        one[k, side + 2] = other[k, side] = (one[k, side] + one[k, side + 2]) // 2
        piece, after = 2 * (level[:, 0] * (columns - 1) + level[:, 1]), first + len(level)
        children = np.stack([-1 - piece, -2 - piece], axis=1)
        children[large] = after + np.stack([2 * k, 2 * k + 1], axis=1)
        levels.append((level, children))
        level, first = np.stack([one, other], axis=1).reshape(-1, 4), after
    cells, tree = (np.concatenate(parts) for parts in zip(*levels, strict=True))
    low, high = cells[:, :2] * step - middle, cells[:, 2:] * step - middle
    i, j = cells[:, 0], cells[:, 1]
    top = np.max([heights[i + a, j + b] for a in (0, 1) for b in (0, 1)], axis=0)
    end = len(tree)
    for _, children in reversed(levels):
        begin = end - len(children)
        inner = np.flatnonzero(children[:, 0] >= 0)
        top[begin + inner] = top[children[inner]].max(axis=1)
        end = begin
    bottom = np.full(len(tree), -sizes[2])
    return tree.astype(np.int32), np.column_stack([low[:, ::-1], bottom, high[:, ::-1], top])
