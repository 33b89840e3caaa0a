"""What a law must keep."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import BoundsError, RangeError, ShapeError
from wbc.validation import Array


@dataclass(frozen=True, eq=False)
class MotionLimits:
    """Largest sizes by joint (or by component, for poses: three linear, three angular). None: no limit.

    Attributes:
        lower, upper: of positions [rad or m], n each, -inf and inf where there is none; both or neither.
        velocity, acceleration, jerk: n positive numbers each, inf where there is none [rad/s or m/s, and so on].

    Raises:
        ShapeError, NotFiniteError: of other shapes, NaN. RangeError: not positive. BoundsError: lower above upper.
    """

    lower: Array | None = None
    upper: Array | None = None
    velocity: Array | None = None
    acceleration: Array | None = None
    jerk: Array | None = None

    def __post_init__(self) -> None:
        sizes = {}
        for field in fields(self):
            value = getattr(self, field.name)
            if value is None:
                continue
            name = f"limits.{field.name}"
            array = _vector(name, value)
            object.__setattr__(self, field.name, array)
            sizes[field.name] = len(array)
            if field.name not in ("lower", "upper") and not (array > 0.0).all():
                raise RangeError(name, value, "limits must be positive")
            if field.name not in ("lower", "upper") and (array < validation.SMALLEST).any():
                raise RangeError(name, value, f"limits must be at least {validation.SMALLEST:g}")
        if len(set(sizes.values())) > 1:
            raise ShapeError("limits", sizes, "limits of different numbers of joints")
        if (self.lower is None) != (self.upper is None):
            raise ShapeError("limits", list(sizes), "lower and upper go together")
        if self.lower is not None and self.upper is not None and not (self.lower < self.upper).all():
            raise BoundsError("limits.lower", self.lower, "must be below limits.upper")

    @property
    def dof(self) -> int | None:
        """Number of joints, None where there is no limit at all."""
        for field in fields(self):
            value = getattr(self, field.name)
            if value is not None:
                return len(value)
        return None

    def for_dof(self, dof: int) -> MotionLimits:
        """Themselves, if they are for so many joints.

        Raises:
            ShapeError: they are not.
        """
        validation.integer("dof", dof, 1)
        if self.dof not in (None, dof):
            raise ShapeError("limits", self.dof, f"expected limits of {dof} joints")
        return self

    @classmethod
    def given(cls, limits: MotionLimits | None, dof: int) -> MotionLimits:
        """Limits that a user gave, None for none, if they are for so many joints.

        Raises:
            ShapeError: they are not.
        """
        return (cls() if limits is None else validation.instance("limits", limits, cls, "MotionLimits")).for_dof(dof)

    def scaled(self, factor: float) -> MotionLimits:
        """Velocities, accelerations and jerks times a factor, positions as they are.

        Raises:
            ShapeError, NotFiniteError, RangeError: not a positive number, or one that makes limits 0 or infinite.
        """
        factor = validation.scalar("factor", factor, low=0.0, open_low=True)
        parts = {name: getattr(self, name) for name in ("velocity", "acceleration", "jerk")}
        return MotionLimits(self.lower, self.upper, **{k: None if v is None else v * factor for k, v in parts.items()})


def for_all(name: str, value: Any, dof: int, finite: bool = False) -> Array:
    """A number for all joints, or one for each, as one for each; inf is no limit.

    Raises:
        ShapeError, NotFiniteError: of another shape, or not finite.
    """
    raw = validation.ordinary_array(name, value, finite=finite)
    return np.full(dof, float(raw)) if raw.ndim == 0 else validation.ordinary_array(name, value, (dof,), finite=finite)


def _vector(name: str, value: Any) -> Array:
    """A vector without NaN; infinite entries are no limits."""
    out = validation.ordinary_array(name, value, finite=False)
    out = np.atleast_1d(out)
    if out.ndim != 1 or np.isnan(out).any():
        raise ShapeError(name, value, "expected a vector without NaN")
    return out
