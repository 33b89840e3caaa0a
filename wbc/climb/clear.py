"""Clearances of a climber: its links from each other and from what it climbs, proven between instants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import hypot, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wbc import pickling, validation
from wbc.clearance import Exemption, Motion, Nearest, Pair, Sweeper, SweptBody, SweptScene, Tree, bodies_of, self_pairs
from wbc.climb.climber import Climber
from wbc.climb.scene import ClimbScene
from wbc.climb.stance import FREE_LIMB
from wbc.errors import ShapeError
from wbc.geometry.kernel import segments_from
from wbc.multibody import pin
from wbc.robot.joint_values import joint_values
from wbc.shapes import PlacedShape, Sphere
from wbc.shapes.solid import why_apart
from wbc.symbolic.kinematics import frame_index
from wbc.validation import Array

#: Share of its distance from the foothold that a tip keeps from the body that the foothold is on: it comes down between
#: parts of that body that are up to 60 degrees steep
APPROACH = 0.5
#: How much deeper than its form says a tip may be in what it holds [m]: rounding of descriptions and meshes
SINK = 2e-3
#: The same of a contact's point [m]
POINT_SINK = 2e-4
#: Before names of bodies of the scene among those of links, which may be the same
OF_SCENE = "\0"
#: What is proven may be less by this [m]: a move may begin in a stance that has nothing to spare
TOLERANCE = 1e-4
#: Cosine of how far a round tip may be tilted on what it holds, 75 degrees
TILTED = 0.26
#: Radius of the ball that stands for a contact's point [m]: small beside what proofs may miss
POINT = 1e-6


@dataclass(frozen=True, eq=False)
class Clearances:
    """Links of a climber against each other and against the bodies of a scene.

    Links that move with the last joint of a limb, its tips, touch the body that the limb's foothold is on. While the
    contact is d away from the foothold, a tip keeps from that body

        min(clearance, d / 2 - deepest)

    with deepest as of :class:`SunkTip`: how far the tip's form goes beyond the contact's frame, as a round foot that
    tilts does, and rounding.

    All within 0.1 mm, which proofs may miss.

    Attributes:
        climber, scene: as given.
        clearance: distance that links keep from bodies [m].
        apart: distance that links keep from each other [m].

    Raises:
        ShapeError: the robot has no shapes, or pairs of its links are not chosen yet. RangeError, NotFiniteError: a
            distance that is none.
    """

    climber: Climber
    scene: ClimbScene
    clearance: float = 0.01
    apart: float = 0.0

    def __post_init__(self) -> None:
        if not self.climber.robot.shapes:
            raise ShapeError("robot.shapes", None, "the robot has no shapes, so nothing can be proven to be clear")
        validation.own_scalars(self, "clearance", "apart", low=0.0, unit="m")

    def __getstate__(self) -> dict[str, object]:
        return pickling.declared(self)

    def standing(self, contacts: Sequence[int], q: Array) -> Nearest | None:
        """Two bodies that are nearer than they may be in a stance; None: there are none."""
        return self.moving([(row,) for row in contacts], np.array([0.0, 1.0]), np.stack([q, q]), None)

    def moving(
        self, contacts: Sequence[Sequence[int]], times: Array, q: Array, v: Array | None,
        within: Sequence[Sequence[tuple[float, float]]] | None = None,
    ) -> Nearest | None:  # fmt: skip
        """Two bodies that come nearer to each other than they may, and when; None: it is proven that there are none.

        Args:
            contacts: of each limb the rows of the footholds that it leaves, holds or lands on; ``FREE_LIMB`` for none.
            times: knots ``(n)``. q: configurations there ``(n, nq)``.
            v: velocities there ``(n, nv)``, with cubics between; None: even between knots.
            within: of each of the contacts from when to when the limb comes, holds and leaves; None: all the time.
        """
        motion, exempt = self._motion(times, q, v), list[Exemption]()
        for limb, rows in enumerate(contacts):
            for k, row in enumerate(rows):
                since, until = (-np.inf, np.inf) if within is None else within[limb][k]
                exempt += [replace(entry, since=since, until=until) for entry in self._exempt(limb, row)]
        swept = self._sweeper.sweep(motion, self._chosen(motion), exempt, aim="any", tolerance=TOLERANCE)
        if swept.clear:
            return None
        near = swept.nearest
        return near and replace(near, first=near.first.strip(OF_SCENE), second=near.second.strip(OF_SCENE))

    def blur(self, times: Array, q: Array, v: Array) -> float:
        """How far links may be between knots from where :meth:`moving` measures them, as the base goes evenly there and
        not on its cubic [m]: what lacks less may be clear with more knots.
        """
        ahead, turned = self._motion(times, q, v).free_slack[0]
        return float(ahead + turned * self._size)

    def _motion(self, times: Array, q: Array, v: Array | None) -> Motion:
        values, tree = joint_values(self.climber.robot, q), self._sweeper.scene.tree
        if v is None:
            return Motion.linear(tree, times, values, q[:, :7])
        motion = Motion.cubic(tree, times, values, v[:, 6:], q[:, :7])
        # Between knots the base goes evenly here: it is on its cubic within 4 h / 27 of the changes of its rates
        span = np.diff(times)[:, None]
        turned = motion.poses[0, :, :9].reshape(-1, 3, 3)
        slack = []
        for rates, mean in (
            (np.einsum("nij,nj->ni", turned, v[:, :3]), np.diff(q[:, :3], axis=0) / span),
            (v[:, 3:6], motion.turns[0] / span),
        ):
            change = np.linalg.norm(rates[:-1] - mean, axis=1) + np.linalg.norm(rates[1:] - mean, axis=1)
            slack.append(float((4.0 / 27.0 * span[:, 0] * change).max()))
        return replace(motion, free_slack=np.array([slack]))

    def _chosen(self, motion: Motion) -> NDArray[np.intp]:
        """Pairs of links, and links with bodies that are as near as the robot is large."""
        base = motion.poses[0, :, 9:]
        middle = (base.min(axis=0) + base.max(axis=0)) / 2
        reach = self._size + float(np.linalg.norm(base - middle, axis=1).max()) + self.clearance
        near = np.append(np.linalg.norm(self._centers - middle, axis=1) - self._radii <= reach, True)
        return np.flatnonzero(near[self._pairs[1]])

    def _exempt(self, limb: int, row: int) -> list[Exemption]:
        """What tips of a limb keep less at a foothold."""
        if row == FREE_LIMB or not self.scene.footholds[row].on:
            return []
        foothold = self.scene.footholds[row]
        point = self.climber.limbs[limb].contact.held_at(foothold.pose).translation
        mount, shape = OF_SCENE + foothold.on, self.scene.bodies[foothold.on].shape
        return [
            Exemption(tip.body.name, mount, point, APPROACH, tip.deepest + TOLERANCE)
            for tip in sunk_tips(self.climber)[limb]
            if not why_apart(tip.body.shape, shape)
        ]

    @cached_property
    def _pairs(self) -> tuple[list[Pair], NDArray[np.intp]]:
        """All pairs, and the body of the scene of each; the last: none."""
        pairs = self_pairs(self.climber.robot, self.apart - TOLERANCE)
        told = [len(self.scene.bodies)] * len(pairs)
        for k, (name, placed) in enumerate(self.scene.bodies.items()):
            for body in climber_bodies(self.climber):
                if not why_apart(body.shape, placed.shape):
                    pairs.append(Pair(body.name, OF_SCENE + name, self.clearance - TOLERANCE))
                    told.append(k)
        return pairs, np.array(told, dtype=np.intp)

    @cached_property
    def _sweeper(self) -> Sweeper:
        robot = self.climber.robot
        model, bodies = robot.model, {body.name: body for body in climber_bodies(self.climber)}
        for limb, tips in zip(self.climber.limbs, sunk_tips(self.climber), strict=True):
            contact = model.frames[frame_index(model, limb.frame)].placement * limb.placement.translation
            for body, *_ in tips:
                grasp = model.frames[frame_index(model, body.link)].placement.actInv(contact)
                bodies[body.name] = replace(body, grasp=grasp)
        world = [SweptBody(OF_SCENE + name, b.shape, placement=b.placement) for name, b in self.scene.bodies.items()]
        return Sweeper(SweptScene(Tree.of_model(model), [*bodies.values(), *world], self._pairs[0]))

    @cached_property
    def _size(self) -> float:
        """No point of the robot is further from its base [m]; sliding joints count at their limits."""
        robot = self.climber.robot
        model, most = robot.model, 0.0
        slides = {
            j: max(
                abs(float(model.lowerPositionLimit[model.idx_qs[j]])),
                abs(float(model.upperPositionLimit[model.idx_qs[j]])),
            )
            for j in range(2, model.njoints)
            if model.joints[j].shortname().startswith("JointModelP")
        }
        for body in climber_bodies(self.climber):
            frame = model.frames[frame_index(model, body.link)]
            way = [
                float(np.linalg.norm(model.jointPlacements[j].translation)) + slides.get(j, 0.0)
                for j in model.supports[frame.parentJoint]
                if j > 1
            ]
            place = frame.placement * (body.placement or pin.SE3.Identity())
            most = max(most, sum(way) + float(np.linalg.norm(place * body.shape.center)) + body.shape.reach)
        return most

    @cached_property
    def _centers(self) -> Array:
        return np.array([b.placement * b.shape.center for b in self.scene.bodies.values()]).reshape(-1, 3)

    @cached_property
    def _radii(self) -> Array:
        return np.array([b.shape.reach for b in self.scene.bodies.values()])


class SunkTip(NamedTuple):
    """A body that a limb's last joint moves.

    Attributes:
        body: it. sink: how far it goes beyond the contact's frame [m]. deepest: how deep it may be in what the limb
            holds, on its way [m].
    """

    body: SweptBody
    sink: float
    deepest: float


@lru_cache(maxsize=16)
def sunk_tips(climber: Climber) -> list[list[SunkTip]]:
    """Of each limb the bodies that its last joint moves, and a ball about its contact's point where these do not keep
    it out: where it lies out of them all, and where tips tilt, so that how deep they are does not say where it is.
    """
    model, bodies, out = climber.robot.model, bodies_of(climber.robot), []
    for limb, chain in zip(climber.limbs, climber.chains, strict=True):
        tips, off, tilts = list[SunkTip](), np.inf, limb.contact.fixed == "position"
        contact = model.frames[frame_index(model, limb.frame)].placement * limb.placement
        for body in bodies:
            on = model.frames[frame_index(model, body.link)]
            if on.parentJoint != chain[-1]:
                continue
            placed = PlacedShape(body.shape, on.placement * (body.placement or pin.SE3.Identity()))  # type: ignore[arg-type]  # links have solids
            sink = max(0.0, _beyond(placed, contact, tilts) - limb.contact.height)
            tips.append(SunkTip(body, sink, sink + SINK))
            point = placed.placement.actInv(contact.translation)
            off = min(off, float(segments_from(placed.shape, point, point)))
        if tilts or off > SINK:
            ball = SweptBody(f"contact of {limb.name}", Sphere(POINT), limb.frame, limb.placement)
            tips.append(SunkTip(ball, POINT, POINT + POINT_SINK))
        out.append(tips)
    return out


def climber_bodies(climber: Climber) -> list[SweptBody]:
    """Shapes of a climber's links, and the balls of :func:`sunk_tips`."""
    bodies = {body.name: body for body in bodies_of(climber.robot)}
    return list((bodies | {tip.body.name: tip.body for tips in sunk_tips(climber) for tip in tips}).values())


def stray_of(climber: Climber) -> float:
    """How far contacts may be off their curves near footholds [m]: half of how deep any tip may sink in there."""
    return min((tip.deepest - tip.sink for tips in sunk_tips(climber) for tip in tips), default=SINK) / 2.0


def _beyond(placed: PlacedShape, contact: pin.SE3, tilts: bool) -> float:
    """How far a shape goes beyond a contact's frame, against its z axis [m], both in the last joint's frame; where it
    tilts, below the frame's origin when the way from that joint is tilted most.
    """
    a, b, radius = placed.capsule()
    if tilts:
        leg, along = contact.translation, b - a
        share = float(np.clip((leg - a) @ along / max(float(along @ along), 1e-12), 0.0, 1.0))
        centre = a + share * along - leg
        # Up the leg, and beside it, which may be below when it leans
        up = -float(centre @ leg) / max(float(np.linalg.norm(leg)), 1e-9)
        beside = sqrt(max(float(centre @ centre) - up * up, 0.0))
        lowest = TILTED * up - sqrt(1.0 - TILTED**2) * beside if up > 0.0 else -hypot(up, beside)
        return max(0.0, radius - lowest)
    if placed.shape.is_round:
        return float(max(0.0, radius - min(contact.actInv(a)[2], contact.actInv(b)[2])))
    corners = placed.shape.triangles().reshape(-1, 3)
    at = contact.inverse() * placed.placement
    return max(0.0, -float((corners @ at.rotation[2] + at.translation[2]).min()))
