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
#: Distance that is allowed of a tip and what it holds [m]
HOLDING = -1.0
#: Radius of a point, for Coal [m]
POINT = 1e-6
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

    The link at a limb's tip may be as deep in the body that its foothold is on as it is while it holds there, on the
    way from there and to there as well; the contact's point itself stays out of every body. What a closed contact
    holds is for the rules of contacts to judge.
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
        stretches = climbed.stretches(k)
        for at, (first, last, row) in enumerate(stretches):
            if row == OPEN or climbed.scene.footholds[row].on != body.name:
                continue
            held = min(around.distance(link, body, tick) for tick in range(first, last))
            # From where it lifts and to where it lands it is in the air
            start = stretches[at - 1][0] if at and stretches[at - 1][2] == OPEN else first
            end = stretches[at + 1][1] if at + 1 < len(stretches) and stretches[at + 1][2] == OPEN else last
            floor[start:end] = np.minimum(floor[start:end], held - rules.depth)
            floor[first:last] = HOLDING
    return floor


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
        self._request = coal.DistanceRequest()
        self._request.enable_signed_distance = True

    def distance(self, a: _SweptPart, b: _SweptPart, k: int) -> float:
        """Of two parts at a tick [m]."""
        key = id(a), id(b), k
        if key not in self._known:
            poses = (pin.SE3(self._poses[k, p.joint, :, :3], self._poses[k, p.joint, :, 3]) for p in (a, b))
            self._known[key] = self._between(a, b, *poses)
        return self._known[key]

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
        for k in np.flatnonzero(near).tolist():
            values[k] = self.distance(a, b, k) - floor[k]
        out = np.minimum(values, FAR)
        step = np.minimum(floor[:-1], floor[1:]) - floor[:-1]
        proven = (values[:-1] + values[1:] + floor[1:] - floor[:-1] - travel) / 2.0 - step
        out[:-1] = np.where(values[:-1] < 0.0, values[:-1], np.minimum(out[:-1], proven))
        for k in np.flatnonzero((proven < 0.0) & (values[:-1] >= 0.0) & (values[1:] >= 0.0)).tolist():
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
        if bound >= -self._tolerance or min(values) < 0.0 or ends[1] - ends[0] < SHORTEST:
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
        poses = [coal.Transform3s(x.rotation, x.translation) for x in (at * a.pose, there * b.pose)]
        result = coal.DistanceResult()
        return float(coal.distance(a.solid, poses[0], b.solid, poses[1], self._request, result))


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
