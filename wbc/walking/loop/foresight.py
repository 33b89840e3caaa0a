"""What the loop is about to do is proven clear before it does it: the motion as its timing has it, delays included."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import inf

import numpy as np
from numpy.typing import NDArray

from wbc.clearance import (
    Exemption,
    Motion,
    Nearest,
    Pair,
    Sweeper,
    SweptBody,
    SweptScene,
    Tree,
    bodies_of,
    self_pairs,
)
from wbc.multibody import pin
from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.arms.puma import limb_of
from wbc.walking.holds.structure import Structure
from wbc.walking.loop.machine import Machine
from wbc.walking.loop.progress import PlanProgress
from wbc.walking.loop.state import Swinging
from wbc.walking.planner.around import MOUNTED
from wbc.walking.planner.plan import Plan
from wbc.walking.planner.proof import DEPTH, things_of
from wbc.walking.planner.swings.law import SwingLaw

#: Time from knot to knot of a motion [s]: between them joints go straight
STEP = 0.025
#: A hand that holds, whose posture is foreseen less well than its place, may be so much deeper than its roundness in
#: what its hold is mounted on [m]
HELD_DEPTH = 0.03
#: A swinging arm that is off its way comes back to it within some of these [s]
FADES = 0.15
#: An arm may lag by so much, its hand less, whose joints cannot follow for their accelerations [m]
LAGS = 0.005
#: What clearances may lack, and what the proof may miss, together less than the checker leaves [m]
SLACK, TOLERANCE = 8e-5, 1.5e-5


@dataclass(frozen=True, eq=False)
class Timing:
    """k instants of a motion: times [s], path times of the body [s], and the clock of the swinging hand [s]."""

    times: Array
    path_times: Array
    clock: Array


class Foresight:
    """Sweeps of a walker among what stands around it.

    Args:
        structure: its surface and obstacles; where holds are, for hands that may touch what these are mounted on.

    Attributes:
        left: row of an arm -> places of holds that it has left [m], see :class:`wbc.walking.loop.machine.Machine`.
    """

    def __init__(self, walker: Walker, structure: Structure) -> None:
        self.walker, self.structure = walker, structure
        tree, clearance = Tree.of_model(walker.robot.model), walker.arm_data.clearance - SLACK
        self._hands = [self._grasping(tree, arm) for arm in range(len(walker.arms))]
        hands = {body.name: body for mine in self._hands for body in mine}
        bodies = [hands.get(body.name, body) for body in bodies_of(walker.robot)]
        things = list(things_of(structure))
        pairs = self_pairs(walker.robot, clearance) if walker.robot.self_pairs is not None else []
        pairs += [Pair(body.name, thing.name, clearance) for body, thing in product(bodies, things)]
        self._sweeper = Sweeper(SweptScene(tree, [*bodies, *things], pairs))
        # Whether something comes nearer than a distance is found the same in C and in numpy; how near it comes, within
        # a tolerance, is not
        wider = [replace(pair, required=pair.required + LAGS) for pair in pairs]
        self._wider = Sweeper(SweptScene(tree, [*bodies, *things], wider))
        # Of each arm the pairs with the links that bring its hand along, but the first, which turns about itself
        bringing = [
            {body.name for body in bodies if body.link in arm.links[1:] and body not in mine}
            for arm, mine in zip(walker.arms, self._hands, strict=True)
        ]
        self._bringing = [
            np.flatnonzero([pair.first in names or pair.second in names for pair in pairs]) for names in bringing
        ]
        self._tree, self._mounts = tree, dict[bytes, tuple[str, ...]]()
        self.left: Mapping[int, Sequence[Array]] = {}
        column = {name: arm.q.start + k for arm in walker.arms for k, name in enumerate(arm.joints)}
        self._columns = [column[name] for name in tree.coordinates]

    def nearest(
        self,
        times: Array,
        q: Array,
        left: Sequence[tuple[int, Array]],
        to: Sequence[tuple[int, Array]] = (),
        held: Mapping[int, int] | None = None,
    ) -> Nearest | None:
        """The first instant found at which two bodies are too near in a motion ``[k, nq]``; None: proven clear.

        Args:
            times: of the rows [s]. left, to: (row of an arm, place of a hold [m]): its hand may touch what a hold is on
                until it is no longer near it, and from where it comes near to the one that it goes to.
            held: row of an arm -> row of the hold, of hands that hold all the time.
        """
        motion = self.motion(times, q)
        exempt = [one for arm, place in self.holds(held or {}) for one in self._exemptions(arm, place, HELD_DEPTH)]
        for arm, place in left:
            far = self._far(arm, q, place)
            until = float(times[far[0]]) if len(far) else inf
            exempt += self._exemptions(arm, place, DEPTH, until=until)
        for arm, place in to:
            far = self._far(arm, q, place)
            since = float(times[far[-1]]) if len(far) else -inf
            exempt += self._exemptions(arm, place, DEPTH, since=since)
        return self._sweeper.sweep(motion, exemptions=exempt, tolerance=TOLERANCE).violation

    def close(self, times: Array, q: Array, arm: int) -> bool:
        """Whether the arm that brings a hand along comes within its clearance and :data:`LAGS` of anything in a motion
        ``[k, nq]``.
        """
        pairs = self._bringing[arm]
        return self._wider.sweep(self.motion(times, q), pairs, tolerance=TOLERANCE).violation is not None

    def motion(self, times: Array, q: Array) -> Motion:
        """Of configurations ``[k, nq]`` at times [s]; joints go straight between them."""
        return Motion.linear(self._tree, times, q[:, self._columns], q[:, :7])

    def rows(self, machine: Machine, progress: PlanProgress, swinging: Swinging | None, when: Timing) -> Array:
        """Configurations ``[k, nq]`` that a plan has at instants; hands that hold keep their axes. Joint 6, which turns
        a hand about its own axis, moves nothing and stays.
        """
        q, held, path = machine.q, machine.held, progress.plan.path
        out = np.repeat(q[None], len(when.times), axis=0)
        poses = [path.at(u)[0] for u in when.path_times.tolist()]
        out[:, :7] = [pin.SE3ToXYZQUAT(pose) for pose in poses]
        samples, grips, limb = when.path_times / path.spacing, progress.grips, limb_of(self.walker)
        for k, arm in enumerate(self.walker.arms):
            grip, frames = np.array(progress.grip[k]), np.array([(pose * arm.base).homogeneous for pose in poses])
            if swinging is None or swinging.arm != k:
                if k in held:
                    place = self.structure.positions[held[k]]
                    out[:, arm.q] = self._holding(frames, q[arm.q], place, machine.chain.axes[k])
                continue
            law = swinging.law
            parts, places = np.interp(when.clock, law.times, law.parts), np.empty((len(samples), 3))
            for axis in range(3):
                places[:, axis] = np.interp(when.clock, law.times, law.places[:, axis])
            last = grips.between(np.array(swinging.grip), samples)[:, limb.guided :]
            first = np.array(swinging.first_wrist) if swinging.first_wrist is not None else None
            first = grips.between(grip, samples)[:, limb.guided :] if first is None else first
            guide = first + parts[:, None] * (last - first)
            angles, _ = limb.follow(frames[None], places[None], guide[None], self.walker.margins)
            # What the arm is off now it takes back in a while
            fades = np.exp(-when.times / FADES)[:, None]
            out[:, arm.q] = angles[0] + fades * (q[arm.q] - angles[0, 0])
        return out

    def hand(self, arm: int, q: Array) -> Array:
        """Where the hand of an arm is in configurations ``[k, nq]``, in the structure ``[k, 3]`` [m]."""
        mine = self.walker.arms[arm]
        local = np.asarray(limb_of(self.walker).points(q[:, mine.q]))[:, -1]
        in_body = local @ mine.base.rotation.T + mine.base.translation
        turns = np.array([pin.Quaternion(row).matrix() for row in q[:, 3:7]])
        out: Array = np.einsum("kij,kj->ki", turns, in_body) + q[:, :3]
        return out

    def _holding(self, frames: Array, now: Array, place: Array, axis: Array) -> Array:
        """Joints of an arm whose hand stays at a place along its axis, from frames of its base ``[k, 4, 4]`` on; where
        it is out of reach it goes with the body.

        Args:
            now: its joints, at the first frame.
        """
        limb, turns = limb_of(self.walker), frames[:, :3, :3]
        points, axes = np.einsum("kji,kj->ki", turns, place - frames[:, :3, 3]), np.einsum("kji,j->ki", turns, axis)
        found, solved = limb.held(points, axes)
        branch = int(np.abs(found[0, :, :-1] - now[:-1]).max(axis=1).argmin())
        out = np.unwrap(found[:, branch], axis=0)
        out[:, -1] = now[-1]
        out[~solved[:, branch]] = now
        return out

    def may_bring(self, plan: Plan, arm: int, law: SwingLaw, held: Mapping[int, int], q: Array) -> bool:
        """Whether a free hand may go along a law to where a plan begins, while the body stands and other hands hold."""
        count, grips, limb = max(int(law.duration / STEP), 1) + 1, plan.grips, limb_of(self.walker)
        assert grips is not None
        times = np.linspace(0.0, law.duration, count)
        out = np.repeat(q[None], count, axis=0)
        pose = pin.SE3(plan.path.poses[0])
        out[:, :7] = pin.SE3ToXYZQUAT(pose)
        there = {k: self.structure.index(plan.start[k]) for k in range(arm + 1) if k not in held}
        for k in set(there) - {arm}:
            # It has been brought before
            out[:, self.walker.arms[k].q] = grips.posture_at(plan.chain[k][0], 0)
        mine = self.walker.arms[arm]
        first, last = q[mine.q][limb.guided :], grips.posture_at(plan.chain[arm][0], 0)[limb.guided :]
        guide = first + np.interp(times, law.times, law.parts)[:, None] * (last - first)
        places = np.stack([np.interp(times, law.times, column) for column in law.places.T], axis=1)
        frames = np.repeat((pose * mine.base).homogeneous[None], count, axis=0)
        angles, _ = limb.follow(frames[None], places[None], guide[None], self.walker.margins)
        out[:, mine.q] = angles[0]
        left = self.around(arm, places[0])
        for k in range(arm + 1, len(self.walker.arms)):
            if k not in held:
                # It is still where it left its hold
                left += self.around(k, self.hand(k, out[:1])[0])
        return self.nearest(times, out, left, self.holds(there), held) is None

    def holds(self, held: Mapping[int, int]) -> list[tuple[int, Array]]:
        """(arm, place) of hands on holds."""
        return [(arm, self.structure.positions[hold]) for arm, hold in held.items() if hold >= 0]

    def around(self, arm: int, place: Array) -> list[tuple[int, Array]]:
        """(arm, place) of the holds that an open hand at a place [m] has left; none known: of those near to it."""
        if arm in self.left:
            return [(arm, left) for left in self.left[arm]]
        off = np.linalg.norm(self.structure.positions - place, axis=1)
        near = np.flatnonzero(off < self.walker.arm_data.exempt_distance)
        return [(arm, self.structure.positions[hold]) for hold in near]

    def _grasping(self, tree: Tree, arm: int) -> list[SweptBody]:
        """The bodies that move with the hand of an arm, with its grasp point; none where the hand has no shape."""
        mine = self.walker.arms[arm]
        carried = tree.links[mine.hand][0]
        out = []
        for body in bodies_of(self.walker.robot):
            if tree.links[body.link][0] == carried:
                grasp = (tree.links[body.link][1].inverse() * tree.links[mine.hand][1]).translation
                out.append(SweptBody(body.name, body.shape, body.link, body.placement, grasp))
        return out

    def _far(self, arm: int, q: Array, place: Array) -> NDArray[np.int64]:
        """Rows ``[k, nq]`` in which a hand is not near a hold at a place [m]."""
        away = np.linalg.norm(self.hand(arm, q) - place, axis=1)
        return np.flatnonzero(away > self.walker.arm_data.exempt_distance)

    def _exemptions(
        self, arm: int, point: Array, deep: float, since: float = -inf, until: float = inf
    ) -> list[Exemption]:
        name, distance = point.tobytes(), self.walker.arm_data.exempt_distance
        if name not in self._mounts:
            self._mounts[name] = tuple(_mounted(self.structure, point))
        return [
            Exemption(hand.name, mount, point, distance, deep + float(getattr(hand.shape, "radius", 0.0)), since, until)
            for hand, mount in product(self._hands[arm], self._mounts[name])
        ]


def _mounted(structure: Structure, point: Array) -> list[str]:
    off = {f"obstacle {one.id}": abs(float(one.distance(point))) for one in structure.obstacles}
    if structure.surface is not None:
        off["the surface"] = abs(float(structure.surface.height(point)))
    return [name for name, distance in off.items() if distance <= MOUNTED]
