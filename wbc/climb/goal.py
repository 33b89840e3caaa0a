"""Where a climber is to go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from wbc import validation
from wbc.errors import ShapeError
from wbc.validation import Array

#: How near to its place a body is to come unless it is said [m]
PLACE = 0.02


@dataclass(frozen=True, eq=False)
class BodyPlace:
    """The body's link at a place in the world.

    Attributes:
        position: of its origin ``(3)`` [m].
        rotation: of its axes: a quaternion x, y, z, w or a matrix; None: any.
        within: distance from it that is near enough [m]; of a rotation the same number in rad.

    Raises:
        ShapeError, NotFiniteError, RotationError, RangeError: no place, rotation or distance.
    """

    position: Array
    rotation: Any = None
    within: float = PLACE

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", validation.real_array("BodyPlace.position", self.position, (3,)))
        if self.rotation is not None:
            object.__setattr__(self, "rotation", validation.rotation("BodyPlace.rotation", self.rotation))
        validation.own_scalars(self, "within", low=0.0, open_low=True, unit="m")


@dataclass(frozen=True)
class LimbAt:
    """A limb at a foothold, both by name."""

    limb: str
    foothold: str


@dataclass(frozen=True, eq=False)
class Route:
    """Places one after the other, each reached before the next is sought."""

    places: Sequence[BodyPlace | LimbAt]

    def __post_init__(self) -> None:
        places = validation.items("Route.places", self.places, "BodyPlace and LimbAt")
        if not places:
            raise ShapeError("Route.places", (), "expected one place or more")
        for one in places:
            validation.instance("Route.places", one, (BodyPlace, LimbAt), "BodyPlace and LimbAt")
        object.__setattr__(self, "places", places)


Goal = BodyPlace | LimbAt | Route
