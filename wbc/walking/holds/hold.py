"""Holds: what a hand can grasp."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.multibody import pin
from wbc.validation import Array

FREE = "free"
FIXED = "fixed"
#: What a hold is mounted on, besides obstacles: the structure's surface
SURFACE = "surface"
#: Most positions of an n-fold roll
MOST_ROLLS = 360
#: An axis and a roll reference closer to each other than this [rad] leave the roll undetermined
LEAST_ANGLE = 1e-6


@dataclass(frozen=True, eq=False)
class Hold:
    """A thing to grasp, at a pose of a structure; the constraint that a frame does not move is :class:`wbc.tasks.Hold`.

    A closed hand has its frame's origin at the hold's and its z axis along the hold's, up to ``max_tilt``; about that
    axis it may roll as ``roll`` says.

    Attributes:
        id: name, unique in a structure.
        pose: in the structure's frame [m]: origin at the grasp point, z the approach direction (into the
            structure), x the roll reference.
        roll: ``"free"``, ``"fixed"`` (the hand's x axis along the hold's) or n, 2 to 360 (fixed, or turned by a
            multiple of 2 pi / n).
        max_tilt: largest angle between the two z axes while closed [rad]; 0 fixes them.
        on: what it is mounted on, which a hand at it may touch: the id of an obstacle, ``"surface"``, or "" where
            nobody says.

    Raises:
        ShapeError, NotFiniteError, RotationError: a bad pose, or a text that is no id. RangeError: a roll or tilt that
            is none.
    """

    id: str
    pose: pin.SE3
    roll: str | int = FREE
    max_tilt: float = 0.0
    on: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "id", checked_id("Hold.id", self.id))
        object.__setattr__(self, "pose", validation.pose("Hold.pose", self.pose))
        object.__setattr__(self, "roll", checked_roll("Hold.roll", self.roll))
        tilt = validation.scalar("Hold.max_tilt", self.max_tilt, low=0.0, high=pi / 2, unit="rad")
        object.__setattr__(self, "max_tilt", tilt)
        object.__setattr__(self, "on", self.on if self.on == "" else checked_id("Hold.on", self.on))

    @property
    def position(self) -> Array:
        """The grasp point in the structure's frame [m]."""
        return np.array(self.pose.translation)

    @property
    def axis(self) -> Array:
        """The approach direction, into the structure."""
        return np.array(self.pose.rotation[:, 2])

    @property
    def rolls(self) -> tuple[float, ...]:
        """Angles about z from the hold's x axis to the hand's that are allowed [rad]; empty where any is."""
        if self.roll == FREE:
            return ()
        count = 1 if isinstance(self.roll, str) else self.roll
        return tuple(2 * pi * k / count for k in range(count))

    def moved(self, pose: pin.SE3) -> Hold:
        """The same hold on a structure that was moved by ``pose``."""
        return Hold(self.id, pose * self.pose, self.roll, self.max_tilt, self.on)


def checked_id(field: str, value: Any) -> str:
    """A name on one line, without blanks around it.

    Raises:
        ShapeError: something else.
    """
    if not isinstance(value, str) or not value or value != value.strip() or not value.isprintable():
        raise ShapeError(field, value, "expected a non-empty text on one line, without blanks around it")
    return value


def checked_roll(field: str, value: Any) -> str | int:
    """``"free"``, ``"fixed"`` or a whole number from 2 to 360.

    Raises:
        RangeError: something else.
    """
    if value in (FREE, FIXED):
        return str(value)
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool) and 2 <= value <= MOST_ROLLS:
        return int(value)
    raise RangeError(field, value, f"expected {FREE}, {FIXED} or a whole number from 2 to {MOST_ROLLS}")


def frame_of(field: str, position: Any, axis: Any, reference: Any) -> pin.SE3:
    """The frame with z along ``axis`` and x along the part of ``reference`` across it.

    Raises:
        ShapeError, NotFiniteError: not three finite numbers each.
        RangeError: a direction of no length, or two that are parallel within 1e-6 rad.
    """
    z = validation.unit_vector(f"{field}.axis", axis)
    x = validation.unit_vector(f"{field}.reference", reference)
    across = x - (x @ z) * z
    if np.linalg.norm(across) < LEAST_ANGLE:
        raise RangeError(
            f"{field}.reference", reference, "parallel to the approach direction: the roll is undetermined"
        )
    across = across / np.linalg.norm(across)
    # Once more, so that the frame is orthonormal to the last digits
    across = across - (across @ z) * z
    across = across / np.linalg.norm(across)
    rotation = np.column_stack([across, np.cross(z, across), z])
    return pin.SE3(rotation, validation.real_array(f"{field}.position", position, (3,)))
