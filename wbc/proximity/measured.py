"""What those who choose pairs, measure corners and check results see of a sensing."""

from __future__ import annotations

from typing import Any, Protocol

from wbc.proximity.scene import Index, PairScene
from wbc.proximity.support import Supports
from wbc.validation import Array


class Measured(Protocol):
    """Bodies at their places and what was measured of their pairs; see :class:`wbc.proximity.plain.PlainSensing`."""

    measured: int

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

    def ask(self, which: Index) -> Array:
        """Distances of some pairs at the bodies' present places."""

    def distance(self, a: int, at: Any, b: int, there: Any) -> tuple[float, Array, Array]:
        """(distance, normal, witness on A) of two bodies at some places, as Coal says."""
