"""Poses as they are read from a controller."""

from __future__ import annotations

from wbc.multibody import pin
from wbc.validation import Array


class ReadPose(pin.SE3):  # type: ignore[misc]
    """A pose that was read from a controller; ``.copy()`` gives one that can be changed and set.

    What is written into its parts would not reach the controller, so that they are read-only.
    """

    @property
    def translation(self) -> Array:
        return _read_only(super().translation)

    @property
    def rotation(self) -> Array:
        return _read_only(super().rotation)

    def copy(self) -> pin.SE3:
        return pin.SE3(self)


def _read_only(array: Array) -> Array:
    array.flags.writeable = False
    return array
