"""The proof that a plan touches nothing: all bodies over the motion that the loop will make of it, at all times.

A swinging hand follows its law from when it is open. The body goes along its path at full pace; where it has to wait
for the hand, its pace is less over the whole of the swing, evenly. Hands that hold do so where the body is. A hand may
be near to what its hold is mounted on while it is at the hold, see :class:`wbc.clearance.Exemption`.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from wbc.clearance import EndlessCylinder, Exemption, Motion, Pair, Sweeper, SweptBody, SweptScene, Tree
from wbc.clearance.scene import bodies_of, self_pairs
from wbc.clearance.sweep import Nearest
from wbc.multibody import pin
from wbc.robots import Walker
from wbc.shapes import HalfSpace
from wbc.validation import Array
from wbc.walking.holds.structure import Structure
from wbc.walking.holds.surface import PlaneSurface
from wbc.walking.planner.around import around
from wbc.walking.planner.grips.table import Ints
from wbc.walking.planner.swings.law import SwingLaw
from wbc.walking.planner.swings.move import Move
from wbc.walking.planner.swings.swings import Swings

#: Joints go evenly between instants that are this far apart [s]: what they truly do is within 0.3 mm of that
EVERY = 0.02
#: How much deeper than its roundness a hand may be in what its hold is mounted on; what is left unproven [m]
DEPTH, TOLERANCE = 0.005, 1e-4
#: The bodies' free joint in a swept tree
BASE = 0
#: No hand in the air
NONE_LEFT: Mapping[int, Array] = {}


class ClearScene:
    """All bodies of a walker on a structure, and which must be how far from which.

    Args:
        walker, structure: as of a plan.
    """

    def __init__(self, walker: Walker, structure: Structure) -> None:
        self.walker, self.structure = walker, structure
        self._around = around(walker, structure)
        self.tree = tree = Tree.of_model(walker.robot.model)
        required = walker.arm_data.clearance - TOLERANCE
        self._hands = [self._with_hand(arm.hand) for arm in walker.arms]
        bodies = [self._grasping(body) for body in bodies_of(walker.robot)]
        things = list(things_of(structure))
        pairs = list(self_pairs(walker.robot, required)) if walker.robot.self_pairs is not None else []
        pairs += [Pair(body.name, thing.name, required) for body in bodies for thing in things]
        self._sweeper = Sweeper(SweptScene(tree, [*bodies, *things], pairs)) if pairs else None
        self._things = [thing.name for thing in things]
        self._of_hand = [[body for body in bodies if body.link in hand] for hand in self._hands]
        places = {name: k for k, name in enumerate(tree.coordinates)}
        self._columns = [np.array([places[joint] for joint in arm.joints]) for arm in walker.arms]

    def _with_hand(self, hand: str) -> set[str]:
        """Links that move with a hand's frame."""
        frame = self.tree.links[hand][0]
        return {link for link in self.walker.robot.shapes if self.tree.links[link][0] == frame}

    def _grasping(self, body: SweptBody) -> SweptBody:
        for arm, links in zip(self.walker.arms, self._hands, strict=True):
            if body.link in links:
                grasp = (self.tree.links[body.link][1].inverse() * self.tree.links[arm.hand][1]).translation
                return SweptBody(body.name, body.shape, body.link, body.placement, grasp)
        return body

    def touched(
        self,
        times: Array,
        poses: Array,
        postures: Sequence[Array],
        holds: Sequence[Ints],
        left: Mapping[int, Array] = NONE_LEFT,
    ) -> Nearest | None:
        """An instant at which two bodies are too near to each other; None where there is provably none.

        Args:
            times: of instants ``[k]`` [s]. poses: of the body ``[k, 4, 4]``. postures: of every arm ``[k, joints]``
                [rad]. holds: rows of the holds that each hand is at, leaves or comes to. left: rows of arms -> where
                their hands begin in the air: they may have just left a hold there that is gone ``[3]`` [m].
        """
        if self._sweeper is None:
            return None
        scalars = np.zeros((len(times), len(self.tree.coordinates)))
        for columns, rows in zip(self._columns, postures, strict=True):
            scalars[:, columns[: rows.shape[1]]] = rows
        u, _, v = np.linalg.svd(poses[:, :3, :3])
        free = np.concatenate([(u @ v).reshape(-1, 9), poses[:, :3, 3]], axis=1)[None]
        controls = np.stack([scalars[:-1], scalars[1:]], axis=2)
        motion = Motion(times, controls, free, np.zeros(scalars.shape[1]), np.zeros((1, 2)))
        exempt = list(self._exemptions(holds))
        for arm, point in left.items():
            exempt += self._leaving(arm, point)
        return self._sweeper.sweep(motion, exemptions=exempt, tolerance=TOLERANCE).violation

    def _leaving(self, arm: int, point: Array) -> Iterator[Exemption]:
        """Of what a hand is near to where it begins."""
        surface, near = self.structure.surface, self.walker.arm_data.clearance + self._around.radii[-1]
        gaps = [float(one.distance(point)) for one in self.structure.obstacles]
        gaps += [] if surface is None else [float(surface.height(point))]
        for k in np.nonzero(np.array(gaps) < near)[0].tolist():
            for body in self._of_hand[arm]:
                depth = DEPTH + float(getattr(body.shape, "radius", 0.0))
                yield Exemption(body.name, self._things[k], point, self._around.near_hold, depth)

    def _exemptions(self, holds: Sequence[Ints]) -> Iterator[Exemption]:
        mounted, radius = self._around.mounted, self._around.near_hold
        for bodies, rows in zip(self._of_hand, holds, strict=True):
            for row in np.unique(rows[rows >= 0]).tolist():
                point = self.structure.positions[row]
                for body in bodies:
                    depth = DEPTH + float(getattr(body.shape, "radius", 0.0))
                    for k in np.nonzero(mounted[row])[0].tolist():
                        yield Exemption(body.name, _thing_name(self.structure, k), point, radius, depth)


@functools.lru_cache(maxsize=4)
def clear_scene(walker: Walker, structure: Structure) -> ClearScene:
    """The bodies and their pairs; kept from plan to plan."""
    return ClearScene(walker, structure)


class Proof:
    """Where the swings and stances of one path touch something; answers are cached.

    Args:
        swings: over the path.
    """

    def __init__(self, swings: Swings) -> None:
        self._swings, self._scene = swings, clear_scene(swings.walker, swings.structure)
        self._known: dict[tuple[object, ...], Nearest | None] = {}

    def of_swing(self, move: Move, law: SwingLaw, key: Sequence[int]) -> Nearest | None:
        """Where a swing brings two bodies too near to each other, at times since the hand was lifted; None: nowhere.

        Args:
            key: grips of all arms before it.
        """
        name = move, law, *key
        if name in self._known:
            return self._known[name]
        swings = self._swings
        path, grips = swings.path, swings.grips
        whole = max(move.duration, 0.0 if move.delay else (move.land - move.lift) * path.spacing)
        times = np.linspace(0.0, whole, max(int(np.ceil(whole / EVERY)), 1) + 1)
        samples = move.lift + (move.land - move.lift) / whole * times
        postures = [grips.between(np.array(grip), samples) for grip in key]
        postures[move.arm] = swings.posture_along(move, law, samples, times - swings.latch)
        holds = [grips.hold[[grip]] for grip in key]
        holds[move.arm] = grips.hold[[move.source, move.target]]
        self._known[name] = self._scene.touched(times, path.blended(samples), postures, holds)
        return self._known[name]

    def of_stance(self, key: Sequence[int], first: int, last: int) -> Nearest | None:
        """Where a stance brings two bodies too near to each other, from one sample of the path to another."""
        name = *key, first, last
        if last <= first or name in self._known:
            return self._known.get(name)
        path, grips = self._swings.path, self._swings.grips
        samples = np.arange(first, last + 1)
        postures = [grips.posture(np.array(grip), samples) for grip in key]
        holds = [grips.hold[[grip]] for grip in key]
        times = np.asarray(samples * path.spacing, dtype=np.float64)
        self._known[name] = self._scene.touched(times, path.poses[samples], postures, holds)
        return self._known[name]


def things_of(structure: Structure) -> Iterator[SweptBody]:
    """Obstacles and surface as bodies of a sweep, under the names that refusals have for them."""
    for k, one in enumerate(structure.obstacles):
        yield SweptBody(_thing_name(structure, k), one.shape, placement=one.placement)
    surface = structure.surface
    if surface is not None:
        shape = HalfSpace() if isinstance(surface, PlaneSurface) else EndlessCylinder(surface.radius)
        yield SweptBody(_thing_name(structure, len(structure.obstacles)), shape, placement=pin.SE3(surface.pose))


def _thing_name(structure: Structure, k: int) -> str:
    return f"obstacle {structure.obstacles[k].id}" if k < len(structure.obstacles) else "the surface"
