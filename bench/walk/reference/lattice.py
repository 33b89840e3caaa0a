"""Body poses on a lattice that is fixed to the published cylinder."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.validation import Array
from wbc.walking.holds.built_in import INCH, PITCH, RADIUS

Ints = NDArray[np.int64]

#: Lattice cells in a grid unit along T and along A, and headings in a turn
PARTS, HEADINGS = 4, 24
#: No arm reaches a hold that is further away than this [cells]
FAR = 20
#: Cells on either side of a hold, the hold's own included
SIDE = 2 * FAR + 1
#: Heights of the body above the surface [m]
HEIGHTS = tuple(height * INCH for height in (46.0, 49.0, 52.0, 54.0))
#: Rounding that a pose on the lattice may have [grid units, rad, m]
ROUNDING = 1e-6


@dataclass(frozen=True)
class GridPose:
    """A body pose over grid coordinates.

    Attributes:
        t, a: grid coordinates of the body's origin.
        heading: [rad]; None: any. height: above the surface [m]; None: any.
    """

    t: float
    a: float
    heading: float | None = 0.0
    height: float | None = None


@dataclass(frozen=True)
class Lattice:
    """T and A in quarters of a grid unit, headings 15 degrees apart, and some heights.

    A cell is (height, heading, x, y): indices of height and heading, x = 4 T and y = 4 A.

    Attributes:
        heights: above the surface, increasing [m].

    Raises:
        ShapeError, NotFiniteError, RangeError: no heights, or not increasing ones.
    """

    heights: tuple[float, ...] = HEIGHTS

    def __post_init__(self) -> None:
        heights = validation.real_array("Lattice.heights", self.heights)
        if heights.ndim != 1 or not len(heights):
            raise ShapeError("Lattice.heights", self.heights, "expected at least one height")
        if heights[0] <= 0 or (np.diff(heights) <= 0).any():
            raise RangeError("Lattice.heights", self.heights, "expected positive, increasing heights")
        object.__setattr__(self, "heights", tuple(heights.tolist()))

    def cells(self, field: str, pose: Any) -> Ints:
        """Cells of a pose, ``[n, 4]``: several where its heading or height is open.

        Raises:
            ShapeError: not a GridPose. NotFiniteError: not numbers. RangeError: a pose between the lattice's.
        """
        if not isinstance(pose, GridPose):
            raise ShapeError(field, pose, "expected a GridPose")
        x = self._whole(f"{field}.t", pose.t, 1.0 / PARTS)
        y = self._whole(f"{field}.a", pose.a, 1.0 / PARTS)
        headings = list(range(HEADINGS))
        if pose.heading is not None:
            headings = [self._whole(f"{field}.heading", pose.heading, radians(360.0 / HEADINGS)) % HEADINGS]
        heights = list(range(len(self.heights)))
        if pose.height is not None:
            height = validation.scalar(f"{field}.height", pose.height, unit="m")
            heights = [k for k, known in enumerate(self.heights) if abs(known - height) <= ROUNDING]
            if not heights:
                raise RangeError(f"{field}.height", height, f"the lattice has {self.heights}")
        return np.array([(h, c, x, y) for h in heights for c in headings], dtype=np.int64)

    def pose(self, cell: Any) -> GridPose:
        """The pose of a cell."""
        h, c, x, y = (int(number) for number in cell)
        return GridPose(x / PARTS, y / PARTS, radians(360.0 / HEADINGS) * (c % HEADINGS), self.heights[h])

    def frames(self, cells: Any) -> Array:
        """Body frames of cells ``[n, 4]`` in the frame of the cylinder, ``[n, 4, 4]``; see ``grid_pose``.

        Numbers between cells are poses between them; below the first height and above the last there are none.
        """
        angle = np.radians(25.0 + 5.0 * cells[:, 2] / PARTS)
        turn = np.radians(360.0 / HEADINGS) * cells[:, 1]
        radius = RADIUS + np.interp(cells[:, 0], np.arange(len(self.heights)), self.heights)
        # Rz(-angle) Ry(90 degrees) Rz(turn): x of heading 0 is -z, y is +T, z the inward normal
        zero, one = np.zeros(len(cells)), np.ones(len(cells))
        along_a = np.stack([zero, zero, -one], axis=-1)
        along_t = np.stack([np.sin(angle), np.cos(angle), zero], axis=-1)
        inward = np.stack([np.cos(angle), -np.sin(angle), zero], axis=-1)
        cosine, sine = np.cos(turn)[:, None], np.sin(turn)[:, None]
        out = np.zeros((len(cells), 4, 4))
        out[:, :3, 0], out[:, :3, 1] = cosine * along_a + sine * along_t, cosine * along_t - sine * along_a
        out[:, :3, 2] = inward
        out[:, :3, 3] = -radius[:, None] * inward
        out[:, 2, 3] = -PITCH * cells[:, 3] / PARTS
        out[:, 3, 3] = 1.0
        return out

    def _whole(self, field: str, value: Any, unit: float) -> int:
        number = validation.scalar(field, value) / unit
        if abs(number - round(number)) > ROUNDING / unit:
            raise RangeError(field, value, f"is not on the lattice, whose poses are {unit:.6g} apart")
        return round(number)
