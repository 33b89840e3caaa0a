"""Clearances of links: exact at every tick by Coal, and proven between ticks.

Between two ticks q goes along the shortest way. Every point of a link then moves by at most

    s = |d_lin| + |d_ang| R_0 + sum_j |d_j| R_j         d = q_{k+1} (-) q_k, j: joints that carry the link

R_j: the farthest that a point of the link can be from the axis of joint j. So the distance of two bodies between the
ticks is at least (a + b - s) / 2 with a and b at the ticks; where that proves too little, the way is halved.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

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
        center, radius: of a ball round it, on the joint [m].
        reaches: R_j by velocity coordinate, and R_0 for those of the base's rotation [m].
    """

    name: str
    joint: int
    shape: Geometry
    solid: coal.CollisionGeometry | None
    pose: pin.SE3
    center: Array
    radius: float
    reaches: Array


def check_clearances(climbed: Climbed, rules: CheckRules, tally: RuleTally) -> None:
    """Links against bodies and each other.

    The link at a limb's tip may be as deep in the body that its foothold is on as it would be there, near by on the way
    from there and to there; the contact's point itself stays out of every body. What a closed contact holds is for the
    rules of contacts to judge.
    """
    tally.declare("clearance of bodies", rules.clearance - rules.swept, "m", least=True)
    tally.declare("clearance of links", rules.clearance - rules.swept, "m", least=True)
    tally.declare("contact's point in a body", -rules.depth - rules.swept, "m", least=True)
    climber, robot = climbed.climber, climbed.climber.robot
    model = robot.model
    links = [part for name, shapes in robot.shapes.items() for part in _parts(model, name, shapes)]
    bodies = [_part(model, name, body, 0) for name, body in climbed.scene.bodies.items()]
    points = []
    for limb in climber.limbs:
        frame = model.frames[model.getFrameId(limb.frame)]
        ball = PlacedShape(Sphere(POINT), frame.placement * limb.placement)
        points.append(_part(model, limb.name, ball, int(frame.parentJoint)))
    around = _PairDistances(climbed, rules)
    for body in bodies:
        for link in links:
            floor = _floor(climbed, around, link, body, rules)
            values = around.room(link, body, floor) + rules.clearance
            tally.add("clearance of bodies", values, climbed.t, f"{link.name} and {body.name}")
        for k, point in enumerate(points):
            values = around.room(point, body, _outside(climbed, k, body, rules)) - rules.depth
            tally.add("contact's point in a body", values, climbed.t, f"{point.name} and {body.name}")
    pairs = None if robot.self_pairs is None else {frozenset(pair) for pair in robot.self_pairs}
    needed = np.full(len(climbed.t), rules.clearance)
    for a, b in combinations(links, 2):
        if frozenset((a.name, b.name)) in pairs if pairs is not None else _apart(model, around, a, b):
            values = around.room(a, b, needed) + rules.clearance
            tally.add("clearance of links", values, climbed.t, f"{a.name} and {b.name}")


def _floor(climbed: Climbed, around: _PairDistances, link: _SweptPart, body: _SweptPart, rules: CheckRules) -> Array:
    """Least distance that is allowed of a pair at every tick; ``HOLDING`` while a limb whose tip this link is holds."""
    model, floor = climbed.climber.robot.model, np.full(len(climbed.t), rules.clearance)
    for k, limb in enumerate(climbed.climber.limbs):
        if int(model.frames[model.getFrameId(limb.frame)].parentJoint) != link.joint:
            continue
        for first, last, row in climbed.stretches(k):
            if row != OPEN and climbed.scene.footholds[row].on == body.name:
                floor[first:last] = HOLDING
        for row, first, last in _ways(climbed, k):
            if climbed.scene.footholds[row].on == body.name:
                _lower_near(climbed, around, (link, body, k), (row, first, last), floor, rules)
    return floor


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


def _lower_near(
    climbed: Climbed,
    around: _PairDistances,
    what: tuple[_SweptPart, _SweptPart, int],
    way: tuple[int, int, int],
    floor: Array,
    rules: CheckRules,
) -> None:
    """Over a foothold of its way a limb in the air may be as deep as it would be there, less half of its distance from
    where closed contacts may be; its contact's point is out of the body all the same.
    """
    link, body, limb = what
    row, first, last = way
    held = climbed.climber.limbs[limb].contact.held_at(climbed.scene.footholds[row].pose)
    offs, normal = held.translation - climbed.tips[0][first:last, limb], held.rotation[:, 2]
    beside = ASIDE + rules.hold_distance
    for k in around.nearer(link, body, first + np.flatnonzero(offs @ normal <= rules.depth), rules.clearance):
        there = around.distance(link, body, k, offs[k - first])
        lowest = there + RISES * max(float(np.linalg.norm(offs[k - first])) - beside, 0.0) - rules.depth
        floor[k] = min(floor[k], lowest)


def _outside(climbed: Climbed, limb: int, body: _SweptPart, rules: CheckRules) -> Array:
    """The same for the point of a limb's contact."""
    floor = np.full(len(climbed.t), -rules.depth)
    for first, last, row in climbed.stretches(limb):
        if row != OPEN and climbed.scene.footholds[row].on == body.name:
            floor[first:last] = HOLDING
    return floor


class _PairDistances:
    """Distances of pairs over a climb."""

    def __init__(self, climbed: Climbed, rules: CheckRules) -> None:
        self._known: dict[tuple[int, int, int], float] = {}
        self._balls: dict[int, tuple[Array, Array]] = {}
        self._climbed, self._tolerance, model = climbed, rules.swept, climbed.climber.robot.model
        self._model, self._data = model, model.createData()
        self._poses = np.zeros((len(climbed.t), model.njoints, 3, 4))
        for k, q in enumerate(climbed.q):
            pin.forwardKinematics(model, self._data, q)
            for joint, pose in enumerate(self._data.oMi):
                self._poses[k, joint, :, :3], self._poses[k, joint, :, 3] = pose.rotation, pose.translation
        moved = np.abs(climbed.moved)
        base = np.column_stack([np.linalg.norm(moved[:, :3], axis=1), np.linalg.norm(moved[:, 3:6], axis=1)])
        self._moved = np.hstack([base[:, :1], np.zeros((len(moved), 2)), base[:, 1:], np.zeros((len(moved), 2)),
                                 moved[:, 6:]])  # fmt: skip

    def distance(self, a: _SweptPart, b: _SweptPart, k: int, moved: Array | None = None) -> float:
        """Of two parts at a tick, the first one moved or not [m]."""
        key = id(a), id(b), k
        if moved is None and key in self._known:
            return self._known[key]
        first, other = (pin.SE3(self._poses[k, p.joint, :, :3], self._poses[k, p.joint, :, 3]) for p in (a, b))
        if moved is not None:
            first.translation = first.translation + moved
            return self._between(a, b, first, other)
        self._known[key] = self._between(a, b, first, other)
        return self._known[key]

    def nearer(self, a: _SweptPart, b: _SweptPart, ticks: NDArray[np.intp], distance: float) -> list[int]:
        """Those of some ticks at which two parts are nearer to each other than so much [m]."""
        passed, known, out = np.append(0.0, np.cumsum(self._ball(a)[1] + self._ball(b)[1])), -np.inf, list[int]()
        for k in ticks.tolist():
            # What was measured, less the way since
            if known - passed[k] < distance:
                known = self.distance(a, b, k) + passed[k]
                out += [k] if known - passed[k] < distance else []
        return out

    def room(self, a: _SweptPart, b: _SweptPart, floor: Array) -> Array:
        """How far above ``floor`` ``(n)`` the distance is, from each tick to the next one: proven to be, within the
        rule's tolerance, where that is above 0; counted up to ``FAR`` [m].
        """
        # Balls round both leave most ticks without a measurement
        (there, ways), (here, own) = self._ball(b), self._ball(a)
        apart = np.linalg.norm(here - there, axis=1) - a.radius - b.radius
        travel = own + ways
        if apart.min() > FAR + floor.max() + travel.max():
            return np.full(len(floor), FAR)
        near = apart < FAR + floor + np.append(travel, 0.0)
        near[1:] |= near[:-1].copy()
        values = apart - floor
        passed, least, known = np.concatenate([[0.0], np.cumsum(travel)]), FAR, -np.inf
        for k in np.flatnonzero(near).tolist():
            # What was measured, less the way since: ticks and ways that it leaves above the least one are not the worst
            values[k] = known - passed[k] - floor[k]
            if values[k] + passed[k] - passed[min(k + 1, len(travel))] <= least:
                values[k] = self.distance(a, b, k) - floor[k]
                known, least = values[k] + floor[k] + passed[k], min(least, values[k])
        out = np.minimum(values, FAR)
        step = np.minimum(floor[:-1], floor[1:]) - floor[:-1]
        proven = (values[:-1] + values[1:] + floor[1:] - floor[:-1] - travel) / 2.0 - step
        least = np.minimum(values[:-1], values[1:])
        out[:-1] = np.where(least < -self._tolerance, out[:-1], np.minimum(out[:-1], proven))
        for k in np.flatnonzero((proven < 0.0) & (least >= -self._tolerance)).tolist():
            low = min(floor[k], floor[k + 1])
            ends = values[k] + floor[k] - low, values[k + 1] + floor[k + 1] - low
            out[k] = self._halved((a, b), k, (0.0, 1.0), ends, travel[k], low)
        return np.asarray(out)

    def _ball(self, part: _SweptPart) -> tuple[Array, Array]:
        """Centre of the ball round a part at every tick ``(n, 3)``, and the way of its points between ticks
        ``(n - 1)`` at most [m].
        """
        if id(part) not in self._balls:
            poses = self._poses[:, part.joint]
            self._balls[id(part)] = poses[:, :, :3] @ part.center + poses[:, :, 3], self._moved @ part.reaches
        return self._balls[id(part)]

    def _halved(
        self,
        pair: tuple[_SweptPart, _SweptPart],
        k: int,
        ends: tuple[float, float],
        values: tuple[float, float],
        travel: float,
        floor: float,
    ) -> float:
        """The room on a part of the way between two ticks: proven, or found to be none."""
        bound = (values[0] + values[1] - travel) / 2.0
        if bound >= -self._tolerance or min(values) < -self._tolerance or ends[1] - ends[0] < SHORTEST:
            return min(bound, *values)
        middle = (ends[0] + ends[1]) / 2.0
        pin.forwardKinematics(
            self._model, self._data, pin.integrate(self._model, self._climbed.q[k], middle * self._climbed.moved[k])
        )
        value = self._between(*pair, *(self._data.oMi[part.joint] for part in pair)) - floor
        return min(
            self._halved(pair, k, (ends[0], middle), (values[0], value), travel / 2.0, floor),
            self._halved(pair, k, (middle, ends[1]), (value, values[1]), travel / 2.0, floor),
        )

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
    shape, radius = placed.shape, float(placed.shape.reach)
    center = placed.placement * np.asarray(shape.center)
    reaches = np.zeros(model.nv)
    farthest, carrier = float(np.linalg.norm(center)) + radius, joint
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
    return _SweptPart(name, joint, shape, _coal_shape(shape), placed.placement, center, radius, reaches)


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
