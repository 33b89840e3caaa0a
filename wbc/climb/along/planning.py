"""A plan along a given way of the body: spans, swings, then the motion, timed and proven clear."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from wbc import validation
from wbc.climb.along.body_track import BodyTrack
from wbc.climb.along.search import AlongSearch, Standing
from wbc.climb.along.spans import SpanTable
from wbc.climb.along.swings import SwingLimits, Swings
from wbc.climb.clear import Clearances
from wbc.climb.climber import Climber
from wbc.climb.joint_values import joint_values, with_joint_values
from wbc.climb.motion import MotionOptions
from wbc.climb.plan import ContactMove, ContactPlan
from wbc.climb.reach import LIMIT_MARGIN
from wbc.climb.scene import ClimbScene, reaches
from wbc.climb.search import counted_words, no_stances
from wbc.climb.stance import FREE_LIMB, Stance
from wbc.climb.time_law import fastest
from wbc.climb.world import ClimbWorld
from wbc.errors import RangeError
from wbc.multibody import pin
from wbc.validation import Array

#: How many times slower than asked a way is planned, with how many postures of a limb at a foothold, and how many
#: standings the search keeps of each number of swings, one after the other
TRIED = ((1.0, 1, 8), (1.0, 2, 8), (1.0, 1, 40), (1.0, 2, 40), (1.2, 1, 40), (1.5, 2, 40), (2.0, 2, 40), (4.0, 2, 40))
#: A contact rises by this share of the shortest limb's reach
RISE = 1.0 / 20.0
#: Time between knots where the way is slow [s]
SLOW = 0.055
#: How far a start may be from the beginning of the way [m, rad]
AT_BEGINNING = 1e-3
#: How often swings that are not proven clear are left out
AGAIN = 20


@dataclass(frozen=True)
class AlongOptions:
    """How a plan along a way is made.

    Attributes:
        motion: clearances, lift, and shares of the joints' limits.
        margin: least slack of equilibrium of the limbs that stay, in shares of the weight.
        limits: distance from limits of joints [m, rad].
        moves: how many standings are looked at for each speed and width of the search, about.
    """

    motion: MotionOptions = field(default_factory=MotionOptions)
    margin: float = 0.02
    limits: float = LIMIT_MARGIN
    moves: int = 3000

    def __post_init__(self) -> None:
        validation.instance("AlongOptions.motion", self.motion, MotionOptions, "MotionOptions")
        for name in ("margin", "limits"):
            validation.scalar(f"AlongOptions.{name}", getattr(self, name), low=0.0)
        validation.integer("AlongOptions.moves", self.moves, 1)


def plan_along(
    climber: Climber,
    scene: ClimbScene,
    track: BodyTrack,
    start: Stance | None = None,
    options: AlongOptions | None = None,
) -> ContactPlan:
    """A plan on which the body goes its way at its speed and limbs change their footholds meanwhile, one at a time.
    Where joints are too slow for it the body is slower, as much as they need.

    Args:
        track: way of the body. start: where the robot stands, its body at the beginning of the way; None: the
            footholds at the beginning are sought as well.

    Raises:
        NoStancesError: no footholds lead along the way; how far they do. RangeError: a start that is not at the
            beginning. What :class:`Clearances` raises.
    """
    given = validation.instance("options", options or AlongOptions(), AlongOptions, "AlongOptions")
    validation.instance("track", track, BodyTrack, "a BodyTrack")
    motion = given.motion
    world = ClimbWorld(climber, scene, start, given.limits, motion.clearance, motion.apart)
    limits = SwingLimits(
        motion.lift or RISE * float(reaches(climber).min()), motion.speeds.share, motion.speeds.acceleration_share
    )
    clearances = Clearances(climber, scene, motion.clearance, motion.apart)
    first = None if start is None else _begun(climber, track, start)
    furthest, said = 0.0, ""
    searches = dict[tuple[float, int], tuple[AlongSearch, tuple[int, ...] | None]]()
    for slower, postures, width in TRIED:
        if (slower, postures) not in searches:
            slow = replace(track, speed=track.speed / slower, turn_rate=track.turn_rate / slower)
            table = SpanTable(world, slow, postures)
            rows = None if first is None else _rows(table, world, first)
            searches[slower, postures] = AlongSearch(table, Swings(table, limits), given.margin, given.moves), rows
        search, rows = searches[slower, postures]
        for _ in range(AGAIN):
            last = search.run(rows, width)
            if last is None:
                break
            values = _values(search, chain := last.chain)
            plan = None if values is None else _TimedWay(search, chain, values, motion, slower)
            if plan is not None and plan.proven(clearances):
                return plan.contact_plan()
        part = search.furthest / search.end
        if part >= furthest:
            furthest, said = part, counted_words(search.outcomes)
    reason = f"no footholds lead along the way: all limbs can hold to {100.0 * furthest:.0f} % of it"
    raise no_stances("track", track.duration, f"{reason} ({said})" if said else reason, "reach", 0.0)


def _begun(climber: Climber, track: BodyTrack, start: Stance) -> Stance:
    """The start, with its body at the beginning of the way."""
    off = pin.log6(climber.body_pose(start.q).actInv(track.poses[0])).vector
    if float(np.abs(off).max()) > AT_BEGINNING:
        away = float(np.linalg.norm(off[:3]))
        reason = f"its body is {away:.3g} m and {np.linalg.norm(off[3:]):.3g} rad off the beginning of the way"
        raise RangeError("start.q", climber.body_pose(start.q).translation.round(4).tolist(), reason)
    if FREE_LIMB in start.contacts:
        name = climber.limbs[start.contacts.index(FREE_LIMB)].name
        raise RangeError("start.contacts", start.contacts, f"{name} holds nothing, and all limbs have to at first")
    return start


def _rows(table: SpanTable, world: ClimbWorld, start: Stance) -> tuple[int, ...]:
    """Spans that begin with the start's postures."""
    rows = []
    for limb, place in enumerate(world.start):
        row = table.begun(limb, place, world.climber.angles(start.q, limb))
        if row < 0:
            at = world.scene.footholds[start.contacts[limb]].id
            raise RangeError("start.q", at, f"{world.climber.limbs[limb].name} is not at this foothold")
        rows.append(row)
    return tuple(rows)


def _denser(x: Array, speed: Array, span: Array) -> tuple[tuple[Array, Array, NDArray[np.intp]], Array]:
    """Knots at all instants and, where the way is slow, between them: times, places on the way, and which knots the
    instants are; and speeds along the way.
    """
    times, places, rates, knot, now = [np.zeros(1)], [x[:1]], [speed[:1]], [0], 0.0
    for k, long in enumerate(span):
        t = long * np.arange(1, (count := max(1, int(np.ceil(long / SLOW)))) + 1) / count
        gain = (speed[k + 1] - speed[k]) / long
        times.append(now + t)
        places.append(np.minimum(x[k] + t * (speed[k] + 0.5 * gain * t), x[k + 1]))
        rates.append(speed[k] + gain * t)
        knot.append(knot[-1] + count)
        now += long
    return (np.concatenate(times), np.concatenate(places), np.array(knot)), np.concatenate(rates)


def _values(search: AlongSearch, chain: list[Standing]) -> Array | None:
    """Numbers of the joints at all instants ``(n, nv - 6)``; None: a limb cannot go so, which the search is told."""
    climber = search.world.climber
    out = np.tile(joint_values(climber.robot, climber.rest[None])[0], (search.end + 1, 1))
    for limb in range(len(climber.limbs)):
        columns, now, row = climber.joints(limb) - 6, 0, chain[0].rows[limb]
        for standing in [*chain[1:], None]:
            if standing is not None and standing.limb != limb:
                continue
            last = search.end if standing is None else standing.lift
            out[now : last + 1, columns] = search.table.held(limb, row, now, last)
            if np.isnan(out[now : last + 1, columns]).any():
                search.table.cut(limb, row)
                return None
            if standing is None:
                break
            angles = search.swung(standing)
            if angles is None:
                return None
            out[standing.lift : standing.now + 1, columns] = angles
            row, now = standing.rows[limb], standing.now
    for coupling in climber.robot.couplings:
        out[:, coupling.follower - 6] = coupling.ratio * out[:, coupling.leader - 6] + coupling.offset
    return out


class _TimedWay:
    """The motion of a way that was found."""

    def __init__(
        self, search: AlongSearch, chain: list[Standing], values: Array, motion: MotionOptions, slower: float
    ) -> None:  # fmt: skip
        self.climber = climber = search.world.climber
        self.search, self.chain = search, chain
        track, robot = search.table.track, climber.robot
        h = float(track.instants[1])
        slopes = np.gradient(values, h, axis=0)
        second = np.zeros_like(values)
        second[1:-1] = np.diff(values, 2, axis=0) / h**2
        second[0], second[-1] = second[1], second[-2]
        limits, dofs = robot.limits, np.arange(6, robot.nv)
        rate = motion.speeds.share * limits.velocity[dofs]
        pull = motion.speeds.acceleration_share * limits.acceleration[dofs]
        moves = np.isfinite(pull) & (np.abs(slopes).max(axis=0) > 1e-9)
        used = np.abs(slopes[:, moves]) / rate[moves]
        bound = np.minimum(1.0 / np.maximum(used.max(axis=1, initial=0.0), 1e-9) ** 2, slower**2)
        x = track.instants
        speed = fastest(x, slopes[:, moves] / pull[moves], second[:, moves] / pull[moves], bound)
        span = 2.0 * np.diff(x) / np.maximum(speed[1:] + speed[:-1], 1e-9)
        at, rate = _denser(x, speed, span)
        self.times, self._knot = at[0], at[2]
        # Joints are cubic between the instants of the way, the body goes evenly
        curve = CubicHermiteSpline(x, values, slopes, axis=0)
        q = np.tile(climber.rest, (len(rate), 1))
        twists = np.empty((len(rate), 6))
        for k, u in enumerate(at[1]):
            row = min(int(np.searchsorted(x, u, side="right")) - 1, len(x) - 2)
            part = (u - x[row]) / h
            one, other = track.sampled[row], track.sampled[row + 1]
            q[k] = climber.with_body(q[k], one * pin.exp6(pin.Motion(part * pin.log6(one.actInv(other)).vector)))
            twists[k] = (1.0 - part) * track.twists[row] + part * track.twists[row + 1]
        self.q = with_joint_values(robot, q, np.asarray(curve(at[1])))
        self.v = np.hstack([twists, np.asarray(curve(at[1], 1))]) * rate[:, None]

    def proven(self, clearances: Clearances) -> bool:
        """Whether links are proven clear all the way; if not, the search is told what may not be."""
        for before, standing in itertools.pairwise([*self.chain, None]):
            assert before is not None
            first, last = before.now, self.search.end if standing is None else standing.now
            held = self._footholds(before.rows)
            contacts: list[tuple[int, ...]] = [(row, row) for row in held]
            if standing is not None:
                contacts[standing.limb] = (held[standing.limb], self._footholds(standing.rows)[standing.limb])
            some = slice(self._knot[first], self._knot[last] + 1)
            near = clearances.moving(contacts, self.times[some], self.q[some], self.v[some])
            if near is None:
                continue
            if standing is None or near.time < self.times[self._knot[standing.lift]]:
                self.search.barred.add(before.rows)
            else:
                self.search.forbidden.add(standing.swing[:3])
            return False
        return True

    def _footholds(self, rows: tuple[int, ...]) -> tuple[int, ...]:
        return tuple(int(self.search.world.hold[place]) for place in self.search.places(rows))

    def contact_plan(self) -> ContactPlan:
        """As the loop takes it."""
        moves = []
        for before, standing in itertools.pairwise(self.chain):
            limb = standing.limb
            leaves, lands = self._footholds(before.rows)[limb], self._footholds(standing.rows)[limb]
            lift, land = (float(self.times[self._knot[k]]) for k in (standing.lift, standing.now))
            moves.append(ContactMove(limb, leaves, lands, lift, land))
        start = self._footholds(self.chain[0].rows)
        return ContactPlan(self.climber, self.search.world.scene, start, moves, self.times, self.q, self.v, None)
