"""What stands around a walker: whether its body and its arms are clear of surface and obstacles, and of themselves.

A hand may be nearer than the clearance to what its own hold is mounted on while it is there, and its core no deeper
in it than :data:`DEEP`. Of motions the search knows instants; between two of them a straight line of the arm's points
stands for what is between, and where the middle is farther from everything than any point goes, all of it is clear.
"""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Sequence
from math import cos, radians

import numpy as np
from numpy.typing import NDArray

from wbc.clearance import TriangleMesh
from wbc.geometry import segment_distances
from wbc.robots import Walker
from wbc.shapes import Box, Cylinder, Sphere
from wbc.validation import Array
from wbc.walking.arms.puma import limb_of
from wbc.walking.holds.obstacle import Obstacle
from wbc.walking.holds.structure import Structure
from wbc.walking.holds.surface import CylinderSurface
from wbc.walking.native import compiled

Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

#: A hold is mounted on what is this near to it; a hand's core may be so deep in that [m]
MOUNTED, DEEP = 0.005, 0.0045
#: Of what the way between two instants is looked at no more closely [m]; of native/world.h
FINELY = 2.5e-3
#: The joint that the body is on, of a model with a free base
BODY_JOINT = 1
#: Holds whose axes are between these angles off a surface's normal stand aslant [rad]
STRAIGHT, ASLANT = radians(0.5), radians(45.0)
#: Nothing is met
NONE_MET = -1
#: Triangles of a leaf of a tree of boxes
LEAF = 4


class Around:
    """Surface and obstacles of a structure, and the bodies of a walker that must be clear of them.

    Attributes:
        names: of what may be met: obstacles, the surface, and the arm's own body.
    """

    def __init__(self, walker: Walker, structure: Structure) -> None:
        self.limb = limb = limb_of(walker)
        self.structure, self.arms = structure, len(walker.arms)
        tolerances, margins = walker.arm_data, walker.margins
        self.names = (*(f"obstacle {one.id}" for one in structure.obstacles), "the surface", "the walker itself")
        self.bases = np.array([arm.base.homogeneous for arm in walker.arms])
        self.body = _body_of(walker, self.bases)
        radii = np.array(limb.radii)
        self.radii = radii
        self.from_things = radii + tolerances.clearance + margins.swing_clearance
        self.from_surface = radii + tolerances.clearance + margins.surface_clearance
        self.of_body = tolerances.clearance + margins.swing_clearance
        self.near_hold = tolerances.exempt_distance
        self.own = self._own(walker) if limb.closed_form is not None else np.zeros((self.arms, 0, 7))
        self.plain = structure.surface is None and not structure.obstacles
        self._world: World | None = None

    @property
    def world(self) -> World | None:
        """For compiled code; None where there is none, or nothing stands around but holds."""
        if self.plain or compiled.library_for(self.limb) is None:
            return None
        if self._world is None:
            self._world = World(self)
        return self._world

    @functools.cached_property
    def mounted(self) -> Flags:
        """Which holds are mounted on what: obstacles, and the surface last ``[holds, things + 1]``."""
        structure, at = self.structure, self.structure.positions
        columns = [np.abs(one.distance(at)) <= MOUNTED for one in structure.obstacles]
        surface = structure.surface
        columns.append(np.zeros(len(at), bool) if surface is None else np.abs(surface.height(at)) <= MOUNTED)
        return np.ascontiguousarray(np.stack(columns, axis=1))

    @functools.cached_property
    def approaches(self) -> Array:
        """Directions in which hands come to holds ``[holds, 3]``: those of the holds, but straight onto a surface on
        which they stand aslant. There a hand that comes along the hold's own axis is too near to the surface as it gets
        to where it may be near.
        """
        structure, surface = self.structure, self.structure.surface
        out: Array = structure.axes.copy()
        if surface is not None:
            straight = -surface.normal(structure.positions)
            cosine = (straight * out).sum(axis=1)
            slants = self.mounted[:, -1] & (cosine < cos(STRAIGHT)) & (cosine > cos(ASLANT))
            out[slants] = straight[slants]
        return out

    def bodies(self, poses: Array, more: float = 0.0) -> Ints:
        """What the body meets at poses ``[n, 4, 4]``: an index of :attr:`names`, :data:`NONE_MET` for nothing.

        Args:
            more: that it keeps beyond what it must [m].
        """
        out = np.full(len(poses), NONE_MET, dtype=np.int64)
        world = self.world
        if world is not None:
            library, given = compiled.library(), compiled.packed(poses)
            assert library is not None
            sizes = ctypes.c_double(more), ctypes.c_long(len(poses))
            library.bodies_meet(world.pointer, *sizes, compiled.at(given), compiled.at(out))
            return out
        if self.plain:
            return out
        turn, origin = poses[:, None, :3, :3], poses[:, None, :3, 3]
        a, b = ((turn @ self.body[:, part, None])[..., 0] + origin for part in (slice(0, 3), slice(3, 6)))
        for k in range(len(self.names) - 2, -1, -1):
            near = (self._gap(k, a, b) < self.body[:, 6] + self.of_body + more).any(axis=1)
            out[near] = k
        return out

    def postures(self, arm: int, frames: Array, q: Array, holds: Ints) -> Ints:
        """What arms (all of one row) meet.

        Args:
            frames: of the arm's base in the structure ``[n, 4, 4]``. q: joints ``[n, joints]`` [rad]. holds: rows that
                hands are at ``[n]``.
        """
        count, both = len(q), np.stack([holds, np.full(len(holds), -1)], axis=1).astype(np.int64)
        world = self.world
        if world is not None:
            library, out = compiled.library(), np.empty(count, dtype=np.int64)
            assert library is not None
            given = [compiled.packed(frames), compiled.packed(q), np.ascontiguousarray(both), out]
            library.postures_meet(
                world.pointer,
                compiled.arm_of(self.limb),
                ctypes.c_long(arm),
                ctypes.c_long(count),
                *map(compiled.at, given),
            )
            return out
        local = np.asarray(self.limb.points(q))
        placed = np.einsum("nij,npj->npi", frames[:, :3, :3], local) + frames[:, None, :3, 3]
        out = self._arm_meets(placed, both, np.zeros(count))
        out[self._meets_itself(np.full(count, arm), local, np.zeros(count))] = len(self.names) - 1
        return out

    def swings(self, arms: Ints, points: Array, bodies: Array, holds: Ints) -> Flags:
        """Whether swinging arms are clear ``[m]``.

        Args:
            arms: rows ``[m]``. points: in the body's frame ``[m, n, points, 3]`` [m]. bodies: where the body
                is ``[m, n, 4, 4]``. holds: rows of the holds that hands leave and come to, -1 for none ``[m, 2]``.
        """
        world = self.world
        if world is not None:
            library, out = compiled.library(), np.empty(len(arms), dtype=np.bool_)
            assert library is not None
            rows, ends = (np.ascontiguousarray(a, dtype=np.int64) for a in (arms, holds))
            given = [rows, *(compiled.packed(a) for a in (points, self.bases[arms], bodies)), ends, out]
            sizes = (ctypes.c_long(size) for size in points.shape[:2])
            library.swings_meet(world.pointer, *sizes, *map(compiled.at, given))
            return out
        base = self.bases[arms]
        local = np.einsum("mji,mnpj->mnpi", base[:, :3, :3], points - base[:, None, None, :3, 3])
        placed = np.einsum("mnij,mnpj->mnpi", bodies[..., :3, :3], points) + bodies[..., None, :3, 3]
        count, n = points.shape[:2]
        who, ends = np.repeat(np.arange(count), n), np.asarray(holds, dtype=np.int64)
        flat = [a.reshape(-1, *a.shape[2:]) for a in (local, placed)]
        clear = np.ones(count, dtype=np.bool_)
        clear[who[self._meets(arms[who], flat, ends[who], np.zeros(len(who)))]] = False
        self._between(arms, local, placed, ends, clear)
        return clear

    def _between(self, arms: Ints, local: Array, placed: Array, holds: Ints, clear: Flags) -> None:
        """Marks swings that are not clear between their instants."""
        count, n = local.shape[:2]
        who = np.repeat(np.arange(count), n - 1)
        spans = [np.stack([a[:, :-1], a[:, 1:]], axis=2).reshape(-1, 2, *a.shape[2:]) for a in (local, placed)]
        while True:
            left = clear[who]
            who, spans = who[left], [a[left] for a in spans]
            if not len(who):
                return
            middle = [a.mean(axis=1) for a in spans]
            half = 0.5 * np.linalg.norm(spans[1][:, 1] - spans[1][:, 0], axis=2)[:, self._moving].max(axis=1)
            open_ = self._meets(arms[who], middle, holds[who], half)
            who, spans, middle, half = who[open_], [a[open_] for a in spans], [a[open_] for a in middle], half[open_]
            clear[who[self._meets(arms[who], middle, holds[who], np.zeros(len(who)))]] = False
            on = half >= FINELY
            who, spans, middle = who[on], [a[on] for a in spans], [a[on] for a in middle]
            spans = [
                np.concatenate([np.stack([a[:, 0], m], axis=1), np.stack([m, a[:, 1]], axis=1)])
                for a, m in zip(spans, middle, strict=True)
            ]
            who = np.concatenate([who, who])

    def height(self, points: Array) -> Array:
        """Distance of points of the structure's frame ``[..., 3]`` from surface and obstacles [m]."""
        world = self.world
        if world is None:
            return self.structure.clearance(points)
        library, given = compiled.library(), compiled.packed(points)
        assert library is not None
        out = np.empty(given.shape[:-1])
        library.heights(world.pointer, ctypes.c_long(out.size), compiled.at(given), compiled.at(out))
        return out

    @functools.cached_property
    def _moving(self) -> list[int]:
        """Points of an arm that joints move."""
        return sorted({end for link in self.limb.links[self.limb.still :] for end in link})

    def _meets(self, arms: Ints, points: Sequence[Array], holds: Ints, more: Array) -> Flags:
        """Whether arms are nearer to anything than they may be, and ``more`` [m]; points in the bases, and placed."""
        local, placed = points
        return np.asarray((self._arm_meets(placed, holds, more) != NONE_MET) | self._meets_itself(arms, local, more))

    def _gap(self, thing: int, a: Array, b: Array) -> Array:
        """Distances of segments from an obstacle, or the surface."""
        obstacles, surface = self.structure.obstacles, self.structure.surface
        if thing < len(obstacles):
            return obstacles[thing].segment_distance(a, b)
        return np.full(a.shape[:-1], np.inf) if surface is None else surface.segment_height(a, b)

    def _arm_meets(self, placed: Array, holds: Ints, more: Array) -> Ints:
        """The first thing that arms are nearer to than they may be; points in the structure ``[n, points, 3]``."""
        out, limb, hand = np.full(len(placed), NONE_MET, dtype=np.int64), self.limb, len(self.limb.links) - 1
        if self.plain or not len(placed):
            return out
        there = holds >= 0
        gaps = np.linalg.norm(placed[:, None, limb.links[hand][1]] - self.structure.positions[holds], axis=2)
        touching = there & (gaps <= self.near_hold)
        last = len(self.structure.obstacles)
        for link in range(hand, limb.still - 1, -1):
            a, b = (placed[:, end] for end in limb.links[link])
            for k in range(last, -1, -1):
                least = (self.from_surface if k == last else self.from_things)[link] + more
                if link == hand:
                    mounted = there & self.mounted[holds, k]
                    least = np.where(mounted.any(axis=1), np.minimum(least, self.from_surface[link] + more), least)
                    least = np.where((mounted & touching).any(axis=1), -DEEP, least)
                out[self._gap(k, a, b) < least] = k
        return out

    def _meets_itself(self, arms: Ints, local: Array, more: Array) -> Flags:
        """Whether links are nearer to the body, or to the arm's other links, than they may be; points in the bases."""
        out, limb = np.zeros(len(local), dtype=np.bool_), self.limb
        if not self.own.shape[1] or not len(local):
            return out
        still, count = limb.still, len(limb.links)
        for link in range(still + 1, count):
            a, b = (local[:, end] for end in limb.links[link])
            for segment in range(self.own.shape[1]):
                other = self.own[arms, segment]
                gap = segment_distances(a, b, other[:, :3], other[:, 3:6])
                out |= (gap < self.of_body + more + self.radii[link] + other[:, 6]) & (other[:, 6] >= 0.0)
        for one in range(still, count):
            for other in range(one + 2, count):
                ends = [local[:, end] for end in (*limb.links[one], *limb.links[other])]
                out |= segment_distances(*ends) < self.of_body + more + self.radii[one] + self.radii[other]
        return out

    def _own(self, walker: Walker) -> Array:
        """:attr:`body` in the frames of the arms' bases; a radius below 0 where another check looks."""
        out = np.repeat(self.body[None], self.arms, axis=0)
        shapes = len(self.body) - self.arms * self.limb.still
        for k, arm in enumerate(walker.arms):
            for end in (slice(0, 3), slice(3, 6)):
                out[k, :, end] = (self.body[:, end] - arm.base.translation) @ arm.base.rotation
            others = np.ones(len(self.body), dtype=bool)
            others[:shapes] = False
            others[shapes + k * self.limb.still : shapes + (k + 1) * self.limb.still] = False
            out[k, others, 6] = -1.0
        return np.ascontiguousarray(out)


@functools.lru_cache(maxsize=4)
def around(walker: Walker, structure: Structure) -> Around:
    """What stands around; kept from plan to plan."""
    return Around(walker, structure)


class _Thing(ctypes.Structure):
    """Thing of native/world.h."""

    _fields_ = [
        *((name, ctypes.c_long) for name in ("kind", "root")),
        *((name, ctypes.c_double * size) for name, size in (("turn", 9), ("origin", 3), ("size", 3), ("middle", 3))),
        ("reach", ctypes.c_double),
    ]


_SIXES = ("radii", "from_things", "from_surface")


class _World(ctypes.Structure):
    """World of native/world.h."""

    _fields_ = [
        ("surface", ctypes.c_void_p),
        *((name, ctypes.c_long) for name in ("things", "bodies", "holds")),
        ("thing", ctypes.c_void_p),
        *((name, ctypes.c_void_p) for name in ("children", "boxes", "triangles", "body", "own", "places", "mounted")),
        *((name, ctypes.c_double * 4) for name in _SIXES),
        *((name, ctypes.c_double) for name in ("of_body", "near_hold", "deep", "from_own")),
    ]


class World:
    """Numbers of what stands around, as compiled code wants them; they live as long as this.

    Attributes:
        pointer: to them. approaches: of :class:`Around`.
    """

    def __init__(self, it: Around) -> None:
        structure, trees = it.structure, _Trees()
        surface = structure.surface
        line = None
        if surface is not None:
            radius = surface.radius if isinstance(surface, CylinderSurface) else 0.0
            line = compiled.doubles([*surface.pose.translation, *surface.pose.rotation[:, 2], radius])
        things = (_Thing * max(len(structure.obstacles), 1))(*(_thing(one, trees) for one in structure.obstacles))
        arrays = {
            "children": np.array(trees.children, dtype=np.int64).reshape(-1, 2),
            "boxes": np.array(trees.boxes).reshape(-1, 6),
            "triangles": np.array(trees.triangles).reshape(-1, 9),
            "body": compiled.packed(it.body),
            "own": compiled.packed(it.own),
            "places": compiled.packed(structure.positions),
        }
        self._world = _World(
            surface=None if line is None else ctypes.cast(line, ctypes.c_void_p),
            things=len(structure.obstacles),
            bodies=len(it.body),
            holds=len(structure),
            thing=ctypes.cast(things, ctypes.c_void_p),
            of_body=it.of_body,
            near_hold=it.near_hold,
            deep=DEEP,
            from_own=it.of_body,
            **{name: array.ctypes.data for name, array in arrays.items()},
            **{name: (ctypes.c_double * 4)(*getattr(it, name)) for name in _SIXES},
        )
        self._kept = line, things, arrays
        self.pointer = ctypes.byref(self._world)
        mounted = self._mounted(len(structure), len(structure.obstacles) + 1)
        self._world.mounted = mounted.ctypes.data
        it.__dict__["mounted"] = mounted
        self.approaches = it.approaches

    def _mounted(self, holds: int, things: int) -> Flags:
        """As :attr:`Around.mounted`, without a look at every triangle."""
        library, out = compiled.library(), np.zeros((holds, things), dtype=np.bool_)
        assert library is not None
        library.holds_on(self.pointer, ctypes.c_double(MOUNTED), compiled.at(out))
        return out


class _Trees:
    """Triangles of closed surfaces, each in a tree of boxes."""

    def __init__(self) -> None:
        self.children, self.boxes, self.triangles = list[list[int]](), list[Array](), list[Array]()

    def grow(self, corners: Array) -> int:
        """Another tree; its root."""
        here, low, high = len(self.children), corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        self.children.append([0, 0])
        self.boxes.append(np.concatenate([low, high]))
        if len(corners) <= LEAF:
            first = len(self.triangles)
            self.children[here] = [-1 - first, -first - len(corners)]
            self.triangles += [face.ravel() for face in corners]
            return here
        order = np.argsort(corners.mean(axis=1)[:, int(np.argmax(high - low))], kind="stable")
        half = len(order) // 2
        self.children[here] = [self.grow(corners[order[some]]) for some in (slice(half), slice(half, None))]
        return here


def _thing(one: Obstacle, trees: _Trees) -> _Thing:
    shape, placement, root = one.shape, one.placement, -1
    middle, size = placement.translation, np.zeros(3)
    if isinstance(shape, TriangleMesh):
        kind, root = 3, trees.grow(shape.corners)
        points = shape.corners.reshape(-1, 3)
        center = (points.min(axis=0) + points.max(axis=0)) / 2.0
        reach, middle = float(np.linalg.norm(points - center, axis=1).max()), placement.act(center)
    elif isinstance(shape, Box):
        kind, size = 1, np.array(shape.size) / 2.0
        reach = float(np.linalg.norm(size))
    else:
        half = 0.0 if isinstance(shape, Sphere) else shape.length / 2.0
        kind, size = (2 if isinstance(shape, Cylinder) else 0), np.array([shape.radius, half, 0.0])
        reach = float(np.hypot(shape.radius, half)) if kind else shape.radius + half
    turn = (ctypes.c_double * 9)(*placement.rotation.ravel())
    numbers = [(ctypes.c_double * 3)(*row) for row in (placement.translation, size, middle)]
    return _Thing(kind, root, turn, *numbers, reach)


def _body_of(walker: Walker, bases: Array) -> Array:
    """Segments of the body's shapes and of the links that stand still on it: ends and radius ``[n, 7]`` [m]."""
    limb, rows, model = limb_of(walker), list[Array](), walker.robot.model
    for link, shapes in walker.robot.shapes.items():
        frame = model.frames[model.getFrameId(link)]
        if int(frame.parentJoint) == BODY_JOINT:
            for a, b, radius in (placed.capsule() for placed in shapes):
                rows.append(np.array([*(frame.placement * a), *(frame.placement * b), radius]))
    points = np.asarray(limb.points(np.zeros((1, len(limb.position_limits)))))[0]
    for base in bases:
        for pair, radius in zip(limb.links[: limb.still], limb.radii, strict=False):
            ends = points[list(pair)] @ base[:3, :3].T + base[:3, 3]
            rows.append(np.array([*ends[0], *ends[1], radius]))
    return np.array(rows).reshape(-1, 7)
