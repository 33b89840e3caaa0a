"""From stances to a motion: every move is proven clear between instants, and timed."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol
from weakref import WeakSet

import numpy as np

from wbc import validation
from wbc.clearance import Nearest
from wbc.climb.balance import Equilibrium
from wbc.climb.clear import Clearances
from wbc.climb.climber import Climber
from wbc.climb.closure import Closure
from wbc.climb.joint_values import beyond_limits
from wbc.climb.move_path import HeldError, MovePath, SwingShape, move_path
from wbc.climb.path_loads import LEAST, PathLoads
from wbc.climb.plan import ContactMove, ContactPlan
from wbc.climb.scene import ClimbScene, reaches
from wbc.climb.stance import FREE_LIMB, Stance, StancePath
from wbc.climb.time_law import GRID, MotionSpeeds, PathTiming, TimedMove
from wbc.errors import InfeasibleError, RangeError, ShapeError
from wbc.validation import Array

#: How far contacts of a stance may be from their footholds [m]
AT = 1e-4
#: Heights to which limbs are lifted, one after the other, as multiples of the asked one
HIGHER = (1.0, 2.0, 0.5, 4.0)
#: Shares of a lift that lean towards the limb's resting place: straight, and where joints are near their limits
LEANS = (0.0, 0.8)
#: Parts of a path in which the body moves: while limbs are lifted, at first, at last
WINDOWS = ((0.2, 0.8), (0.1, 0.5), (0.5, 0.9))
#: Instants of a move at which equilibrium is looked at where nothing weighs, and motors where something does
INSTANTS = 12
#: Into how many parts intervals of a path are divided for its proof, one after the other, while that stays open
PARTS = (1, 2, 4)


class MoveError(InfeasibleError):
    """No way from a stance to the next one was found.

    Attributes:
        move: row of the stance from which it goes.
        nearest: the two bodies that are nearer than they may be on the way that came furthest; None: there are none.
        standing: whether one of the two stances is itself impossible.
    """

    move: int = 0
    nearest: Nearest | None = None
    standing: bool = False


def _refused(move: int, value: object, reason: str, nearest: Nearest | None, standing: bool = False) -> MoveError:
    error = MoveError(f"move {move + 1}", value, reason)
    error.move, error.nearest, error.standing = move, nearest, standing
    return error


class Balanced(Protocol):
    """What says whether contacts bear the robot: :class:`wbc.climb.balance.Equilibrium`."""

    def margin(self, contacts: Sequence[int], q: Array) -> float:
        """Slack of equilibrium in shares of the weight; below 0 there is none."""
        ...


@dataclass(frozen=True)
class MotionOptions:
    """How motions are made.

    Attributes:
        clearance: distance that links keep from bodies [m].
        apart: distance that links keep from each other [m]; a loop that follows the motion is some tenths of a mm off.
        lift: how far contacts are lifted off what they leave and land on [m]; 0: a sixteenth of the shortest limb.
        tries: random postures through which limbs go where nothing simpler is clear, at most.
        seed: of those.
        margin: least slack of equilibrium at rest on the way, of the limbs that hold, in shares of the weight.
        inertia: share of the slack of equilibrium at rest that accelerations may use, where something weighs [1].
        friction: share of the coefficients of friction on which equilibrium counts on the way [1].
        speeds: see :class:`MotionSpeeds`.
        effort: share of the joints' efforts within which torques at rest stay on the way [1]; inf: they do not count.

    Raises:
        RangeError, NotFiniteError, ShapeError: a number that is none of these.
    """

    clearance: float = 0.01
    apart: float = 0.001
    lift: float = 0.0
    tries: int = 20
    seed: int = 0
    margin: float = 0.0
    inertia: float = 0.5
    friction: float = 1.0
    speeds: MotionSpeeds = field(default_factory=MotionSpeeds)
    effort: float = np.inf

    def __post_init__(self) -> None:
        for name in ("clearance", "apart", "lift"):
            value = validation.scalar(f"MotionOptions.{name}", getattr(self, name), low=0.0, unit="m")
            object.__setattr__(self, name, value)
        margin = validation.scalar("MotionOptions.margin", self.margin, low=0.0, high=1.0)
        object.__setattr__(self, "margin", margin)
        if not self.effort > 0.0:
            raise RangeError("MotionOptions.effort", self.effort, "expected a share above 0")
        for name in ("inertia", "friction"):
            share = validation.scalar(f"MotionOptions.{name}", getattr(self, name), low=0.0, high=1.0, open_low=True)
            object.__setattr__(self, name, share)
        validation.integer("MotionOptions.tries", self.tries)
        validation.integer("MotionOptions.seed", self.seed)
        validation.instance("MotionOptions.speeds", self.speeds, MotionSpeeds, "MotionSpeeds")


@dataclass(frozen=True, eq=False)
class Mover:
    """Moves of a climber from stance to stance in a scene.

    Attributes:
        climber, scene, options: as given.
        balance: what says whether contacts bear the robot; None: it is not asked, as where there is no gravity.

    Raises:
        what :class:`Clearances` and :class:`PathTiming` raise.
    """

    climber: Climber
    scene: ClimbScene
    options: MotionOptions = field(default_factory=MotionOptions)
    balance: Balanced | None = None

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "closure", Closure(self.climber))
        set_(self, "clearances", Clearances(self.climber, self.scene, self.options.clearance, self.options.apart))
        set_(self, "timing", PathTiming(self.climber, self.options.speeds))
        shortest = float(reaches(self.climber).min())
        set_(self, "lift", self.options.lift or shortest / 16.0)

    closure: Closure = field(init=False)
    clearances: Clearances = field(init=False)
    timing: PathTiming = field(init=False)
    lift: float = field(init=False)
    checked: WeakSet[Stance] = field(init=False, default_factory=WeakSet, repr=False)
    _made: dict[bytes, tuple[TimedMove, float | None]] = field(init=False, default_factory=dict, repr=False)

    def moved(self, one: Stance, other: Stance, row: int = 0) -> tuple[TimedMove, float | None]:
        """The motion from a stance to the next one, from rest to rest, and its least margin of equilibrium.

        Limbs in both stances at the same foothold hold it; others go on curves along the normals, with their turns
        where that is possible, higher where that is not clear, evenly in their joints, or at last through random
        postures. A motion that was found is kept.

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
            if stance not in self.checked:
                self._check(stance, which, row)
                self.checked.add(stance)
        refusals, unborne, stuck = list[tuple[float, float, MoveError]](), False, False
        for shape in self._shapes(one, other):
            # Where the contacts do not bear the robot another swing changes nothing, another way of the body may
            if unborne and shape.rise == 0.0:
                continue
            try:
                path, stuck = self._path(one, other, shape, stuck)
            except InfeasibleError as error:
                stuck = stuck or isinstance(error, HeldError)
                refusals.append((0.0, 0.0, _refused(row, error.value, str(error), None)))
                continue
            refusal, margin, loads = self._refused(path, one, other, row)
            if refusal is None:
                return self.timing.timed(path, loads), margin
            if margin is not None:
                unborne = True
                refusals.append((2.0, margin, refusal))
            elif refusal.nearest is not None:
                refusals.append((1.0, refusal.nearest.distance - refusal.nearest.required, refusal))
        # The way that came nearest to be one: what lacks equilibrium, then what lacks clearance, then what is none
        raise max(refusals, key=lambda entry: entry[:2])[2]

    def _path(self, one: Stance, other: Stance, shape: SwingShape, stuck: bool) -> tuple[MovePath, bool]:
        """A path, and whether limbs that hold cannot follow the body's straight way: then it yields to them."""
        if not stuck:
            try:
                return move_path(self.closure, one, other, shape, self._normals), False
            except HeldError:
                if self.closure.short:
                    raise
        return move_path(self.closure, one, other, replace(shape, yields=True), self._normals), True

    @property
    def _normals(self) -> dict[int, Array]:
        return dict(enumerate(self.scene.normals))

    def _check(self, stance: Stance, which: int, row: int) -> None:
        """Refuses a stance whose contacts are not at its footholds, or in which links are too near."""
        for limb, pose in enumerate(self.closure.poses(stance.q)):
            foothold = stance.contacts[limb]
            if foothold == FREE_LIMB:
                continue
            off = float(np.linalg.norm(pose.translation - self.scene.positions[foothold]))
            if off > AT:
                name, at = self.climber.limbs[limb].name, self.scene.footholds[foothold].id
                raise _refused(row, off, f"in stance {which + 1} {name} is {off:.3g} m off foothold {at}", None, True)
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
            velocities = path.velocities(at, path.at(s, 1))
            nearest = self.clearances.moving(contacts, s, path.configurations(at), velocities)
            # The body's cubic is not known better than between the instants given: more of them decide what is open
            if nearest is None or nearest.distance < nearest.required:
                break
        if nearest is not None:
            text = f"{_told(nearest)} at {100.0 * nearest.time:.0f} % of the way"
            return _refused(row, nearest.distance, text, nearest), None, None
        if self.balance is None:
            return None, None, None
        held = tuple(a if a == b else FREE_LIMB for a, b in contacts)
        loads, needed = None, 0.0
        if isinstance(self.balance, Equilibrium) and np.any(self.scene.gravity):
            # Second derivatives of a path are largest at its samples
            where = np.unique(np.concatenate([GRID, path.s]).round(9))
            loads = PathLoads(self.balance, path, held, where, self.options.inertia)
            margins, needed = loads.at_rest, max(LEAST, self.options.margin)
        else:
            picked = np.unique(np.linspace(0, len(path.q) - 1, INSTANTS).astype(int))
            where, margins = path.s[picked], np.array([self.balance.margin(held, q) for q in path.q[picked]])
        least, part, what = float(margins.min()), 100.0 * where[int(np.argmin(margins))], "contacts that hold"
        if least >= needed and loads is not None and self.options.effort < np.inf:
            margins, where = self._driven(held, path)
            if margins.min() < needed:
                least, part = float(margins.min()), 100.0 * where[int(np.argmin(margins))]
                what = "motors of the limbs that hold"
        if least < needed:
            text = f"the {what} do not bear the robot at {part:.0f} % of the way: they lack"
            return _refused(row, least, f"{text} {needed - least:.3g} of its weight", None), least, None
        return None, least, loads

    def _driven(self, held: Sequence[int], path: MovePath) -> tuple[Array, Array]:
        """Margins of equilibrium with motors along a path, and where on it these are."""
        assert isinstance(self.balance, Equilibrium)
        picked = np.unique(np.linspace(0, len(path.q) - 1, INSTANTS).astype(int))
        effort = self.options.effort
        margins = [self.balance.margin(held, q, motors=True, effort=effort) for q in path.q[picked]]
        return np.array(margins), path.s[picked]

    def _shapes(self, one: Stance, other: Stance) -> Iterator[SwingShape]:
        """From the simplest on."""
        base = SwingShape(self.lift)
        swings = [k for k, (a, b) in enumerate(zip(one.contacts, other.contacts, strict=True)) if a != b]
        yield base
        if swings:
            for lean in LEANS:
                yield from (replace(base, height=f * self.lift, lean=lean) for f in HIGHER if (f, lean) != (1.0, 0.0))
            for window in WINDOWS:
                for lean in LEANS:
                    yield from (replace(base, height=f * self.lift, window=window, lean=lean) for f in HIGHER[:3])
            for height in HIGHER[:3]:
                for tuck in (0.0, 0.5, 1.0):
                    shape = replace(base, height=height * self.lift, joints=True, tucked=tuck, window=WINDOWS[0])
                    yield replace(shape, lean=LEANS[1])
        for rise in (1.0, -1.0):
            yield replace(base, rise=rise * self.lift)
        if swings:
            rng = np.random.default_rng(self.options.seed)
            for k in range(self.options.tries):
                via = {limb: rng.uniform(*self._range(limb)) for limb in swings}
                yield replace(base, height=HIGHER[k % 3] * self.lift, lean=LEANS[k % 2], joints=True, via=via)

    def _range(self, limb: int) -> tuple[Array, Array]:
        """Of random angles: limits, or half a turn about those at rest."""
        rest = self.climber.angles(self.climber.rest, limb)
        low, high = self.climber.limits[limb]
        return np.maximum(low, rest - np.pi), np.minimum(high, rest + np.pi)


def carry_out(
    climber: Climber,
    scene: ClimbScene,
    stances: StancePath,
    options: MotionOptions | None = None,
    balance: Balanced | None = None,
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
