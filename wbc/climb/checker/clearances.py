"""Clearances of links: exact at ticks by Coal, and proven between them.

Between two ticks q goes along the shortest way. Every point of a link then moves by at most

    s = |d_lin| + |d_ang| R_0 + sum_j |d_j| R_j         d = q_{k+1} (-) q_k, j: joints that carry the link

R_j: the farthest that a point of the link can be from the axis of joint j. So the distance of two bodies on a stretch
of the climb is at least (a + b - sum of s) / 2 with a and b at its ends; where that proves too little, it is halved.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

# isort: split
from wbc.multibody import pin

# isort: split
import coal

from wbc.clearance import CylinderInside, EndlessCylinder, TriangleMesh
from wbc.climb.checker.record import OPEN, Climbed
from wbc.climb.checker.report import CheckRules, RuleTally
from wbc.climb.scene import SceneBody
from wbc.errors import ShapeError
from wbc.shapes import (
    Box,
    Capsule,
    Convex,
    Cylinder,
    Ellipsoid,
    Geometry,
    HalfSpace,
    HeightMap,
    PlacedShape,
    Sphere,
)
from wbc.validation import Array

BODIES = "clearance of bodies"
LINKS = "clearance of links"
POINTS = "contact's point in a body"
#: Distance beyond which nothing is measured [m]
FAR = 0.05
#: How far from a foothold, beside what closed contacts may be, a limb in the air counts as on it [m]
ASIDE = 0.003
#: By which part of its distance it is at least less deep than at the foothold [1]
RISES = 0.5
#: Distance that is allowed of a tip and what it holds [m]
HOLDING = -1.0
#: Radius of a point, for Coal [m]
POINT = 1e-6
#: No distance is larger; Coal says as much where it has no answer [m]
LARGEST = 1e6
#: How far beside a pose it is asked again then [m]
BESIDE = 1e-5
#: Answers there that are no farther apart are the same: no depth changes by more than the way [m]
SAME = 2e-5
#: Length of a cylinder without end, for Coal [m]
ENDLESS = 200.0
#: Shortest part of the way between two ticks that is looked at
SHORTEST = 1.0 / 256.0


@dataclass(frozen=True, eq=False)
class _SweptPart:
    """A shape on a joint, or in the world where that is 0.

    Attributes:
        name: of its link or body. joint: that carries it. shape: what it is.
        solid: Coal's own of it, None of the inside of a cylinder. pose: on the joint.
        reaches: R_j by velocity coordinate, and R_0 for those of the base's rotation [m].
    """

    name: str
    joint: int
    shape: Geometry
    solid: coal.CollisionGeometry | None
    pose: pin.SE3
    reaches: Array


def check_clearances(climbed: Climbed, rules: CheckRules, tally: RuleTally) -> None:
    """Links against bodies and each other.

    The link at a limb's tip may be as deep in the body that its foothold is on as it would be there, near by on the way
    from there and to there; the contact's point itself stays out of every body. What a closed contact holds is for the
    rules of contacts to judge.
    """
    for rule, least in ((BODIES, rules.clearance), (LINKS, rules.clearance), (POINTS, -rules.depth)):
        tally.declare(rule, least - rules.swept, "m", least=True)
    climber, robot = climbed.climber, climbed.climber.robot
    model = robot.model
    links = [part for name, shapes in robot.shapes.items() for part in _parts(model, name, shapes)]
    bodies = [_part(model, name, body, 0) for name, body in climbed.scene.bodies.items()]
    frames = [model.frames[model.getFrameId(limb.frame)] for limb in climber.limbs]
    points = list[_SweptPart]()
    for limb, frame in zip(climber.limbs, frames, strict=True):
        ball = PlacedShape(Sphere(POINT), frame.placement * limb.placement)
        points.append(_part(model, limb.name, ball, int(frame.parentJoint)))
    around = _PairDistances(climbed, rules)

    def look(
        rule: str,
        a: _SweptPart,
        b: _SweptPart,
        limbs: Sequence[int] = (),
        lowered: Callable[[int], float] | None = None,
    ) -> None:
        """With the tips of some limbs, which may hold the other part."""
        least = -rules.depth if rule == POINTS else rules.clearance
        value, tick = around.room(a, b, _holding(climbed, limbs, b, least), lowered)
        tally.add(rule, np.array([value + least]), climbed.t[[tick]], f"{a.name} and {b.name}")

    for body in bodies:
        for link in links:
            tips = [k for k, frame in enumerate(frames) if int(frame.parentJoint) == link.joint]
            look(BODIES, link, body, tips, _near_footholds(climbed, around, (link, body), tips, rules))
        for k, point in enumerate(points):
            look(POINTS, point, body, [k])
    pairs = None if robot.self_pairs is None else {frozenset(pair) for pair in robot.self_pairs}
    for a, b in combinations(links, 2):
        if frozenset((a.name, b.name)) in pairs if pairs is not None else _apart(model, around, a, b):
            look(LINKS, a, b)


def _holding(climbed: Climbed, limbs: Sequence[int], body: _SweptPart, least: float) -> Array:
    """Least distance that is allowed at every tick: any while one of some limbs holds something on the body."""
    out = np.full(len(climbed.t), least)
    for limb in limbs:
        for first, last, row in climbed.stretches(limb):
            if row != OPEN and climbed.scene.footholds[row].on == body.name:
                out[first:last] = HOLDING
    return out


def _near_footholds(
    climbed: Climbed, around: _PairDistances, pair: tuple[_SweptPart, _SweptPart], limbs: list[int], rules: CheckRules
) -> Callable[[int], float]:
    """Over a foothold of its way a limb in the air may be as deep as it would be there, less half of its distance from
    where closed contacts may be; its contact's point is out of the body all the same.
    """
    ways = list[tuple[int, int, int, pin.SE3]]()
    for limb in limbs:
        for row, first, last in _ways(climbed, limb):
            foothold = climbed.scene.footholds[row]
            if foothold.on == pair[1].name:
                ways.append((limb, first, last, climbed.climber.limbs[limb].contact.held_at(foothold.pose)))

    def least(k: int) -> float:
        out = rules.clearance
        for limb, first, last, held in ways:
            off = held.translation - climbed.tips[0][k, limb]
            if first <= k < last and off @ held.rotation[:, 2] <= rules.depth:
                beside = max(float(np.linalg.norm(off)) - ASIDE - rules.hold_distance, 0.0)
                out = min(out, around.distance(*pair, k, off) + RISES * beside - rules.depth)
        return out

    return least


def _ways(climbed: Climbed, limb: int) -> list[tuple[int, int, int]]:
    """(foothold, first tick, tick after the last) between which a limb in the air may be on its way off it or to it:
    those that it held before and holds next, and those that it was to go to meanwhile, from then on.
    """
    out, stretches = list[tuple[int, int, int]](), climbed.stretches(limb)
    for at, (first, last, row) in enumerate(stretches):
        if row != OPEN:
            continue
        if at:
            out.append((stretches[at - 1][2], first, last))
        else:
            # A log that begins in the air does not say what was left: the nearest foothold
            away = climbed.scene.positions - climbed.tips[0][first, limb]
            out.append((int((away * away).sum(axis=1).argmin()), first, last))
        if at + 1 < len(stretches):
            out.append((stretches[at + 1][2], first, last))
        aims = climbed.aims[first:last, limb]
        out += [(int(aim), first + int((aims == aim).argmax()), last) for aim in np.unique(aims[aims != OPEN])]
    return sorted(set(out))


class _PairDistances:
    """Distances of pairs over a climb."""

    def __init__(self, climbed: Climbed, rules: CheckRules) -> None:
        self._climbed, self._tolerance, self._model = climbed, rules.swept, climbed.climber.robot.model
        self._data, moved = self._model.createData(), np.abs(climbed.moved)
        self._known: dict[tuple[_SweptPart, _SweptPart, float], float] = {}
        self._poses: dict[float, list[pin.SE3]] = {}
        base = [np.linalg.norm(moved[:, k : k + 3], axis=1) for k in (0, 3)]
        self._moved = moved
        moved[:, :6] = 0.0
        moved[:, 0], moved[:, 3] = base

    def distance(self, a: _SweptPart, b: _SweptPart, x: float, moved: Array | None = None) -> float:
        """Of two parts at a tick or between two, the first one moved or not [m]."""
        key = a, b, x
        if moved is None and key in self._known:
            return self._known[key]
        if x not in self._poses:
            k = int(x)
            q = self._climbed.q[k]
            q = q if x == k else pin.integrate(self._model, q, (x - k) * self._climbed.moved[k])
            pin.forwardKinematics(self._model, self._data, q)
            self._poses[x] = [pose.copy() for pose in self._data.oMi]
        first, other = self._poses[x][a.joint], self._poses[x][b.joint]
        if moved is not None:
            return self._between(a, b, pin.SE3(first.rotation, first.translation + moved), other)
        self._known[key] = self._between(a, b, first, other)
        return self._known[key]

    def room(
        self, a: _SweptPart, b: _SweptPart, floor: Array, lowered: Callable[[int], float] | None
    ) -> tuple[float, int]:
        """How far above ``floor`` ``(n)`` the distance is at least, and at which tick: proven to be, within the rule's
        tolerance, where that is above 0; counted up to ``FAR`` [m].

        Args:
            lowered: lower floor of a tick, asked where it counts; None: there is none.
        """
        travel = self._moved @ (a.reaches + b.reaches)
        passed = np.append(0.0, np.cumsum(travel))
        least, worst, stretches = FAR, 0, [(0.0, float(len(travel)))]
        while stretches:
            x, y = stretches.pop()
            k, ends = int(x), (self.distance(a, b, x), self.distance(a, b, y))
            if y - x > 1.0:
                bound = 0.5 * (sum(ends) - passed[int(y)] + passed[k]) - floor[k : int(y) + 1].max()
                if bound < least:
                    middle = float((k + int(y)) // 2)
                    stretches += [(middle, y), (x, middle)]
                continue
            bound = 0.5 * (sum(ends) - (y - x) * travel[k])
            if bound - max(floor[k], floor[k + 1]) >= least:
                continue
            floors = [floor[j] if lowered is None else min(floor[j], lowered(j)) for j in (k, k + 1)]
            low = min(floors)
            # Between ticks the lower floor counts, at them their own
            values = [end - (floors[int(z) - k] if z == int(z) else low) for z, end in zip((x, y), ends, strict=True)]
            if bound - low < -self._tolerance <= min(ends) - low and y - x >= SHORTEST:
                stretches += [(0.5 * (x + y), y), (x, 0.5 * (x + y))]
            elif min(ends) - low >= -self._tolerance:
                values.append(bound - low)
            if min(values) < least:
                least, worst = min(values), k
        return least, worst

    def _between(self, a: _SweptPart, b: _SweptPart, at: pin.SE3, there: pin.SE3) -> float:
        if b.solid is None:
            return _within(a.shape, (there * b.pose).actInv(at * a.pose), b.shape.sizes[3])
        if isinstance(b.shape, (HeightMap, TriangleMesh)) and isinstance(a.shape, (Capsule, Sphere)):
            # Of triangles that a solid meets Coal takes any; its core meets none before it is a radius deep
            return coal_distance(_core(a.shape), at * a.pose, b.solid, there * b.pose) - a.shape.radius
        return coal_distance(a.solid, at * a.pose, b.solid, there * b.pose)


def _core(shape: Capsule | Sphere) -> coal.CollisionGeometry:
    """The point or segment in the middle of a round shape."""
    return coal.Sphere(POINT) if isinstance(shape, Sphere) else coal.Capsule(POINT, shape.length)


def coal_distance(a: coal.CollisionGeometry, at: pin.SE3, b: coal.CollisionGeometry, there: pin.SE3) -> float:
    """Distance of two solids at poses, below 0 where they meet [m]; where Coal has no answer, or one that is another a
    hair beside, as where the core of a round one touches a face, the middle one of those beside it.
    """
    request, answers = coal.DistanceRequest(), list[float]()
    request.enable_signed_distance = True
    for aside in BESIDE * np.vstack([np.zeros(3), np.eye(3)]):
        poses = (
            coal.Transform3s(at.rotation, at.translation + aside),
            coal.Transform3s(there.rotation, there.translation),
        )
        answers.append(float(coal.distance(a, poses[0], b, poses[1], request, coal.DistanceResult())))
        alike = len(answers) == 2 and abs(answers[1] - answers[0]) <= SAME
        if abs(answers[0]) < LARGEST and (answers[0] > 0.0 or alike):
            return answers[0]
    return float(np.median(answers[1:])) - BESIDE


def _apart(model: pin.Model, around: _PairDistances, a: _SweptPart, b: _SweptPart) -> bool:
    """Whether links that nothing chose may touch: not those on one joint or on neighbours, nor that touch at first."""
    near = a.joint == b.joint or model.parents[a.joint] == b.joint or model.parents[b.joint] == a.joint
    return not near and around.distance(a, b, 0) > 0.0


def _parts(model: pin.Model, link: str, shapes: tuple[PlacedShape, ...]) -> list[_SweptPart]:
    frame = model.frames[model.getFrameId(link)]
    placed = (PlacedShape(one.shape, frame.placement * one.placement) for one in shapes)
    return [_part(model, link, one, int(frame.parentJoint)) for one in placed]


def _part(model: pin.Model, name: str, placed: PlacedShape | SceneBody, joint: int) -> _SweptPart:
    shape, reaches, carrier = placed.shape, np.zeros(model.nv), joint
    farthest = float(np.linalg.norm(placed.placement * np.asarray(shape.center))) + float(shape.reach)
    while carrier:
        start, count = int(model.idx_vs[carrier]), int(model.nvs[carrier])
        if count == 6:
            reaches[start], reaches[start + 3] = 1.0, farthest
        else:
            # A sliding joint moves all points alike
            sliding = "P" in model.joints[carrier].shortname().removeprefix("JointModel")[:1]
            reaches[start : start + count] = 1.0 if sliding else farthest
            if sliding:
                row = int(model.idx_qs[carrier])
                ends = np.abs([model.lowerPositionLimit[row], model.upperPositionLimit[row]])
                farthest += float(ends.max())
        farthest += float(np.linalg.norm(model.jointPlacements[carrier].translation))
        carrier = int(model.parents[carrier])
    return _SweptPart(name, joint, shape, _coal_shape(shape), placed.placement, reaches)


def _within(shape: Geometry, pose: pin.SE3, radius: float) -> float:
    """Distance of a solid from the wall round the z axis: of boxes and hulls exact, of others that of their capsule."""
    thick = 0.0
    if isinstance(shape, Box):
        corners = 0.5 * np.asarray(shape.size) * np.array(list(product((-1.0, 1.0), repeat=3)))
    elif isinstance(shape, Convex):
        corners = np.asarray(shape.points)
    else:
        first, last, thick = shape.capsule()  # type: ignore[attr-defined]  # every solid has one
        corners = np.array([first, last])
    across = (corners @ pose.rotation.T + pose.translation)[:, :2]
    return float(radius - np.linalg.norm(across, axis=1).max() - thick)


_COAL: dict[type, Callable[..., coal.CollisionGeometry | None]] = {
    Sphere: lambda shape: coal.Sphere(shape.radius),
    Capsule: lambda shape: coal.Capsule(shape.radius, shape.length),
    Cylinder: lambda shape: coal.Cylinder(shape.radius, shape.length),
    Box: lambda shape: coal.Box(*shape.size),
    Ellipsoid: lambda shape: coal.Ellipsoid(*shape.semi_axes),
    HalfSpace: lambda shape: coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0),
    EndlessCylinder: lambda shape: coal.Cylinder(shape.radius, ENDLESS),
    CylinderInside: lambda shape: None,
    Convex: lambda shape: _hull(shape.points),
    HeightMap: lambda shape: _surface(shape.triangles()),
    TriangleMesh: lambda shape: _surface(shape.corners),
}


def _coal_shape(shape: Geometry) -> coal.CollisionGeometry | None:
    """Coal's own, about the same origin.

    Raises:
        ShapeError: a shape that it has none for.
    """
    if type(shape) not in _COAL:
        raise ShapeError("shape", type(shape).__name__, "the checker has no such shape")
    return _COAL[type(shape)](shape)


def _hull(corners: Array) -> coal.CollisionGeometry:
    points = coal.StdVec_Vec3s()
    points.extend(np.asarray(corners))
    return coal.Convex.convexHull(points, True, "Qt")


def _surface(corners: Array) -> coal.CollisionGeometry:
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(corners), 3 * len(corners))
    for triangle in corners:
        mesh.addTriangle(*triangle)
    mesh.endModel()
    return mesh
