"""Structures: holds, the surface that they stand on, and obstacles."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from wbc import validation
from wbc.clearance import TriangleMesh
from wbc.errors import DuplicateNameError, ShapeError, UnknownNameError
from wbc.multibody import pin
from wbc.validation import Array
from wbc.walking.holds.hold import FREE, SURFACE, Hold
from wbc.walking.holds.obstacle import Obstacle
from wbc.walking.holds.surface import CylinderSurface, PlaneSurface, Surface

#: Of :attr:`Structure.mounts`, where it is no row of an obstacle
ON_SURFACE, NOT_SAID = -1, -2


@dataclass(frozen=True, eq=False)
class Structure:
    """What a walker walks on, in the structure's own frame.

    Attributes:
        name: short.
        holds: at least one, ids unique.
        obstacles: ids unique.
        surface: what the holds stand on, if it has a formula.

    Raises:
        ShapeError: no holds, or things of another type. DuplicateNameError: two of one id. UnknownNameError: a hold on
            something that is not there.
    """

    name: str
    holds: tuple[Hold, ...]
    obstacles: tuple[Obstacle, ...] = ()
    surface: Surface | None = None

    def __post_init__(self) -> None:
        for field, kind in (("holds", Hold), ("obstacles", Obstacle)):
            things = validation.items(f"Structure.{field}", getattr(self, field), f"{kind.__name__}s")
            if not all(isinstance(thing, kind) for thing in things):
                raise ShapeError(f"Structure.{field}", things, f"expected {kind.__name__}s")
            seen: set[str] = set()
            for thing in things:
                if thing.id in seen:
                    raise DuplicateNameError(f"Structure.{field}", thing.id, "two of this id")
                seen.add(thing.id)
            object.__setattr__(self, field, things)
        if not self.holds:
            raise ShapeError("Structure.holds", (), "expected at least one hold")
        if self.surface is not None and not isinstance(self.surface, (PlaneSurface, CylinderSurface)):
            raise ShapeError("Structure.surface", self.surface, "expected a PlaneSurface, a CylinderSurface or None")
        there = {"", *(obstacle.id for obstacle in self.obstacles), *([] if self.surface is None else [SURFACE])}
        for hold in self.holds:
            if hold.on not in there:
                raise UnknownNameError(f"hold {hold.id}: on", hold.on, sorted(there - {""}))

    def __getitem__(self, hold: str) -> Hold:
        """The hold of an id.

        Raises:
            UnknownNameError: no such hold; the nearest ids come first.
        """
        return self.holds[self.index(hold)]

    def __contains__(self, hold: object) -> bool:
        return hold in self._places

    def __len__(self) -> int:
        return len(self.holds)

    def __iter__(self) -> Iterator[Hold]:
        return iter(self.holds)

    def index(self, hold: str) -> int:
        """The row of a hold in :attr:`positions`, :attr:`axes` and :attr:`references`.

        Raises:
            UnknownNameError: no such hold.
        """
        if hold not in self._places:
            raise UnknownNameError("hold", hold, self._places)
        return self._places[hold]

    @cached_property
    def _places(self) -> dict[str, int]:
        return {hold.id: k for k, hold in enumerate(self.holds)}

    @cached_property
    def ids(self) -> tuple[str, ...]:
        """Ids of the holds."""
        return tuple(self._places)

    @cached_property
    def positions(self) -> Array:
        """Grasp points [m], ``[holds, 3]``."""
        return _frozen(np.array([hold.position for hold in self.holds]))

    @cached_property
    def axes(self) -> Array:
        """Approach directions, ``[holds, 3]``."""
        return _frozen(np.array([hold.axis for hold in self.holds]))

    @cached_property
    def references(self) -> Array:
        """Roll references (x axes), ``[holds, 3]``."""
        return _frozen(np.array([hold.pose.rotation[:, 0] for hold in self.holds]))

    @cached_property
    def frames(self) -> Array:
        """Homogeneous matrices of the holds, ``[holds, 4, 4]``."""
        return _frozen(np.array([hold.pose.homogeneous for hold in self.holds]))

    @cached_property
    def tilts(self) -> Array:
        """``max_tilt`` of the holds [rad]."""
        return _frozen(np.array([hold.max_tilt for hold in self.holds]))

    @cached_property
    def free_rolls(self) -> tuple[bool, ...]:
        """Whether a hand may roll as it likes, one entry a hold."""
        return tuple(hold.roll == FREE for hold in self.holds)

    @cached_property
    def mounts(self) -> tuple[int, ...]:
        """What each hold is mounted on: the row of an obstacle, :data:`ON_SURFACE`, or :data:`NOT_SAID`."""
        rows = {"": NOT_SAID, SURFACE: ON_SURFACE} | {obstacle.id: k for k, obstacle in enumerate(self.obstacles)}
        return tuple(rows[hold.on] for hold in self.holds)

    @cached_property
    def digest(self) -> str:
        """First 12 digits of the SHA-256 of holds, obstacles and surface."""
        h = hashlib.sha256()
        for hold in self.holds:
            on = f" {hold.on}" if hold.on else ""
            h.update(f"{hold.id} {hold.roll} {hold.max_tilt.hex()}{on}".encode() + _bytes(hold.pose))
        for obstacle in self.obstacles:
            shape = obstacle.shape
            text = f"{obstacle.id} {'mesh' if isinstance(shape, TriangleMesh) else shape}".encode()
            corners = shape.corners.tobytes() if isinstance(shape, TriangleMesh) else b""
            h.update(text + corners + _bytes(obstacle.placement))
        if self.surface is not None:
            h.update(f"{type(self.surface).__name__} {getattr(self.surface, 'radius', 0.0)!r}".encode())
            h.update(_bytes(self.surface.pose))
        return h.hexdigest()[:12]

    def without(self, ids: Iterable[str]) -> Structure:
        """The structure less some holds.

        Raises:
            UnknownNameError: no such hold. ShapeError: none would be left, or a text instead of several ids.
        """
        if isinstance(ids, str):
            raise ShapeError("ids", ids, "expected several ids, not one text")
        gone = {self.holds[self.index(hold)].id for hold in ids}
        kept = tuple(hold for hold in self.holds if hold.id not in gone)
        return Structure(self.name, kept, self.obstacles, self.surface)

    def moved(self, pose: Any) -> Structure:
        """The structure moved by ``pose``: every frame T becomes pose T.

        Raises:
            ShapeError, NotFiniteError, RotationError: a bad pose.
        """
        by = validation.pose("pose", pose)
        surface = None if self.surface is None else self.surface.moved(by)
        holds = tuple(hold.moved(by) for hold in self.holds)
        return Structure(self.name, holds, tuple(o.moved(by) for o in self.obstacles), surface)

    def clearance(self, points: Any) -> Array:
        """Signed distance [m] of points ``[..., 3]`` from the structure; negative inside.

        The least of the height above the surface and the distances from the obstacles. A structure with neither has
        the height above the tangent plane of the nearest hold.

        Raises:
            ShapeError, NotFiniteError: not finite numbers, three a point.
        """
        array = _points("points", points)
        heights = [obstacle.distance(array) for obstacle in self.obstacles]
        if self.surface is not None:
            heights.append(self.surface.height(array))
        return np.asarray(np.min(heights, axis=0)) if heights else self._above_nearest(array)

    def segment_clearance(self, a: Any, b: Any) -> Array:
        """Least :meth:`clearance` [m] on the segments from ``a`` to ``b``, ``[..., 3]`` each.

        A capsule's clearance is that of its core less its radius. Exact for surfaces, capsules and spheres, within
        1e-9 m for boxes and cylinders; of meshes see :meth:`Obstacle.segment_distance`. For a structure with neither
        surface nor obstacles it is that of the ends.

        Raises:
            ShapeError, NotFiniteError: not finite numbers, three a point.
        """
        first, second = np.broadcast_arrays(_points("a", a), _points("b", b))
        heights = [obstacle.segment_distance(first, second) for obstacle in self.obstacles]
        if self.surface is not None:
            heights.append(self.surface.segment_height(first, second))
        if not heights:
            return np.minimum(self._above_nearest(first), self._above_nearest(second))
        return np.asarray(np.min(heights, axis=0))

    def _above_nearest(self, points: Array) -> Array:
        """Height above the plane through the nearest hold, across its axis."""
        offset = points[..., None, :] - self.positions
        near = np.argmin((offset**2).sum(axis=-1), axis=-1)
        chosen = np.take_along_axis(offset, near[..., None, None], axis=-2)[..., 0, :]
        out: Array = -(chosen * self.axes[near]).sum(axis=-1)
        return out


def _points(field: str, value: Any) -> Array:
    array = validation.real_array(field, value)
    if array.ndim < 1 or array.shape[-1] != 3:
        raise ShapeError(field, value, "expected three numbers a point")
    return array


def _frozen(array: Array) -> Array:
    array.flags.writeable = False
    return array


def _bytes(pose: pin.SE3) -> bytes:
    """The numbers of a pose; 0 and -0 are one."""
    return bytes((pose.homogeneous + 0.0).tobytes())
