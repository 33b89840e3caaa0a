"""A plan along a given way of the body: spans, swings, then the motion, timed and proven clear."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import CubicSpline, PPoly

from wbc import validation
from wbc.climb.along.body_track import BodyTrack
from wbc.climb.along.search import AlongSearch, Standing
from wbc.climb.clear import Clearances
from wbc.climb.climber import Climber
from wbc.climb.motion import MotionOptions
from wbc.climb.plan import ContactMove, ContactPlan
from wbc.climb.reach import LIMIT_MARGIN
from wbc.climb.scene import ClimbScene
from wbc.climb.search import counted_words, no_stances
from wbc.climb.stance import FREE_LIMB, Stance
from wbc.climb.time_law import cubics_need, fastest, law_knots
from wbc.climb.world import ClimbWorld
from wbc.errors import RangeError
from wbc.multibody import pin
from wbc.robot.joint_values import joint_values, with_joint_values
from wbc.symbolic.kinematics import frame_index
from wbc.validation import Array

#: How many times slower than asked a way is planned, and how many standings the search keeps of each number of swings,
#: one after the other
TRIED = ((1.0, 8), (1.0, 16), (1.0, 40), (1.2, 40), (1.5, 40), (2.0, 40), (4.0, 40))
#: Time between knots where the way is slow [s]
SLOW = 0.055
#: Change of speed, as a part of the asked one, over an interval without knots inside [1]; over n parts n^2 times that
GAINED = 0.03
#: How often intervals of the law are halved in which cubics would exceed a limit by more than this factor
HALVED = 4
NEARLY = 1.0 + 1e-3
#: Mean speed, as a part of the asked one, below which a way has come to a stop [1]
STANDING = 1e-6
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
    clearances = Clearances(climber, scene, motion.clearance, motion.apart)
    first = None if start is None else _begun(climber, track, start)
    furthest, said = 0.0, ""
    searches = dict[float, tuple[AlongSearch, tuple[int, ...]]]()
    for slower, width in TRIED:
        if slower not in searches:
            slow = replace(track, speed=track.speed / slower, turn_rate=track.turn_rate / slower)
            search = AlongSearch(world, track if slower == 1.0 else slow, motion, given.margin)
            searches[slower] = search, () if first is None else _rows(search, first)
        search, rows = searches[slower]
        if -1 in rows and first is not None:
            limb = rows.index(-1)
            at = scene.footholds[first.contacts[limb]].id
            said = said or f"{climber.limbs[limb].name} has to let go of {at} as it begins"
            continue
        search.begin(rows or None, width)
        for _ in range(AGAIN):
            way = search.run(given.moves)
            if way is None:
                break
            timed = _TimedWay(search, *way, motion, slower)
            if timed.stands:
                said = said or "joints would have to stop on the way"
                break
            wrong = timed.wrong(clearances)
            if wrong is None:
                return timed.contact_plan()
            if not wrong:
                break
            search.refuse(wrong)
        if search.furthest >= furthest:
            furthest, said = search.furthest, counted_words(search.outcomes) or said
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


def _rows(search: AlongSearch, start: Stance) -> tuple[int, ...]:
    """Spans that begin with the start's postures; -1 of a limb that has to let go at once."""
    rows, world = [], search.world
    for limb, place in enumerate(world.start):
        foothold = world.scene.footholds[start.contacts[limb]]
        off = world.climber.contact_pose(start.q, limb).translation - world.places[place, 9:]
        if np.linalg.norm(off) > AT_BEGINNING:
            raise RangeError("start.q", foothold.id, f"{world.climber.limbs[limb].name} is not at this foothold")
        rows.append(search.begun(limb, place, world.climber.angles(start.q, limb)))
    return tuple(rows)


def _speeds(curve: PPoly, x: Array, rate: Array, pull: Array, most: float) -> Array:
    """Speeds along the way at some of its places for the least time in which joints keep rates and accelerations."""
    slopes = np.asarray(curve(x, 1))
    # Curves of limbs meet where they lift and land, with another second derivative on each side
    second = [np.asarray(curve(at, 2)) for at in (x, np.nextafter(x, -np.inf))]
    moves = np.isfinite(pull) & (np.abs(slopes).max(axis=0) > 1e-9)
    used = (np.abs(slopes[:, moves]) / rate[moves]).max(axis=1, initial=0.0)
    a, b = slopes[:, moves] / pull[moves], np.hstack([some[:, moves] / pull[moves] for some in second])
    return fastest(x, np.hstack([a, a]), b, np.minimum(1.0 / np.maximum(used, 1e-9) ** 2, most**2))


def _pairs(numbers: Sequence[int]) -> list[tuple[int, int]]:
    """The first with the second, the third with the fourth, and so on."""
    return list(zip(numbers[::2], numbers[1::2], strict=True))


class _TimedWay:
    """The motion of a way that was found.

    Attributes:
        stands: whether joints would have to stop on it; then there is none.
    """

    def __init__(
        self, search: AlongSearch, chain: list[Standing], angles: Array, motion: MotionOptions, slower: float
    ) -> None:  # fmt: skip
        self.climber, self.search, self.chain = search.world.climber, search, chain
        limits, x = self.climber.robot.limits, search.track.instants
        rate, pull = (
            motion.speeds.share * limits.velocity[6:],
            motion.speeds.acceleration_share * limits.acceleration[6:],
        )
        curve = self._curve(angles)
        for halved in range(HALVED + 1):
            speed = _speeds(curve, x, rate, pull, slower)
            mean = 0.5 * (speed[1:] + speed[:-1])
            self.stands = bool((mean < STANDING).any())
            if self.stands:
                return
            span = np.diff(x) / mean
            gains = np.abs(np.diff(speed)) / GAINED
            parts = np.ceil(np.maximum(np.maximum(span / SLOW, np.sqrt(gains)), 1.0)).astype(int)
            times, at, speeds = law_knots(x, speed, span, parts)
            values, rates = np.asarray(curve(at)), np.asarray(curve(at, 1)) * speeds[:, None]
            needs = np.maximum.reduceat(cubics_need(times, values, rates, rate, pull), np.cumsum(parts) - parts)
            if halved == HALVED or needs.max() < NEARLY:
                break
            exceeded = needs >= NEARLY
            x = np.sort(np.concatenate([x, 0.5 * (x[:-1] + x[1:])[exceeded]]))
        slowed = max(1.0, float(needs.max()))
        self.times = times * slowed
        knots = np.concatenate([[0], np.cumsum(parts)])
        self._knot = knots[np.searchsorted(x, search.track.instants)]
        q, v = self._body(at)
        self.q = with_joint_values(self.climber.robot, q, values)
        self.v = np.hstack([v * speeds[:, None], rates]) / slowed

    def _curve(self, angles: Array) -> PPoly:
        """Joints ``(nv - 6)`` over the way: splines of each limb while it holds and while it swings."""
        climber, x = self.climber, self.search.track.instants
        terms = np.zeros((4, len(x) - 1, climber.robot.nv - 6))
        terms[3] = joint_values(climber.robot, climber.rest[None])[0]
        for limb, values in enumerate(np.split(angles, self.search.world.offsets[1:-1], axis=1)):
            swings = [(move.lift, move.now) for move in self.chain[1:] if move.limb == limb]
            ends = [0, *itertools.chain.from_iterable(swings), len(x) - 1]
            holds = [CubicSpline(x[i : j + 1], values[i : j + 1]) if i < j else None for i, j in _pairs(ends)]
            for k, (lift, land) in enumerate(swings):
                # As fast at first and at last as while it holds
                rates = tuple(
                    (1, self._held_rates(limb, at, values[at]) if held is None else held(x[at], 1))
                    for held, at in zip(holds[k:], (lift, land), strict=False)
                )
                swung = CubicSpline(x[lift : land + 1], values[lift : land + 1], bc_type=rates)
                terms[:, lift:land, climber.joints(limb) - 6] = swung.c
            for held, (i, j) in zip(holds, _pairs(ends), strict=True):
                if held is not None:
                    terms[:, i:j, climber.joints(limb) - 6] = held.c
        for coupling in climber.robot.couplings:
            terms[:, :, coupling.follower - 6] = coupling.ratio * terms[:, :, coupling.leader - 6]
            terms[3, :, coupling.follower - 6] += coupling.offset
        return PPoly(terms, x)

    def _held_rates(self, limb: int, instant: int, angles: Array) -> Array:
        """Rates of a limb's joints with which its contact stays where it is, at the way's full speed [rad/s, m/s]."""
        climber, track, model = self.climber, self.search.track, self.climber.robot.model
        about, rows = climber.limbs[limb], 3 if climber.fixed(limb) == "position" else 6
        q = climber.with_limb(climber.with_body(climber.rest, track.sampled[instant]), limb, angles)
        J = pin.computeFrameJacobian(model, model.createData(), q, frame_index(model, about.frame), pin.LOCAL)
        J = (about.placement.inverse().toActionMatrix() @ J)[:rows]
        moved = np.linalg.lstsq(J[:, climber.joints(limb)], J[:, :6] @ track.twists[instant], rcond=None)[0]
        return -np.asarray(moved)

    def _body(self, at: Array) -> tuple[Array, Array]:
        """Configurations with the body at places of the way, and its twists at full speed: cubic between instants."""
        track, climber = self.search.track, self.climber
        h = float(track.instants[1])
        q, twists = np.tile(climber.rest, (len(at), 1)), np.empty((len(at), 6))
        rows = np.clip(np.searchsorted(track.instants, at, side="right") - 1, 0, len(track.instants) - 2)
        for k, (row, u) in enumerate(zip(rows, at / h - rows, strict=True)):
            pose, first, last = track.sampled[row], track.twists[row], track.twists[row + 1]
            step = pin.log6(pose.actInv(track.sampled[row + 1])).vector / h
            square, cubic = 3.0 * step - 2.0 * first - last, first + last - 2.0 * step
            q[k] = climber.with_body(q[k], pose * pin.exp6(pin.Motion(h * u * (first + u * (square + u * cubic)))))
            twists[k] = first + u * (2.0 * square + 3.0 * u * cubic)
        return q, twists

    def wrong(self, clearances: Clearances) -> int | None:
        """The standing to which a swing was under way, or had led, where links are too near, 0 for the first one; None:
        they are proven clear all the way.
        """
        times, knot, stays = self.times, self._knot, [[0.0] for _ in self.climber.limbs]
        contacts = [[row] for row in self._footholds(self.chain[0])]
        for standing in self.chain[1:]:
            stays[standing.limb] += [float(times[knot[standing.now]]), float(times[knot[standing.lift]])]
            contacts[standing.limb].append(self._footholds(standing)[standing.limb])
        # Footholds count from when a limb lifts to come there until it has landed on another one
        within = [list(zip([0.0, *some[2::2]], [*some[1::2], float(times[-1])], strict=True)) for some in stays]
        near = clearances.moving(contacts, times, self.q, self.v, within)
        if near is None:
            return None
        return sum(float(times[knot[standing.lift]]) <= near.time for standing in self.chain[1:])

    def _footholds(self, standing: Standing) -> tuple[int, ...]:
        return tuple(int(self.search.world.hold[place]) for place in standing.places)

    def contact_plan(self) -> ContactPlan:
        """As the loop takes it."""
        moves = []
        for before, standing in itertools.pairwise(self.chain):
            limb = standing.limb
            leaves, lands = self._footholds(before)[limb], self._footholds(standing)[limb]
            lift, land = (float(self.times[self._knot[k]]) for k in (standing.lift, standing.now))
            moves.append(ContactMove(limb, leaves, lands, lift, land))
        start = self._footholds(self.chain[0])
        return ContactPlan(self.climber, self.search.world.scene, start, moves, self.times, self.q, self.v, None)
