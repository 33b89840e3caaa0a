"""What stands around a robot and does not move: surfaces and bodies, and footholds that can be clicked."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from wbc import validation
from wbc.validation import Array
from wbc.viewer.bodies import DrawnMesh, Dress
from wbc.viewer.messages import PAIRED, MessageError


class Scenery(NamedTuple):
    """Meshes in the world, and footholds.

    Attributes:
        surfaces: what is only seen. studs: what footholds look like, all in one. holds: their ids. places: [n x 3] m.
        up: direction that is up for whoever looks [3]. body: frame that cameras begin at. arms: names of limbs.
        dress: what the robot's links look like.
        near: a click counts for the foothold that it passes nearer than this [m].
    """

    surfaces: tuple[DrawnMesh, ...]
    studs: DrawnMesh
    holds: tuple[str, ...]
    places: Array
    up: tuple[float, float, float]
    body: str
    arms: tuple[str, ...]
    dress: Dress
    near: float

    def hit(self, origin: Array, direction: Array) -> str | None:
        """The first foothold that a ray passes near to, None where it passes none."""
        way = direction / np.linalg.norm(direction)
        along = (self.places - origin) @ way
        off = np.linalg.norm(self.places - origin - along[:, None] * way, axis=1)
        near = (off < self.near) & (along > 0.0)
        if not near.any():
            return None
        first = along[near].min()
        # Of those that lie about as far as the first the one that was meant
        near &= along < first + self.near
        return self.holds[int(np.where(near, off, np.inf).argmin())]

    def nearest(self, place: Array) -> int:
        """Row of the foothold at a place."""
        return int(np.linalg.norm(self.places - place, axis=1).argmin())


def checked(message: Mapping[str, Any], holds: tuple[str, ...], arms: tuple[str, ...]) -> None:
    """Refuse what a climb does not obey.

    Raises:
        WbcError: which field does not fit.
    """
    kind = message["type"]
    if kind in ("steer", "hand"):
        rates = validation.real_array(f"{kind}.rates", message["rates"], (3 if kind == "steer" else 4,))
        if np.abs(rates).max() > 1.0 + 1e-9:
            raise MessageError(f"{kind}.rates", message["rates"], "expected parts of full speed, -1 to 1")
    elif kind == "arm":
        validation.one_of("arm.name", message["name"], ("", *arms))
    elif kind == "go":
        validation.one_of("go.hold", message["hold"], holds)
    elif kind == "ask":
        validation.flag("ask.on", message["on"])
    elif kind in PAIRED:
        raise MessageError("message.type", kind, "only an arm that is driven by pairs obeys it")
    elif kind in ("set", "rate"):
        raise MessageError("message", message.get("item"), "a climb sets its own targets; steer it")
