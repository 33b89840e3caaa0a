"""What keeps a climber from its goal: limbs that reach no foothold there, gaps, and steps that no stance can make."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from wbc.climb.foothold_graph import within_spans
from wbc.climb.goal import BodyPlace, LimbAt
from wbc.climb.stance import FREE_LIMB
from wbc.climb.world import ClimbWorld, PostureOutcome
from wbc.multibody import pin
from wbc.symbolic.joint_steps import place
from wbc.validation import Array

#: Contacts that are off by less may be closed by a body that moves by as little [m, rad]
NEARLY_CLOSED = 1e-3
#: Steps that are tried, those on the shortest ways to the goal first
SHORTEST_STEPS = 60


class Separation:
    """What a climber lacks on its way to a goal.

    Args:
        world: the climber and what it climbs. goal: where it is to go.
    """

    def __init__(self, world: ClimbWorld, goal: BodyPlace | LimbAt) -> None:
        self._world, self._goal = world, goal
        self._names = [limb.name for limb in world.climber.limbs]
        self._roots = np.array([world.limbs.root(limb) for limb in range(len(self._names))])
        self._lengths = np.array([row.length for row in world.limbs.numbers])

    def lacking(self) -> dict[int, str]:
        """Limbs that have no foothold within their length of a body at the goal, and how far it is."""
        out: dict[int, str] = {}
        if not isinstance(self._goal, BodyPlace):
            return out
        for limb, name in enumerate(self._names):
            reach = float(self._lengths[limb] + np.linalg.norm(self._roots[limb]))
            allowed = self._world.cone_of[limb] >= 0
            near = np.linalg.norm(self._world.places[allowed, 9:] - self._goal.position, axis=1)
            least = float(near.min()) if len(near) else np.inf
            if least > reach + self._goal.within:
                out[limb] = f"{name} reaches {reach:.3g} m and its nearest foothold is {least:.3g} m away"
        return out

    def cannot_be(self) -> bool:
        """Whether the limbs that have a foothold near the goal bear no wrench of every direction."""
        lacking = self.lacking()
        able = [limb for limb in range(len(self._names)) if limb not in lacking]
        return sum(max(self._world.forces(limb), default=0) for limb in able) < 6

    def gap(self, contacts: NDArray[np.int32]) -> str:
        """Why no foothold near the goal can be come to from some contacts, as limbs that hold are near each other; or
        nothing.
        """
        held = [int(self._world.hold[at]) for at in contacts if at >= 0]
        if len(self._lengths) < 2 or not held:
            return ""
        span, positions = self._span, self._world.scene.positions
        if isinstance(self._goal, BodyPlace):
            reach = float((self._lengths + np.linalg.norm(self._roots, axis=1)).max()) + self._goal.within
            wanted = np.linalg.norm(positions - self._goal.position, axis=1) <= reach
        else:
            wanted = np.arange(len(positions)) == self._world.scene.row(self._goal.foothold)
        reached = within_spans(positions, np.array(held), span)
        if (reached & wanted).any() or not wanted.any():
            return ""
        wide = cKDTree(positions[reached]).query(positions[~reached])[0].min()
        return (
            f"its footholds are beyond a gap of {wide:.3g} m, and limbs that hold at once are at most {span:.3g} m"
            f" apart: {int(reached.sum())} of {len(positions)} footholds can be come to"
        )

    def crossing(self, held: set[int], left: Array, margin: float, state: Array) -> str:
        """Which step from a foothold that was held to one that was not was not found, on the shortest ways to the goal,
        and what it lacks where none of those that were tried can be made; a robot of two limbs with its weight on the
        one, then on the other. Nothing where all were found.

        Args:
            held: rows of footholds, of two limbs those on which one has borne the robot alone.
            left: what is left to the goal from each place, in steps ``(places)``.
            margin: slack that there is to be [weights]. state: of the robot, as of :meth:`ClimbWorld.state_of`.
        """
        held, made, known = set(held), "", dict[tuple[int, int], list[tuple[float, str] | None]]()
        while steps := self._steps(held, left):
            best = (np.inf, "")
            for a, b in steps:
                if (a, b) not in known:
                    known[a, b] = [self._lacks(*pair, margin) for pair in self._pairs(a, b, state)]
                lacks = known[a, b]
                if None in lacks:
                    # Steps that could be made lead on from there
                    made = made or f"{self._told(a, b)} was not found"
                    held.add(b)
                    break
                best = min([best, *((off, f"{self._told(a, b)} {text}") for off, text in filter(None, lacks))])
            else:
                said = f"none of the {len(steps)} shortest steps to footholds that were not come to was found"
                return f"{said}: {best[1]}" if best[1] else made
        return made

    def _lacks(self, contacts: NDArray[np.int32], begun: Array, margin: float) -> tuple[float, str] | None:
        """How far two limbs are from holding, with the weight on either where there is no third one, also in words;
        None: they can.
        """
        two, world = len(self._names) == 2, self._world
        for limb in np.flatnonzero(contacts >= 0).tolist():
            alone = np.where(np.arange(len(contacts)) == limb, contacts, FREE_LIMB).astype(np.int32)
            how, end, slack = world.stand(contacts, alone if two else contacts, margin, begun, followed=False)
            on = f"with the weight on {world.scene.footholds[world.hold[contacts[limb]]].id} " if two else ""
            if how == PostureOutcome.NOT_REACHED:
                off, turned = self._off(contacts, end)
                if max(off, turned) >= NEARLY_CLOSED:
                    return off + world.length * turned, f"{on}is out of reach by {off:.3g} m and {turned:.3g} rad"
                slack, _ = world.slack(alone, world.climber.center_of_mass(world.q_of(end)))
            if two and slack < margin:
                return margin - slack, f"{on}lacks {margin - slack:.3g} of the weight"
        return None

    def _off(self, contacts: NDArray[np.int32], state: Array) -> tuple[float, float]:
        """How far contacts are from where they hold at most [m], and how far turned as far as that is fixed [rad]."""
        q, off, turned = self._world.q_of(state), 0.0, 0.0
        for limb in np.flatnonzero(contacts >= 0).tolist():
            pose, at = self._world.climber.contact_pose(q, limb), self._world.places[contacts[limb]]
            off = max(off, float(np.linalg.norm(pose.translation - at[9:])))
            if self._world.climber.fixed(limb) == "pose":
                turned = max(turned, float(np.linalg.norm(pin.log3(at[:9].reshape(3, 3).T @ pose.rotation))))
        return off, turned

    @property
    def _span(self) -> float:
        """How far two limbs that hold at once are apart at most [m]."""
        apart = np.linalg.norm(self._roots[:, None] - self._roots, axis=2) + self._lengths[:, None] + self._lengths
        return float(apart[~np.eye(len(self._lengths), dtype=bool)].max())

    def _steps(self, held: set[int], left: Array) -> list[tuple[int, int]]:
        """Pairs of footholds, the first one held, on the shortest ways to the goal first."""
        world, positions = self._world, self._world.scene.positions
        rest = np.full(len(positions), np.inf)
        np.minimum.at(rest, world.hold, left * world.length)
        rows = np.array(sorted(held))
        others = np.setdiff1d(np.flatnonzero(np.isfinite(rest)), rows)
        if not len(rows) or not len(others) or len(self._names) < 2:
            return []
        away = np.linalg.norm(positions[rows][:, None] - positions[others], axis=2)
        if rest[rows].min() <= world.length:
            return []
        worth = np.where(away <= self._span, away + rest[others], np.inf)
        first = np.argsort(worth, axis=None)[:SHORTEST_STEPS]
        k, j = np.unravel_index(first[np.isfinite(worth.ravel()[first])], worth.shape)
        return list(zip(rows[k].tolist(), others[j].tolist(), strict=True))

    def _pairs(self, a: int, b: int, state: Array) -> Iterator[tuple[NDArray[np.int32], Array]]:
        """Contacts of two limbs at two footholds, turned alike, and states to begin with."""
        world = self._world
        turns = [np.flatnonzero(world.hold == row) for row in (a, b)]
        for i, j in itertools.permutations(range(len(self._names)), 2):
            for first, other in zip(*(places[: min(map(len, turns))] for places in turns), strict=True):
                if min(world.cone_of[i, first], world.cone_of[j, other]) < 0:
                    continue
                contacts = np.full(len(self._names), FREE_LIMB, dtype=np.int32)
                contacts[[i, j]] = first, other
                begun, touch = state.copy(), world.touch[i]
                turn = state[:9].reshape(3, 3)
                if world.climber.fixed(i) == "pose":
                    turn = world.places[first, :9].reshape(3, 3) @ touch[:9].reshape(3, 3).T
                begun[:12] = place(pin.SE3(turn, world.places[first, 9:] - turn @ touch[9:]))
                yield contacts, begun

    def _told(self, a: int, b: int) -> str:
        first, other = (self._world.scene.footholds[row] for row in (a, b))
        way = other.pose.translation - first.pose.translation
        turned = float(np.degrees(np.arccos(np.clip(first.pose.rotation[:, 2] @ other.pose.rotation[:, 2], -1.0, 1.0))))
        text = f"the step from {first.id} to {other.id}, {np.linalg.norm(way):.3g} m away"
        return f"{text} and {way[2]:+.3g} m higher, on ground turned by {turned:.0f} degrees,"
