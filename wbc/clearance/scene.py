"""Bodies on the frames of a tree, and which of them must keep which distance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, inf, pi
from typing import Any

import numpy as np

from wbc import validation
from wbc.clearance.tree import Moves, Tree
from wbc.clearance.triangle_mesh import TriangleMesh
from wbc.errors import DuplicateNameError, ShapeError, UnknownNameError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.shapes import Geometry, HalfSpace, Solid
from wbc.shapes.solid import Kind, why_apart
from wbc.shapes.surfaces import between_rows
from wbc.validation import Array


@dataclass(frozen=True)
class _Endless(Geometry):
    radius: float

    def __post_init__(self) -> None:
        validation.own_scalars(self, "radius", low=0.0, open_low=True, unit="m")

    @property
    def sizes(self) -> tuple[float, float, float, float, float]:
        return (0.0, 0.0, 0.0, self.radius, 0.0)


@dataclass(frozen=True)
class CylinderInside(_Endless):
    """The wall round the endless cylinder of ``radius`` [m] about z: distances count from the wall inwards."""

    kind = Kind.TUBE


@dataclass(frozen=True)
class EndlessCylinder(_Endless):
    """Points within ``radius`` [m] of the z axis."""

    kind = Kind.ROD


#: Those that have no end, and are fixed in the world
Unbounded = HalfSpace | CylinderInside | EndlessCylinder
Shape = Solid | TriangleMesh | Unbounded


def patch_of(shape: Unbounded, low: Sequence[float], high: Sequence[float], facets: int) -> Array:
    """Triangles of a part of a surface without end, ``(n, 3, 3)`` [m]: between bounds of x and y of a half-space [m],
    of the angle [rad] and z [m] of a cylinder, which has so many facets round it.
    """
    if isinstance(shape, HalfSpace):
        x, y = np.meshgrid([low[0], high[0]], [low[1], high[1]])
        return between_rows(np.stack([x, y, np.zeros_like(x)], axis=2))
    count = max(2, ceil((high[0] - low[0]) / (2.0 * pi) * facets - 1e-9) + 1)
    angle, z = np.meshgrid(np.linspace(low[0], high[0], count), [low[1], high[1]])
    return between_rows(np.stack([shape.radius * np.cos(angle), shape.radius * np.sin(angle), z], axis=2))


@dataclass(frozen=True, eq=False)
class SweptBody:
    """A shape on a link of a tree, to be swept.

    Attributes:
        name: unique in a scene.
        shape: solid, a surface of triangles, or one without end, which is fixed in the world.
        link: of the tree; "world": fixed.
        placement: on the link; None: its frame.
        grasp: where the body, a hand, grasps [3] m in the link's frame; what exemptions are about.
    """

    name: str
    shape: Shape
    link: str = "world"
    placement: pin.SE3 | None = None
    grasp: Any = None


@dataclass(frozen=True)
class Pair:
    """Two bodies, by name, and the distance that they must keep [m]."""

    first: str
    second: str
    required: float = 0.0


@dataclass(frozen=True, eq=False)
class Exemption:
    """A hand may be nearer to what its hold is mounted on. With its grasp point d away from ``point`` (the hold's, in
    the world) this distance is enough, where it is less than the pair's own:

        slope d - depth

    Attributes:
        hand, mount: bodies, the first with a grasp point, the second fixed in the world.
        slope: [1]. depth: [m].
        since, until: from when to when it holds [s]; taken to the whole knots within.
    """

    hand: str
    mount: str
    point: Any
    slope: float
    depth: float = 0.0
    since: float = -inf
    until: float = inf


def bodies_of(robot: Robot) -> list[SweptBody]:
    """The collision shapes of a robot's links, by the link's name; from a link's second on with ", body 2" and so
    on.
    """
    return [
        SweptBody(link if k == 0 else f"{link}, body {k + 1}", placed.shape, link, placed.placement)
        for link, group in robot.shapes.items()
        for k, placed in enumerate(group)
    ]


def self_pairs(robot: Robot, required: float = 0.0) -> list[Pair]:
    """Pairs of :func:`bodies_of` on links that must not touch (``robot.self_pairs``).

    Raises:
        ShapeError: the robot's are not chosen yet.
    """
    if robot.self_pairs is None:
        raise ShapeError("robot.self_pairs", None, "pairs of links are not chosen yet, see find_self_pairs")
    on: dict[str, list[str]] = {}
    for body in bodies_of(robot):
        on.setdefault(body.link, []).append(body.name)
    return [Pair(a, b, required) for one, other in robot.self_pairs for a in on.get(one, ()) for b in on.get(other, ())]


class SweptScene:
    """Bodies of a tree and their pairs, as arrays; kept, and swept again and again.

    Attributes:
        tree, bodies, pairs: as given.
        frame: numbers of the bodies' frames, -1: the world. place: poses on them, moved to the shapes' centres.
        line: [bodies, 8]: ends of a capsule about the body in its frame, its radius, and the radius about the ends of
            what turns with the body: 0 where its core is all, more where there is a grasp point.
        chain: frames with joints from the body's on, up to the world.
        first, second: numbers of the pairs' bodies. stops: how many frames of the chains move the two apart, [pairs,
            2].

    Raises:
        DuplicateNameError: two bodies of a name. UnknownNameError: no such link or body. ShapeError: a shape without
            end on a link that moves; a pair of which neither is a solid. RangeError: a required distance that is no
            number.
    """

    def __init__(self, tree: Tree, bodies: Sequence[SweptBody], pairs: Sequence[Pair]) -> None:
        self.tree = validation.instance("tree", tree, Tree, "a Tree")
        self.bodies: tuple[SweptBody, ...] = validation.items("bodies", bodies, "Bodies")
        self.pairs: tuple[Pair, ...] = validation.items("pairs", pairs, "Pairs")
        self.number: dict[str, int] = {}
        for k, body in enumerate(self.bodies):
            validation.name(
                f"bodies[{k}].name", validation.instance(f"bodies[{k}]", body, SweptBody, "a SweptBody").name
            )
            if body.name in self.number:
                raise DuplicateNameError("bodies", body.name, "two of this name")
            self.number[body.name] = k
        placed = [self._place(body) for body in self.bodies]
        self.frame = np.array([frame for frame, _ in placed], dtype=np.int32)
        self.place = [pose for _, pose in placed]
        self.line = np.array([_line(body, *self._on_frame(body)) for body in self.bodies]).reshape(-1, 8)
        moving = {k for k, frame in enumerate(tree.frames) if frame.moves != Moves.FIXED}
        self.chain = [[f for f in tree.up(int(frame)) if f in moving] for frame in self.frame]
        for k, body in enumerate(self.bodies):
            if isinstance(body.shape, Unbounded) and self.chain[k]:
                raise ShapeError(f"{body.name}.shape", body.shape, "a shape without end is fixed in the world")
        for k, pair in enumerate(self.pairs):
            validation.instance(f"pairs[{k}]", pair, Pair, "a Pair")
        ends = [(self._known("pairs", pair.first), self._known("pairs", pair.second)) for pair in self.pairs]
        self._rows = {end: k for k, end in enumerate(ends)}
        self.first, self.second = (np.array([end[k] for end in ends], dtype=np.int32) for k in (0, 1))
        for pair, (i, j) in zip(self.pairs, ends, strict=True):
            if reason := why_apart(self.bodies[i].shape, self.bodies[j].shape):
                raise ShapeError("pairs", (pair.first, pair.second), reason)
            validation.scalar(f"required of {pair.first} and {pair.second}", pair.required, unit="m")
        self.required = np.array([float(pair.required) for pair in self.pairs])
        self.stops = np.array([self._stops(*end) for end in ends], dtype=np.int32).reshape(-1, 2)

    def named(self, pair: int) -> str:
        """Both bodies of a pair."""
        return f"{self.pairs[pair].first} and {self.pairs[pair].second}"

    def exempt(self, exemptions: Sequence[Exemption], times: Array) -> list[tuple[int, int, int, int, Array]]:
        """(pair, first and last knot, which of the two is the hand, numbers of native/sweep.h), pair by pair.

        Raises:
            UnknownNameError, ShapeError, RangeError: an exemption that names no pair or has no such numbers.
        """
        found = []
        for e, exemption in enumerate(validation.items("exemptions", exemptions, "Exemptions")):
            field = f"exemptions[{e}]"
            validation.instance(field, exemption, Exemption, "an Exemption")
            hand, mount = (self._known(field, name) for name in (exemption.hand, exemption.mount))
            if self.bodies[hand].grasp is None:
                raise ShapeError(f"{field}.hand", exemption.hand, "this body has no grasp point")
            if self.chain[mount]:
                raise ShapeError(f"{field}.mount", exemption.mount, "expected a body that is fixed in the world")
            pair = self._rows.get((hand, mount), self._rows.get((mount, hand)))
            if pair is None:
                names = [f"{self.pairs[k].first} and {self.pairs[k].second}" for k in range(len(self.pairs))]
                raise UnknownNameError(field, f"{exemption.hand} and {exemption.mount}", names)
            point = validation.real_array(f"{field}.point", exemption.point, (3,))
            slope = validation.scalar(f"{field}.slope", exemption.slope, low=0.0)
            depth = validation.scalar(f"{field}.depth", exemption.depth, low=0.0, unit="m")
            since = int(np.searchsorted(times, exemption.since))
            until = int(np.searchsorted(times, exemption.until, side="right")) - 1
            _, on_frame = self._on_frame(self.bodies[hand])
            grasp = on_frame * validation.real_array("grasp", self.bodies[hand].grasp, (3,))
            numbers = np.concatenate([grasp, point, [slope, depth]])
            found.append((pair, since, until, int(self.first[pair] != hand), numbers))
        return sorted(found, key=lambda entry: entry[0])

    def _known(self, field: str, name: str) -> int:
        return self.number[validation.one_of(field, name, tuple(self.number))]

    def _on_frame(self, body: SweptBody) -> tuple[pin.SE3, pin.SE3]:
        """(pose of the shape, pose of the link) on the frame."""
        _, link = self.tree.link(f"{body.name}.link", body.link)
        if body.placement is None:
            return link, link
        return link * validation.pose(f"{body.name}.placement", body.placement), link

    def _place(self, body: SweptBody) -> tuple[int, pin.SE3]:
        if not isinstance(body.shape, Shape):
            raise ShapeError(
                f"{body.name}.shape", body.shape, "expected a solid, a surface of triangles or one without end"
            )
        frame, _ = self.tree.link(f"{body.name}.link", body.link)
        return frame, self._on_frame(body)[0] * pin.SE3(np.eye(3), body.shape.center)

    def _stops(self, i: int, j: int) -> tuple[int, int]:
        """What carries both moves neither against the other."""
        one, other = self.chain[i], self.chain[j]
        both = set(one) & set(other)
        return sum(f not in both for f in one), sum(f not in both for f in other)


def _line(body: SweptBody, shape: pin.SE3, link: pin.SE3) -> Array:
    if isinstance(body.shape, Unbounded):
        return np.zeros(8)
    a, b, radius = body.shape.capsule()
    a, b = shape * a, shape * b
    # The ball on a core is the same however it is turned
    most = 0.0 if body.shape.is_round else radius
    if body.grasp is not None:
        x, span = link * validation.real_array(f"{body.name}.grasp", body.grasp, (3,)), b - a
        part = np.clip((x - a) @ span / max(span @ span, 1e-300), 0.0, 1.0)
        most = max(most, float(np.linalg.norm(x - a - part * span)))
    return np.array([*a, *b, radius, most])
