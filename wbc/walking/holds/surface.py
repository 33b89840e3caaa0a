"""Surfaces that holds stand on: height above them, and its gradient."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc import validation
from wbc.multibody import pin
from wbc.validation import Array


@dataclass(frozen=True, eq=False)
class PlaneSurface:
    """The plane z = 0 of ``pose``; the structure is below, so heights count along its z axis.

    Raises:
        ShapeError, NotFiniteError, RotationError: a bad pose.
    """

    pose: pin.SE3

    def __post_init__(self) -> None:
        object.__setattr__(self, "pose", validation.pose("PlaneSurface.pose", self.pose))

    def height(self, points: Array) -> Array:
        """Signed height [m] of points ``[..., 3]``."""
        out: Array = (points - self.pose.translation) @ self.pose.rotation[:, 2]
        return out

    def segment_height(self, a: Array, b: Array) -> Array:
        """Least signed height [m] on the segments from ``a`` to ``b``, ``[..., 3]`` each."""
        return np.minimum(self.height(a), self.height(b))

    def normal(self, points: Array) -> Array:
        """The outward normal at points ``[..., 3]``."""
        return np.broadcast_to(self.pose.rotation[:, 2], np.shape(points)).copy()

    def moved(self, pose: pin.SE3) -> PlaneSurface:
        """The same surface on a structure that was moved by ``pose``."""
        return PlaneSurface(pose * self.pose)


@dataclass(frozen=True, eq=False)
class CylinderSurface:
    """The unbounded cylinder of ``radius`` [m] about the z axis of ``pose``; the structure is inside.

    Raises:
        ShapeError, NotFiniteError, RotationError, RangeError: a bad pose or radius.
    """

    pose: pin.SE3
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "pose", validation.pose("CylinderSurface.pose", self.pose))
        radius = validation.scalar("CylinderSurface.radius", self.radius, low=0.0, open_low=True, unit="m")
        object.__setattr__(self, "radius", radius)

    def height(self, points: Array) -> Array:
        """Signed height [m] of points ``[..., 3]``: distance from the axis less the radius."""
        across = self._across(points)
        out: Array = np.linalg.norm(across, axis=-1) - self.radius
        return out

    def segment_height(self, a: Array, b: Array) -> Array:
        """Least signed height [m] on the segments from ``a`` to ``b``, ``[..., 3]`` each."""
        start = self._across(a)
        span = self._across(b) - start
        square = (span**2).sum(axis=-1)
        foot = np.clip(-(start * span).sum(axis=-1) / np.where(square > 0, square, 1.0), 0.0, 1.0)
        out: Array = np.linalg.norm(start + foot[..., None] * span, axis=-1) - self.radius
        return out

    def normal(self, points: Array) -> Array:
        """The outward normal at points ``[..., 3]``; for points on the axis, x of ``pose``."""
        across = self._across(points)
        length = np.linalg.norm(across, axis=-1, keepdims=True)
        fallback = np.broadcast_to(self.pose.rotation[:, 0], across.shape)
        return np.where(length > validation.LEAST_DIRECTION, across / np.maximum(length, 1e-300), fallback)

    def moved(self, pose: pin.SE3) -> CylinderSurface:
        """The same surface on a structure that was moved by ``pose``."""
        return CylinderSurface(pose * self.pose, self.radius)

    def _across(self, points: Array) -> Array:
        axis = self.pose.rotation[:, 2]
        local = np.asarray(points, dtype=np.float64) - self.pose.translation
        out: Array = local - (local @ axis)[..., None] * axis
        return out


Surface = PlaneSurface | CylinderSurface
