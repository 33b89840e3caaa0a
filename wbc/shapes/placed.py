"""A shape at its place on a link."""

from __future__ import annotations

import numpy as np

from wbc import pickling, validation
from wbc.errors import ShapeError
from wbc.multibody import in_pinocchio, own, pin
from wbc.quick_dataclasses import dataclass
from wbc.shapes.solid import Shape, Solid
from wbc.validation import Array


def _no_shape(value: object) -> ShapeError:
    from wbc.shapes.names import names_of_shapes

    return ShapeError("PlacedShape.shape", value, "this is no shape", names_of_shapes())


@in_pinocchio("placement")
@dataclass(frozen=True, eq=False)
class PlacedShape:
    """A shape fixed to a link frame.

    Attributes:
        shape: a :data:`Solid`; a :class:`HalfSpace` is no part of a link, but may stand in the world.
        placement: pose of the shape in the link's frame.
        excess: how far the shape may stand out of what it was fitted to [m]; 0 for exact shapes.

    Raises:
        ShapeError: no solid. NotFiniteError, RotationError, RangeError: a bad placement or excess.
    """

    shape: Solid
    placement: pin.SE3
    excess: float = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.shape, Shape):
            raise _no_shape(self.shape)
        object.__setattr__(self, "placement", validation.own_pose("PlacedShape.placement", self.place))
        validation.own_scalars(self, "excess", low=0.0, unit="m")

    def __getstate__(self) -> dict[str, object]:
        return pickling.declared(self)

    @property
    def place(self) -> own.SE3:
        """:attr:`placement` as this package's own pose."""
        placed: own.SE3 = vars(self)["placement"]
        return placed

    def capsule(self) -> tuple[Array, Array, float]:
        """(end, end, radius) of a capsule in the link's frame that contains the shape [m]."""
        a, b, radius = self.shape.capsule()
        return self.place * a, self.place * b, radius

    def ends(self) -> tuple[Array, Array]:
        """The two ends of the shape's core segment in the link's frame [m]; equal for all but a capsule."""
        half = self.shape.sizes[2] if self.shape.is_round else 0.0
        axis = np.array(self.place.rotation[:, 2])
        center = np.array(self.place.translation)
        return center - half * axis, center + half * axis
