"""Signed distances of shapes as expressions, one or more rows a pair; negative where the shapes overlap.

    sphere    to sphere, capsule, box, cylinder     distance of the centre to the other shape, less the radius
    capsule   to capsule                            distance of the two core segments, less both radii; and of each end
    capsule   to box, cylinder                      distances of its two end spheres, see :func:`is_sensed`
    any solid to half-space                         height of the lowest points, see :func:`plane_rows`

Inside a box or cylinder the distance of a centre is minus the shortest way out. Gradients with respect to places
are unit vectors everywhere. Where a distance has no direction it is declared: from the first shape to the second

    centres of spheres coincide                         down (-z of the world)
    centre on the core of a capsule                     from the sphere to the capsule: the capsule's x axis
    cores of capsules cross                             perpendicular to both; the first one's x axis if parallel
    centre inside a box or cylinder, several exits      the sphere leaves along the first of x, y, z (box), along the
                                                        axis (cylinder), through the positive face from the middle

To that end the first three move one shape by :data:`wbc.tasks._nearest.SHIFT` times its size.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import casadi as ca
import numpy as np

from wbc.multibody import pin
from wbc.shapes import Box, Capsule, Convex, Cylinder, HalfSpace, PlacedShape, Shape, Solid, Sphere
from wbc.symbolic import rotations as rot
from wbc.symbolic.gaps import Gap
from wbc.symbolic.kinematics import WORLD, Pose
from wbc.symbolic.tracer import Tracer
from wbc.tasks._nearest import COINCIDENT, SHIFT, between, clamp, out_of_box, out_of_cylinder
from wbc.validation import Array

#: sin^2 of the angle between the axes of capsules, added so that parallel ones have nearest points. Within about its
#: root (1e-4 rad) of parallel these run from one end of the overlap to the other, and the direction of the row's
#: moment with them; the distance is then too large by less than PARALLEL length^2 / distance.
PARALLEL = 1e-8

#: Rows of two capsules: the nearest points; the ends of the first, then those of the second, each with the other
#: capsule. Parallel ones would rock on the first row alone, whose points jump from one end of the overlap to the other.
CAPSULES = ("", ".start-", ".end-", "-.start", "-.end")

#: A convex hull with at most this many vertices has a row a vertex over a half-space, else one row for the lowest.
VERTEX_ROWS = 12

#: A convex hull with more vertices than this has no expression over a half-space.
SUPPORT_VERTICES = 64


@dataclass(frozen=True, eq=False)
class Placed:
    """A shape in the world as expressions.

    Attributes:
        shape: a capsule without length is a sphere.
        frame: the frame that carries it; ``"world"`` if no joint does.
        pose: of the shape in the world.
        placement: of the shape in its frame.
    """

    shape: Shape
    frame: str
    pose: Pose
    placement: pin.SE3

    def offset(self, local: Array) -> tuple[float, float, float]:
        """A point given in the shape's frame, in the frame that carries it."""
        x, y, z = (float(c) for c in self.placement.act(local))
        return (x, y, z)


def on_link(kin: Tracer, link: str, placed: PlacedShape) -> Placed:
    """A shape of a link."""
    fixed = Pose(rot.constant(placed.placement.rotation), rot.constant(placed.placement.translation))
    return Placed(core(placed.shape), link, kin.pose(link).times(fixed), placed.placement)


def in_world(shape: Shape, pose: Pose) -> Placed:
    """A shape at a pose that no joint moves."""
    return Placed(core(shape), WORLD, pose, pin.SE3.Identity())


def core(shape: Shape) -> Shape:
    """The shape; a sphere for a capsule without length."""
    return Sphere(shape.radius) if isinstance(shape, Capsule) and shape.length == 0.0 else shape


def plane_rows(solid: Solid) -> tuple[str, ...]:
    """Names of the rows of a solid over a half-space; none for a convex hull of many vertices, and for other solids.

        sphere          ``""``
        capsule         ``.start``, ``.end``      ends of the core
        cylinder        ``.start``, ``.end``      lowest point of each rim; it jumps where the disc is level
        box             ``.---`` to ``.+++``      corners
        convex hull     ``.0``, ``.1``, ...       vertices, up to :data:`VERTEX_ROWS`
                        ``""``                    lowest vertex, for more; it jumps where an edge or a face is level

    So rows are smooth where a solid may lie flat on the plane, save for round and finely faceted ones.
    """
    shape = core(solid)
    if isinstance(shape, (Capsule, Cylinder)):
        return (".start", ".end")
    if isinstance(shape, Box):
        return tuple("." + "".join(signs) for signs in itertools.product("-+", repeat=3))
    if isinstance(shape, Convex) and len(shape.points) <= VERTEX_ROWS:
        return tuple(f".{k}" for k in range(len(shape.points)))
    lowest = isinstance(shape, Sphere) or (isinstance(shape, Convex) and len(shape.points) <= SUPPORT_VERTICES)
    return ("",) if lowest else ()


def pair_rows(first: Solid, second: Shape) -> tuple[str, ...]:
    """Names of the rows of a pair that are expressions; none if there are no such."""
    if isinstance(second, HalfSpace):
        return plane_rows(first)
    kinds = {type(core(first)), type(core(second))}
    if Sphere in kinds and kinds <= {Sphere, Capsule, Box, Cylinder}:
        return ("",)
    if kinds == {Capsule}:
        return CAPSULES
    return (".start", ".end") if kinds in ({Capsule, Box}, {Capsule, Cylinder}) else ()


def is_sensed(first: Solid, second: Shape) -> bool:
    """Whether the distance of a pair is more than its rows say, so that a sensor has to measure it.

    So it is for pairs without rows, and for a capsule with a box or a cylinder: its rows are for its ends, which keep
    it from rocking on a face when the nearest point jumps from one end to the other; in between it is sensed.
    """
    rows = pair_rows(first, second)
    return not rows or (rows == (".start", ".end") and not isinstance(second, HalfSpace))


def gaps(first: Placed, second: Placed) -> list[Gap]:
    """The rows of a pair that :func:`pair_rows` names; normals point from the first to the second, or back."""
    if isinstance(second.shape, HalfSpace):
        return _over_plane(first, second)
    for a, b in ((first, second), (second, first)):
        if isinstance(a.shape, Capsule) and isinstance(b.shape, (Box, Cylinder)):
            return [row for side in (-1.0, 1.0) for row in gaps(_end(a, a.shape, side), b)]
    a, b = (first, second) if isinstance(first.shape, Sphere) else (second, first)
    if isinstance(b.shape, Sphere):
        assert isinstance(a.shape, Sphere)
        up = ca.SX(ca.DM([0.0, 0.0, SHIFT * (a.shape.radius or b.shape.radius or 1.0)]))
        distance, normal = between(a.pose.position + up, b.pose.position)
        return [_gap(a, b, distance - (a.shape.radius + b.shape.radius), normal)]
    if isinstance(b.shape, Capsule):
        return [_to_capsule(a, b)] if isinstance(a.shape, Sphere) else _capsules(first, second)
    assert isinstance(a.shape, Sphere)
    assert isinstance(b.shape, (Box, Cylinder))
    local = b.pose.inverse_point(a.pose.position)
    distance, out = out_of_box(local, b.shape) if isinstance(b.shape, Box) else out_of_cylinder(local, b.shape)
    return [_gap(a, b, distance - a.shape.radius, -(b.pose.rotation @ out))]


def drift(kin: Tracer, gap: Gap, moved: Placed) -> ca.SX:
    """Zero, with the rate of the gap by the inputs in the pose of ``moved``, which is one of its bodies."""
    pose, sign = moved.pose, -1.0 if gap.a == WORLD else 1.0
    if isinstance(moved.shape, HalfSpace):
        height = ca.dot(pose.rotation[:, 2], kin.held(gap.point) - pose.position)
        return height - kin.held(height)
    place = pose.position
    if not isinstance(moved.shape, Sphere):
        place = pose.point(kin.held(pose.inverse_point(gap.point)))
    return sign * ca.dot(kin.held(gap.normal), place - kin.held(place))


def _end(placed: Placed, capsule: Capsule, side: float) -> Placed:
    """The sphere at one end of a capsule."""
    local = np.array([0.0, 0.0, side * capsule.length / 2])
    pose = Pose(placed.pose.rotation, placed.pose.point(rot.constant(local)))
    return Placed(Sphere(capsule.radius), placed.frame, pose, placed.placement * pin.SE3(np.eye(3), local))


def _gap(sphere: Placed, other: Placed, distance: ca.SX, normal: ca.SX) -> Gap:
    """A gap whose line goes through the centre of the sphere."""
    offset = None if sphere.frame == WORLD else sphere.offset(np.zeros(3))
    return Gap(sphere.frame, other.frame, distance, normal, sphere.pose.position, offset)


def _to_capsule(sphere: Placed, capsule: Placed) -> Gap:
    assert isinstance(sphere.shape, Sphere)
    assert isinstance(capsule.shape, Capsule)
    pose, center = capsule.pose, sphere.pose.position
    axis = pose.rotation[:, 2]
    offset = center - (pose.position + SHIFT * (capsule.shape.length + capsule.shape.radius) * pose.rotation[:, 0])
    along = clamp(ca.dot(axis, offset), capsule.shape.length / 2)
    distance, normal = between(offset, along * axis)
    return _gap(sphere, capsule, distance - (sphere.shape.radius + capsule.shape.radius), normal)


def _capsules(first: Placed, second: Placed) -> list[Gap]:
    """The gap of the nearest points, and those of all ends."""
    a, b = first.shape, second.shape
    assert isinstance(a, Capsule)
    assert isinstance(b, Capsule)
    ends = [_to_capsule(_end(first, a, side), second) for side in (-1.0, 1.0)]
    ends += [_to_capsule(_end(second, b, side), first) for side in (-1.0, 1.0)]
    return [_between_cores(first, second, a, b), *ends]


def _between_cores(first: Placed, second: Placed, a: Capsule, b: Capsule) -> Gap:
    """Nearest points s, t of the segments m + s u, |s| <= half: of the lines, then each clamped for the other."""
    u, w = first.pose.rotation[:, 2], second.pose.rotation[:, 2]
    offset = first.pose.position - second.pose.position
    cos, on_u, on_w = ca.dot(u, w), ca.dot(u, offset), ca.dot(w, offset)
    across = 1 - cos * cos
    s = clamp((cos * on_w - on_u) / (across + PARALLEL), a.length / 2)
    t = clamp(cos * s + on_w, b.length / 2)
    s = clamp(cos * t - on_u, a.length / 2)
    crossed = across > PARALLEL
    both = ca.cross(u, w) / ca.sqrt(ca.if_else(crossed, across, 1))
    instead = ca.if_else(crossed, both, first.pose.rotation[:, 0])
    start = first.pose.position + s * u
    distance, normal = between(start, second.pose.position + t * w + SHIFT * (a.length + a.radius) * instead)
    return Gap(first.frame, second.frame, distance - (a.radius + b.radius), normal, start)


def _over_plane(solid: Placed, plane: Placed) -> list[Gap]:
    """Heights over the plane of the points that :func:`plane_rows` names."""
    shape, up, origin = solid.shape, plane.pose.rotation[:, 2], plane.pose.position
    if isinstance(shape, Cylinder):
        return [_rim(solid, shape, side, plane) for side in (-1.0, 1.0)]
    if isinstance(shape, Convex) and len(shape.points) > VERTEX_ROWS:
        lowest = solid.pose.point(_support(shape, -(solid.pose.rotation.T @ up)))
        return [Gap(solid.frame, plane.frame, ca.dot(up, lowest - origin), -up, lowest, level=True)]
    radius = shape.radius if isinstance(shape, (Sphere, Capsule)) else 0.0
    out = []
    for local in _plane_points(shape):
        place = solid.pose.point(rot.constant(local)) if local.any() else solid.pose.position
        height = ca.dot(up, place - origin) - radius
        out.append(Gap(solid.frame, plane.frame, height, -up, place, level=True))
    return out


def _plane_points(shape: Shape) -> list[Array]:
    if isinstance(shape, Box):
        return [np.array(signs) * np.array(shape.size) / 2 for signs in itertools.product((-1.0, 1.0), repeat=3)]
    if isinstance(shape, Convex):
        return list(shape.points)
    half = shape.length / 2 if isinstance(shape, Capsule) else 0.0
    return [np.array([0.0, 0.0, side * half]) for side in ((-1, 1) if half else (1,))]


def _rim(solid: Placed, cylinder: Cylinder, side: float, plane: Placed) -> Gap:
    """The lowest point of one rim; towards the x axis where the disc is parallel to the plane."""
    pose, up = solid.pose, plane.pose.rotation[:, 2]
    x, y = ca.dot(pose.rotation[:, 0], up), ca.dot(pose.rotation[:, 1], up)
    square = x * x + y * y
    tilted = square > COINCIDENT**2
    length = ca.sqrt(ca.if_else(tilted, square, 1))
    down = cylinder.radius * ca.if_else(tilted, ca.vertcat(-x, -y) / length, ca.SX(ca.DM([1.0, 0.0])))
    place = pose.point(ca.vertcat(down, side * cylinder.length / 2))
    return Gap(solid.frame, plane.frame, ca.dot(up, place - plane.pose.position), -up, place, level=True)


def _support(shape: Convex, direction: ca.SX) -> ca.SX:
    """The vertex farthest along a direction; the first of equals."""
    best = rot.constant(shape.points[0])
    farthest = ca.dot(best, direction)
    for point in shape.points[1:]:
        vertex = rot.constant(point)
        reach = ca.dot(vertex, direction)
        better = reach > farthest
        farthest, best = ca.fmax(reach, farthest), ca.if_else(better, vertex, best)
    return best
