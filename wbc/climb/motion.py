"""From stances to a motion: every move is proven clear between instants, and timed."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from weakref import WeakSet

import numpy as np

from wbc import validation
from wbc.clearance import Nearest
from wbc.climb.balance import Equilibrium
from wbc.climb.clear import TOLERANCE, Clearances, climber_bodies
from wbc.climb.climber import Climber
from wbc.climb.closure import Closure
from wbc.climb.elastic_band import ElasticBand
from wbc.climb.move_path import MovePath, SwingShape, band_path, move_path
from wbc.climb.path_loads import LEAST, PathLoads
from wbc.climb.plan import ContactMove, ContactPlan
from wbc.climb.scene import ClimbScene, size_of
from wbc.climb.stance import FREE_LIMB, Stance, StancePath
from wbc.climb.time_law import GRID, MotionSpeeds, PathTiming, TimedMove
from wbc.climb.watch import PlanWatch
from wbc.climb.world import ClimbWorld
from wbc.errors import InfeasibleError, RangeError, ShapeError, WbcError
from wbc.robot.joint_values import beyond_limits
from wbc.validation import Array

#: How far contacts of a stance may be from their footholds [m]
AT = 1e-4
#: Leans of :class:`SwingShape` on curves, one after the other [1]
LEANS = (0.0, 0.8)
#: Poses of a body that differ by less are one [m, 1]
ONE_PLACE = 1e-9
#: Heights to which limbs are lifted along bands, one after the other, as multiples of the asked one
HEIGHTS = (1.0, 2.0, 0.5)
#: How much further than it has to a band goes round links that touch, one after the other
ASIDES = (1.0, 2.0)
#: Instants of a move at which equilibrium is looked at where nothing weighs, and motors where something does
INSTANTS = 12
#: Of the margin asked for, the share that is kept where all limbs hold and the body shifts [1]
SHIFTED = 0.5
#: How often a grid of a path is made finer where equilibrium between its points may be less than is needed
REFINED = 5
#: Into how many parts intervals of a path are divided for its proof, one after the other, while that stays open
PARTS = (1, 2, 4)


class MoveError(InfeasibleError):
    """No way from a stance to the next one was found.

    Attributes:
        move: row of the stance from which it goes.
        nearest: the two bodies that are nearer than they may be on the way that came furthest; None: there are none.
        standing: whether one of the two stances is itself impossible.
        limbs: rows of limbs whose links are nearer than they may be on a way.
    """

    move: int = 0
    nearest: Nearest | None = None
    standing: bool = False
    limbs: frozenset[int] = frozenset()


def _passed_on(move: int, error: WbcError) -> MoveError:
    """The refusal of a move for an error that names what is in the way."""
    return _refused(move, error.value, f"{error.field}: {error.reason}", None)


def _refused(move: int, value: object, reason: str, nearest: Nearest | None, standing: bool = False) -> MoveError:
    error = MoveError(f"move {move + 1}", value, reason)
    error.move, error.nearest, error.standing = move, nearest, standing
    return error


@dataclass(frozen=True)
class MotionOptions:
    """How motions are made.

    Attributes:
        clearance: distance that links keep from bodies [m].
        apart: distance that links keep from each other [m]; a loop that follows the motion is some tenths of a mm off.
        lift: how far contacts are lifted off what they leave and land on [m]; 0: a sixteenth of the shortest limb.
        margin: least slack of equilibrium at rest on the way, of the limbs that hold, in shares of the weight; half of
            it where the body shifts and no limb lifts.
        inertia: share of the slack of equilibrium at rest that accelerations may use, where something weighs [1].
        friction: share of the coefficients of friction, and its square of soles, on which equilibrium counts on the
            way [1].
        speeds: see :class:`MotionSpeeds`.
        effort: share of the joints' efforts within which torques at rest stay on the way [1]; inf: they do not count.

    Raises:
        RangeError, NotFiniteError, ShapeError: a number that is none of these.
    """

    clearance: float = 0.01
    apart: float = 0.001
    lift: float = 0.0
    margin: float = 0.0
    inertia: float = 0.5
    friction: float = 1.0
    speeds: MotionSpeeds = field(default_factory=MotionSpeeds)
    effort: float = np.inf

    def __post_init__(self) -> None:
        validation.own_scalars(self, "clearance", "apart", "lift", low=0.0, unit="m")
        validation.own_scalars(self, "margin", low=0.0, high=1.0)
        if not self.effort > 0.0:
            raise RangeError("MotionOptions.effort", self.effort, "expected a share above 0")
        validation.own_scalars(self, "inertia", "friction", low=0.0, high=1.0, open_low=True)
        validation.instance("MotionOptions.speeds", self.speeds, MotionSpeeds, "MotionSpeeds")


class Mover:
    """Moves of a climber from stance to stance in a scene.

    Args:
        climber, scene: what moves where. options: default: ``MotionOptions()``.
        balance: what says whether contacts bear the robot; None: it is not asked, as where there is no gravity.
        watch: the clock of the plan that moves are for; once its time is over no other way is tried.

    Raises:
        what :class:`Clearances` and :class:`PathTiming` raise.
    """

    def __init__(
        self, climber: Climber, scene: ClimbScene, options: MotionOptions | None = None,
        balance: Equilibrium | None = None, watch: PlanWatch | None = None,
    ) -> None:  # fmt: skip
        given = options or MotionOptions()
        self.climber, self.scene, self.options, self.balance = climber, scene, given, balance
        self.watch, self.closure = watch or PlanWatch(), Closure(climber)
        self.clearances = Clearances(climber, scene, given.clearance, given.apart)
        # Of what motors have left at rest, motion may use half
        self.timing = PathTiming(climber, given.speeds, 0.5 * (1.0 + given.effort))
        self.lift = given.lift or size_of(climber) / 16.0
        self._checked, self._made = WeakSet[Stance](), dict[bytes, tuple[TimedMove, float | None]]()

    def moved(self, one: Stance, other: Stance, row: int = 0) -> tuple[TimedMove, float | None]:
        """The motion from a stance to the next one, from rest to rest, and its least margin of equilibrium.

        Limbs in both stances at the same foothold hold it; the body goes straight and others on curves along the
        normals, or all by elastic bands, of other lifts, further off what they touch. A motion that was found is kept.

        Args:
            row: of the stance in its path, for errors.

        Raises:
            MoveError: no way was found that keeps contacts, limits, clearances and equilibrium: which, and by how much.
        """
        key = b"".join(np.array(s.contacts).tobytes() + s.q.tobytes() for s in (one, other))
        if key not in self._made:
            self._made[key] = self._found(one, other, row)
        return self._made[key]

    def _found(self, one: Stance, other: Stance, row: int) -> tuple[TimedMove, float | None]:
        for stance, which in ((one, row), (other, row + 1)):
            if stance not in self._checked:
                self._check(stance, which, row)
                self._checked.add(stance)
        refusals = list[tuple[float, float, MoveError]]()
        for shape in self._shapes(one, other, row, refusals):
            try:
                path = move_path(self.closure, one, other, shape, self._normals)
            except InfeasibleError as error:
                refusals.append((0.0, 0.0, _passed_on(row, error)))
                continue
            refusal, margin, loads = self._refused(path, one, other, row)
            if refusal is None:
                return self.timing.timed(path, loads), margin
            near = refusal.nearest
            refusals.append(
                (2.0, margin or 0.0, refusal) if near is None else (1.0, near.distance - near.required, refusal)
            )
        # The way that came nearest to be one: what lacks equilibrium, then what lacks clearance, then what is none
        raise max(refusals, key=lambda entry: entry[:2])[2]

    def _shapes(
        self, one: Stance, other: Stance, row: int, refusals: list[tuple[float, float, MoveError]]
    ) -> Iterator[SwingShape]:
        """Straight, then along elastic bands while the time lasts, at first with the body still where both stances have
        it at one place; those that contacts cannot follow are refused.
        """
        weighs = bool(np.any(self.scene.gravity))
        balance = self.balance.world if weighs and self.balance is not None else None
        band = ElasticBand(self._world, balance, self._needed(one, other))
        swings = [k for k, (a, b) in enumerate(zip(one.contacts, other.contacts, strict=True)) if a != b]
        heights, begins = (HEIGHTS, (True, False)) if swings else (HEIGHTS[:1], (False,))
        bodies = [self.climber.body_pose(stance.q) for stance in (one, other)]
        stays = not self.closure.short and bodies[0].isApprox(bodies[1], ONE_PLACE)
        for lean, yields in itertools.product(LEANS if swings else LEANS[:1], (False, True)):
            if not yields or not (stays or self.closure.short):
                yield SwingShape(self.lift, lean, yields)
        stills = (True, False) if stays else (False,)
        for still, on_curves, height, aside in itertools.product(stills, begins, heights, ASIDES):
            if self.watch.passed:
                return
            shape = SwingShape(height * self.lift, still=still)
            pulled = replace(band, aside=aside, still=still, on_curves=on_curves)
            try:
                guide = band_path(self.closure, one, other, shape, self._normals, pulled)
            except InfeasibleError as error:
                refusals.append((0.0, 0.0, _passed_on(row, error)))
            else:
                yield replace(shape, guide=guide)

    def _needed(self, one: Stance, other: Stance) -> float:
        """Slack at rest that contacts keep from stance to stance, where something weighs [weights]."""
        # A limb that lifts next, or has just landed, need not bear, and slack counts it with the others
        return max(LEAST, (SHIFTED if one.contacts == other.contacts else 1.0) * self.options.margin)

    @cached_property
    def _world(self) -> ClimbWorld:
        """The scene with what paths keep at least."""
        given = self.options
        return ClimbWorld(
            self.climber, self.scene, clear=given.clearance, apart=given.apart, margin=0.0, spare=-TOLERANCE
        )

    @cached_property
    def _limb_of(self) -> dict[str, int]:
        """Bodies of the robot, by name, and the limbs that move them."""
        return {body.name: self.climber.carrier(body.link) for body in climber_bodies(self.climber)}

    @property
    def _normals(self) -> dict[int, Array]:
        return dict(enumerate(self.scene.normals))

    def _check(self, stance: Stance, which: int, row: int) -> None:
        """Refuses a stance whose contacts are not at its footholds, or in which links are too near."""
        for limb, pose in enumerate(self.closure.poses(stance.q)):
            foothold = stance.contacts[limb]
            if foothold == FREE_LIMB:
                continue
            own, hold = self.climber.limbs[limb], self.scene.footholds[foothold]
            off = float(np.linalg.norm(pose.translation - own.contact.held_at(hold.pose).translation))
            if off > AT:
                text = f"in stance {which + 1} {own.name} is {off:.3g} m off foothold {hold.id}"
                raise _refused(row, off, text, None, True)
        if worst := beyond_limits(self.climber.robot, stance.q[None]):
            text = f"in stance {which + 1} {worst[0]} is {worst[1]:.3g} rad or m beyond its limit"
            raise _refused(row, worst[1], text, None, True)
        nearest = self.clearances.standing(stance.contacts, stance.q)
        if nearest is not None:
            raise _refused(row, nearest.distance, f"in stance {which + 1} {_told(nearest)}", nearest, True)

    def _refused(
        self, path: MovePath, one: Stance, other: Stance, row: int
    ) -> tuple[MoveError | None, float | None, PathLoads | None]:  # fmt: skip
        """Why a path is none, the least margin of equilibrium on it, and what contacts have to bear."""
        contacts = list(zip(one.contacts, other.contacts, strict=True))
        for parts in PARTS:
            s = np.interp(np.arange(parts * (len(path.s) - 1) + 1) / parts, np.arange(len(path.s)), path.s)
            at = path.at(s)
            knots = s, path.configurations(at), path.velocities(at, path.at(s, 1))
            nearest = self.clearances.moving(contacts, *knots)
            # The body's cubic is not known better than between the instants given: more of them decide what is open
            if nearest is None or nearest.distance < nearest.required - self.clearances.blur(*knots):
                break
        if nearest is not None:
            text = f"{_told(nearest)} at {100.0 * nearest.time:.0f} % of the way"
            refusal = _refused(row, nearest.distance, text, nearest)
            refusal.limbs = frozenset(self._limb_of.get(name, -1) for name in (nearest.first, nearest.second)) - {-1}
            return refusal, None, None
        if self.balance is None:
            return None, None, None
        held = tuple(a if a == b else FREE_LIMB for a, b in contacts)
        loads, needed = None, 0.0
        picked = np.unique(np.linspace(0, len(path.q) - 1, INSTANTS).astype(int))
        if np.any(self.scene.gravity):
            # Second derivatives of a path are largest at its samples
            where, needed = np.unique(np.concatenate([GRID, path.s]).round(9)), self._needed(one, other)
            for _ in range(REFINED):
                loads = PathLoads(self.balance, path, held, where, self.options.inertia)
                margins = loads.at_rest
                if margins.min() < needed or not len(more := _dips(where, margins, needed)):
                    break
                where = np.sort(np.append(where, more))
        else:
            where, margins = path.s[picked], np.array([self.balance.margin(held, q) for q in path.q[picked]])
        least, part, what = float(margins.min()), 100.0 * where[int(np.argmin(margins))], "contacts that hold"
        if least >= needed and loads is not None and self.options.effort < np.inf:
            driven = [self.balance.margin(held, q, motors=True, effort=self.options.effort) for q in path.q[picked]]
            if min(driven) < needed:
                least, part = min(driven), 100.0 * float(path.s[picked[int(np.argmin(driven))]])
                what = "motors of the limbs that hold"
        if least < needed:
            text = f"the {what} do not bear the robot at {part:.0f} % of the way: they lack"
            return _refused(row, least, f"{text} {needed - least:.3g} of its weight", None), least, loads
        return None, least, loads


def _dips(s: Array, slacks: Array, needed: float) -> Array:
    """Middles of intervals in which a slack, of the curvature that it has at its ends, may be less than is needed."""
    h, rates = np.diff(s), np.diff(slacks) / np.diff(s)
    bends = np.abs(np.diff(rates)) / (0.5 * (h[:-1] + h[1:]))
    bend = np.maximum(np.append(bends[0], bends), np.append(bends, bends[-1]))
    lowest = np.minimum(slacks[:-1], slacks[1:]) - bend * h**2 / 8.0
    return np.asarray((0.5 * (s[:-1] + s[1:]))[lowest < needed])


def carry_out(
    climber: Climber,
    scene: ClimbScene,
    stances: StancePath,
    options: MotionOptions | None = None,
    balance: Equilibrium | None = None,
    mover: Mover | None = None,
) -> ContactPlan:
    """The timed motion through stances: held contacts keep their places within 1e-4 m, every move is proven clear
    between instants, in least time under limits of joints and body, at rest in every stance.

    Args:
        balance: what says whether contacts bear the robot, at instants of a move; None: nothing does.
        mover: in place of options and balance one that keeps the motions that it found before.

    Raises:
        MoveError: no way from a stance to the next one: which pair is too near, or which limit is passed, by how much.
        ShapeError: fewer than two stances, or one with another number of limbs. RangeError: no such foothold; a joint
            without limits. What :class:`Clearances` raises.
    """
    given = MotionOptions() if options is None else validation.instance("options", options, MotionOptions, "options")
    given = mover.options if mover else given
    path = _checked(climber, scene, stances)
    mover = mover or Mover(climber, scene, given, balance)
    times, q, v = [np.zeros(1)], [path[0].q[None]], [np.zeros((1, climber.robot.nv))]
    moves, margins, now = list[ContactMove](), list[float](), 0.0
    for row, (one, other) in enumerate(itertools.pairwise(path)):
        told = f"motion {row + 1} of {len(path) - 1}"
        mover.watch.look(told.__str__)
        timed, margin = mover.moved(one, other, row)
        if margin is not None:
            margins.append(margin)
        if given.speeds.dwell > 0.0 and row:
            now += given.speeds.dwell
            times.append(np.array([now]))
            q.append(one.q[None])
            v.append(np.zeros((1, climber.robot.nv)))
        end = now + float(timed.times[-1])
        for limb, (a, b) in enumerate(zip(one.contacts, other.contacts, strict=True)):
            if a != b:
                moves.append(ContactMove(limb, a, b, now, end))
        times.append(now + timed.times[1:])
        q.append(timed.q[1:])
        v.append(timed.v[1:])
        now = end
    knots, at, rates = (np.concatenate(part) for part in (times, q, v))
    least = min(margins) if margins else None
    return ContactPlan(climber, scene, path[0].contacts, moves, knots, at, rates, least)


def _checked(climber: Climber, scene: ClimbScene, stances: StancePath) -> list[Stance]:
    path = list(stances.stances)
    if len(path) < 2:
        raise ShapeError("stances", len(path), "expected two or more")
    for k, stance in enumerate(path):
        if len(stance.contacts) != len(climber.limbs):
            raise ShapeError(f"stances[{k}].contacts", stance.contacts, f"expected {len(climber.limbs)} footholds")
        for row in stance.contacts:
            if not FREE_LIMB <= row < len(scene.footholds):
                raise RangeError(f"stances[{k}].contacts", row, f"expected rows from 0 to {len(scene.footholds) - 1}")
    return [Stance(tuple(s.contacts), climber.robot.configuration(f"stances[{k}].q", s.q)) for k, s in enumerate(path)]


def _told(nearest: Nearest) -> str:
    far, least = 1e3 * nearest.distance, 1e3 * nearest.required
    text = f"{nearest.first} and {nearest.second} are {far:.3f} mm apart, and {least:.3f} mm are required"
    return text if far < least else f"{text}, which is not proven between the instants looked at"
