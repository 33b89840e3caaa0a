"""What those who choose pairs, measure corners and check results see of a sensing."""

from __future__ import annotations

from typing import Any, Protocol

from wbc.proximity.rows import PairRows
from wbc.proximity.scene import Index, PairScene
from wbc.proximity.support import Supports
from wbc.validation import Array


class Measured(Protocol):
    """Bodies at their places and what was measured of their pairs; see :class:`wbc.proximity.plain.PlainSensing`."""

    measured: int
    pairs: Index
    tie: float
    off: float

    @property
    def rows(self) -> PairRows | None: ...
    @property
    def scene(self) -> PairScene: ...
    @property
    def distances(self) -> Array: ...
    @property
    def normals(self) -> Array: ...
    @property
    def points(self) -> Array: ...
    @property
    def rotations(self) -> Array: ...
    @property
    def centers(self) -> Array: ...
    @property
    def supports(self) -> Supports: ...

    def bounds(self) -> Array:
        """No pair is closer than this [m]."""

    def gaps(self, which: Index) -> Array:
        """Distances of some pairs as they count for the margin [m]."""

    def rows_of(self, pair: int) -> tuple[Array, Array]:
        """(distances, lines) of the nearest points of a pair that was measured; where it is near, of its corners."""

    def ask(self, which: Index) -> Array:
        """Distances of some pairs at the bodies' present places."""

    def distance(self, a: int, at: Any, b: int, there: Any) -> tuple[float, Array, Array]:
        """(distance, normal, witness on A) of two bodies at some places, as Coal says."""
