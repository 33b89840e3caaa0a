"""Joint limits in the tangent space: one entry a degree of freedom."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np

from wbc import pickling, validation
from wbc.errors import BoundsError, NotFiniteError, RangeError
from wbc.quick_dataclasses import dataclass
from wbc.validation import Array


@dataclass(frozen=True, eq=False)
class Limits:
    """Limits of every degree of freedom, nv entries each, SI units; +-inf where there is none.

    Attributes:
        position_lower, position_upper: [rad or m]; infinite for unbounded and base degrees of freedom.
        velocity: largest |v| [rad/s or m/s].
        acceleration: largest |dv/dt| [rad/s^2 or m/s^2].
        effort: largest |torque or force| [N m or N].
    """

    position_lower: Array
    position_upper: Array
    velocity: Array
    acceleration: Array
    effort: Array

    def __post_init__(self) -> None:
        n = validation.dimensions("limits.velocity", self.velocity)
        for f in fields(self):
            array = validation.real_array(f"limits.{f.name}", getattr(self, f.name), n, finite=False)
            if np.isnan(array).any():
                raise NotFiniteError(f"limits.{f.name}", array, "NaN is no limit; use inf for none")
            if not f.name.startswith("position") and (array < 0).any():
                raise RangeError(f"limits.{f.name}", array, "expected values >= 0")
            array.flags.writeable = False
            object.__setattr__(self, f.name, array)
        if (self.position_lower > self.position_upper).any():
            raise BoundsError("limits.position_lower", self.position_lower, "above position_upper")

    def __setstate__(self, state: dict[str, Any]) -> None:
        pickling.restore(self, state, {f.name for f in fields(self)})
        pickling.freeze(self)

    def override(self, **changes: Any) -> Limits:
        """A copy with some arrays replaced; a scalar is spread over all degrees of freedom.

        Raises:
            UnknownNameError: no such limit. ShapeError, NotFiniteError, RangeError, BoundsError: a bad value.
        """
        spread = {}
        for name, change in changes.items():
            validation.one_of("limit", name, [f.name for f in fields(self)])
            array = validation.real_array(f"limits.{name}", change, finite=False)
            spread[name] = np.full(self.velocity.shape, float(array)) if array.ndim == 0 else array
        return replace(self, **spread)
