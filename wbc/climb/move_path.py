"""Paths of a climber from one stance to the next: contacts that are held stay where they are, the others go over."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from wbc.climb.closure import CLOSED, FREE_BODY, HEAVY_BODY, LIGHT_BODY, Closure
from wbc.climb.joint_values import beyond_limits, joint_values, with_joint_values
from wbc.climb.stance import FREE_LIMB, Stance
from wbc.errors import InfeasibleError
from wbc.multibody import pin
from wbc.rotations import exponential, matrices
from wbc.symbolic.joint_steps import place
from wbc.validation import Array

#: Share of a path in which a limb lifts, and in which it lands
LIFTING = 0.2
#: Share of a path in which a limb keeps its turn as it lifts, and as it lands, where it cannot keep it all the way
ALIGNED = 0.1
#: Intervals of a path at first: they are doubled until contacts hold between them
FEWEST = 20
#: Intervals of a path at most
MOST = 160
#: Largest error of a held contact between samples [m, rad]
HELD = 2e-5
#: How far limbs that lift or land may be from their curves between samples [m]: less than tips may sink in
STRAYED = 1e-3
#: Largest change of a joint from sample to sample beyond what it is asked to make, as a share of 1 rad in the coarsest
#: path: more is a jump
JUMP = 0.6


class HeldError(InfeasibleError):
    """Contacts that hold cannot stay where they are on the way of the body."""


#: Samples, window, bow and whether the body yields
BodyWay = tuple[int, tuple[float, float], tuple[float, float, float], bool]


@dataclass(frozen=True, eq=False)
class SwingShape:
    """How limbs in the air go from lift to land.

    Attributes:
        height: how far the contact is lifted along the normal that it leaves, and along the one that it lands on [m].
        lean: how much of that goes towards where the limb's contact is at rest, at most this share of the height [1].
        joints: the limb goes from lifted to lifted posture evenly in its joints; else its contact goes on a curve,
            where its turn is free between lift and land if it cannot be kept.
        tucked: share of the way to its resting angles that it bends in the middle; of paths in the joints.
        window: from where to where on the path the body moves [1].
        via: limb -> angles through which it goes in the middle; of paths in the joints.
        yields: the body yields to the limbs that hold, which go as evenly in their joints as they can.
        bow: how far the body goes off the straight line in the middle, in the world ``(3)`` [m].
    """

    height: float
    lean: float = 0.0
    joints: bool = False
    tucked: float = 0.0
    window: tuple[float, float] = (0.0, 1.0)
    via: Mapping[int, Array] = field(default_factory=dict)
    yields: bool = False
    bow: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def body(self, s: Array) -> Array:
        """How far the body is on its way at parts of the path [1]."""
        low, high = self.window
        if (low, high) == (0.0, 1.0):
            return s
        x = np.clip((s - low) / (high - low), 0.0, 1.0)
        return np.asarray(x**3 * (10.0 - 15.0 * x + 6.0 * x**2))

    def bowed(self, s: Array) -> Array:
        """Share of the bow by which the body is off the straight line at parts of the path [1]."""
        b = self.body(s)
        return np.asarray(16.0 * (b * (1.0 - b)) ** 2)


@dataclass(frozen=True, eq=False)
class MovePath:
    """A path q(s), 0 <= s <= 1, twice continuously differentiable, through samples in which contacts are closed.

    The base goes by its position and by the turn vector against where it begins, joints by their angles: cubic splines.

    Attributes:
        closure: of the climber.
        held: limb -> pose of the contact frame in the world, of limbs that hold all the way.
        s: of the samples. q: there.
    """

    closure: Closure
    held: Mapping[int, pin.SE3]
    s: Array
    q: Array

    @cached_property
    def coordinates(self) -> Array:
        """Of the samples: position of the base [m], turn vector [rad], angles, ``(samples, nv)``."""
        away = _product(self._first * [-1.0, -1.0, -1.0, 1.0], self.q[:, 3:7])
        sine = np.linalg.norm(away[:, :3], axis=1)
        angle = 2.0 * np.arctan2(sine, away[:, 3])
        angle = np.where(angle > np.pi, angle - 2.0 * np.pi, angle)
        turns = away[:, :3] * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 2.0)[:, None]
        return np.hstack([self.q[:, :3], turns, joint_values(self.closure.climber.robot, self.q)])

    @property
    def _first(self) -> Array:
        """Quaternion of the base at the beginning."""
        return np.asarray(self.q[0, 3:7])

    @cached_property
    def _spline(self):  # type: ignore[no-untyped-def]  # scipy has no types
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.s, self.coordinates, axis=0)

    def at(self, s: Array, order: int = 0) -> Array:
        """Coordinates or a derivative of them ``(n, nv)``."""
        return np.asarray(self._spline(s, order))

    def configurations(self, coordinates: Array) -> Array:
        """Configurations ``(n, nq)`` at some coordinates."""
        out = with_joint_values(
            self.closure.climber.robot, np.tile(self.q[0], (len(coordinates), 1)), coordinates[:, 6:]
        )
        half = 0.5 * np.linalg.norm(coordinates[:, 3:6], axis=1)[:, None]
        turn = np.hstack([0.5 * np.sinc(half / np.pi) * coordinates[:, 3:6], np.cos(half)])
        out[:, :3] = coordinates[:, :3]
        out[:, 3:7] = _product(self._first, turn)
        return out

    def velocities(self, coordinates: Array, rates: Array) -> Array:
        """Velocities ``(n, nv)`` in Pinocchio's order of coordinates that change at some rates."""
        out, turns = np.array(rates), coordinates[:, 3:6]
        rotation = matrices(self._first) @ exponential(turns)
        out[:, :3] = np.einsum("nji,nj->ni", rotation, rates[:, :3])
        # With w = dt/ds and a = |t| the body turns at w - (1 - cos a) / a^2 t x w + (a - sin a) / a^3 t x (t x w)
        angle = np.maximum(np.linalg.norm(turns, axis=1), 1e-6)[:, None]
        once = np.cross(turns, rates[:, 3:6])
        lag = (1.0 - np.cos(angle)) / angle**2
        out[:, 3:6] += (angle - np.sin(angle)) / angle**3 * np.cross(turns, once) - lag * once
        return out

    @cached_property
    def error(self) -> float:
        """Largest error of the held contacts half-way between samples [m, rad]."""
        middle = self.configurations(self.at((self.s[1:] + self.s[:-1]) / 2))
        return self.closure.error(middle, {k: np.tile(place(pose), (len(middle), 1)) for k, pose in self.held.items()})


def move_path(
    closure: Closure, one: Stance, other: Stance, shape: SwingShape, normals: Mapping[int, Array],
    *, known: dict[BodyWay, Array | HeldError] | None = None, look: Callable[[Array, Array], None] | None = None,
) -> MovePath:  # fmt: skip
    """The path from a stance to the next one: contacts that both have stay closed.

    Args:
        normals: row of a foothold -> outward normal in the world ``(3)``, of footholds that are left or landed on.
        known: what limbs that hold did on ways of the body between these stances; what they do is added.
        look: is called with s and q of the coarsest samples, and raises where there is no need for finer ones.

    Raises:
        InfeasibleError: held contacts cannot stay closed on the way, a joint has to jump, or it leaves its limits.
    """
    count = FEWEST
    while True:
        moving = _Moving(closure, one, other, shape, normals, {} if known is None else known)
        path = moving.path(count)
        if look is not None and count == FEWEST:
            look(path.s, path.q)
        if path.error < HELD and moving.strayed(path) < STRAYED:
            return path
        count *= 2
        if count > MOST:
            if path.error < HELD:
                raise InfeasibleError("limbs in the air", path.error, f"stray from their curves between {MOST} samples")
            reason = f"leave their places by {path.error:.2g} m or rad between {MOST} samples"
            raise HeldError("held contacts", path.error, reason)


def held_way(
    closure: Closure, one: Stance, other: Stance, shape: SwingShape, known: dict[BodyWay, Array | HeldError]
) -> Array:
    """Configurations on the way of the body ``(samples, nq)``, in which limbs that hold do; others go evenly.

    Raises:
        HeldError: limbs that hold cannot follow.
    """
    return _Moving(closure, one, other, shape, {}, known).held_way(np.linspace(0.0, 1.0, FEWEST + 1))


class _Moving:
    """What goes where on the way from one stance to the next."""

    def __init__(
        self, closure: Closure, one: Stance, other: Stance, shape: SwingShape, normals: Mapping[int, Array],
        known: dict[BodyWay, Array | HeldError],
    ) -> None:  # fmt: skip
        self.closure, self.one, self.other, self.shape, self.known = closure, one, other, shape, known
        self.climber = closure.climber
        self.poses = closure.poses(one.q), closure.poses(other.q)
        pairs = list(zip(one.contacts, other.contacts, strict=True))
        self.held = {k: self.poses[0][k] for k, (a, b) in enumerate(pairs) if a == b != FREE_LIMB}
        self.swings = [k for k, (a, b) in enumerate(pairs) if a != b]
        #: Steps of joints that limbs in the air are asked to make, from sample to sample [m, rad]
        self.even: Array | float = 0.0
        self.lifts = {
            k: tuple(self._lift(k, end, row, normals) for end, row in enumerate(pairs[k]))
            for k in self.swings
            if normals
        }

    def _lift(self, limb: int, end: int, row: int, normals: Mapping[int, Array]) -> Array:
        """From a contact of the first or second stance to where it is lifted [m]."""
        if row == FREE_LIMB:
            return np.zeros(3)
        normal, height = normals[row], self.shape.height
        if self.shape.lean == 0.0:
            return np.asarray(height * normal)
        stance = (self.one, self.other)[end]
        rest = self.climber.contact_pose(self.climber.rest, limb)
        there = self.climber.body_pose(stance.q) * self.climber.body_pose(self.climber.rest).actInv(rest)
        away = there.translation - self.poses[end][limb].translation
        away -= (away @ normal) * normal
        far = max(float(np.linalg.norm(away)), 1e-9)
        return np.asarray(height * normal + self.shape.lean * min(height, far) * away / far)

    def path(self, count: int) -> MovePath:
        s = np.linspace(0.0, 1.0, count + 1)
        curves = {limb: self._curve(limb, s) for limb in self.swings}
        if self.closure.short.intersection([*self.held, *curves]):
            # The body goes where limbs that hold with more rows than they have joints take it
            q, held = self._between(s), self._places(s)
            if self.shape.joints:
                self._by_joints(s, q, curves, LIFTING, held)
            else:
                self._close(s, q, held | curves, HEAVY_BODY)
        else:
            q = self.held_way(s)
            if self.shape.joints:
                self._by_joints(s, q, curves, LIFTING)
            else:
                self._by_curves(s, q, curves)
        q[0], q[-1] = self.one.q, self.other.q
        self._check(q, count)
        return MovePath(self.closure, self.held, s, q)

    def held_way(self, s: Array) -> Array:
        """Body and limbs that hold, which another swing does not change."""
        shape = self.shape
        key = len(s), shape.window, shape.bow, shape.yields
        if key not in self.known:
            try:
                self.known[key] = q = self._between(s)
                self._close(s, q, self._places(s), LIGHT_BODY if shape.yields else HEAVY_BODY)
            except HeldError as error:
                self.known[key] = error
        known = self.known[key]
        if isinstance(known, HeldError):
            raise known
        return known.copy()

    def _places(self, s: Array) -> dict[int, Array]:
        return {limb: np.tile(place(pose), (len(s), 1)) for limb, pose in self.held.items()}

    def strayed(self, path: MovePath) -> float:
        """How far limbs that lift or land are from their curves half-way between samples [m]."""
        middle = (path.s[1:] + path.s[:-1]) / 2
        chosen = middle[(middle < LIFTING) | (middle > 1.0 - LIFTING)] if self.swings else middle[:0]
        curves = {limb: self._curve(limb, chosen) for limb in self.swings}
        left = self.closure.bring(path.configurations(path.at(chosen)), curves, turned=False, steps=0)
        return float(left.max(initial=0.0))

    def _between(self, s: Array) -> Array:
        """Body on the straight line, joints evenly."""
        robot, ends = self.climber.robot, (self.one.q, self.other.q)
        first, last = (self.climber.body_pose(q) for q in ends)
        turn, b = pin.log3(first.rotation.T @ last.rotation), self.shape.body(s)[:, None]
        joints = joint_values(robot, ends[0][None]) + s[:, None] * pin.difference(robot.model, *ends)[6:]
        out = with_joint_values(robot, np.tile(ends[0], (len(s), 1)), joints)
        bow = self.shape.bowed(s)[:, None] * np.array(self.shape.bow)
        positions = (1.0 - b) * first.translation + b * last.translation + bow
        for q, rotation, position in zip(out, first.rotation @ exponential(b * turn), positions, strict=True):
            q[:] = self.climber.with_body(q, pin.SE3(rotation, position))
        return out

    def _curve(self, limb: int, s: Array) -> Array:
        """Contact poses of a limb in the air ``(n, 12)``: straight up, over on a cubic that continues both, straight
        down.
        """
        (start, end), (up, down) = (self.poses[0][limb], self.poses[1][limb]), self.lifts[limb]
        at, to, span = start.translation + up, end.translation + down, 1.0 - 2.0 * LIFTING
        x = np.clip((s - LIFTING) / span, 0.0, 1.0)[:, None]
        out = np.empty((len(s), 12))
        out[:, 9:] = _cubic(x, at, to, up * span / LIFTING, -down * span / LIFTING)
        out[:, 9:] += np.minimum(s / LIFTING - 1.0, 0.0)[:, None] * up
        out[:, 9:] += np.minimum((1.0 - s) / LIFTING - 1.0, 0.0)[:, None] * down
        turn = x * x * (3.0 - 2.0 * x) * pin.log3(start.rotation.T @ end.rotation)
        out[:, :9] = (start.rotation @ exponential(turn)).reshape(-1, 9)
        return out

    def _by_curves(self, s: Array, q: Array, curves: Mapping[int, Array]) -> None:
        """Limbs in the air go on their curves. Where they cannot with their turns, as from branch to branch or past a
        singular wrist, these are free in between: joints go evenly but for what positions on the curves need.
        """
        kept = q.copy()
        try:
            self._close(s, q, curves, 0.0)
            self._check(q, len(s) - 1)
        except InfeasibleError as error:
            if isinstance(error, HeldError) or all(self.climber.fixed(limb) == "position" for limb in curves):
                raise
            q[:] = kept
            between = self._by_joints(s, q, curves, ALIGNED)
            self._close(s[between], q[between], {k: curve[between] for k, curve in curves.items()}, 0.0, turned=False)

    def _by_joints(
        self, s: Array, q: Array, curves: Mapping[int, Array], share: float, held: Mapping[int, Array] | None = None
    ) -> slice:
        """Limbs in the air lift and land on their curves over a share of the path, and in between, which is returned,
        go evenly in their joints. Where limbs that hold are given, these do so too, and the body goes along.
        """
        up, down = (int(k) for k in np.flatnonzero((s > share - 1e-9) & (s < 1.0 - share + 1e-9))[[0, -1]])
        held, even = held or {}, [*self.swings, *(held or {})]
        wanted, between = {**held, **curves}, slice(up + 1, down)
        for part in (slice(up + 1), slice(down, None)):
            ends = {limb: poses[part] for limb, poses in wanted.items()}
            self._close(s[part], q[part], ends, HEAVY_BODY if held else 0.0)
        x = np.linspace(0.0, 1.0, down - up + 1)[:, None]
        for limb in even:
            first, last = ([self.climber.angles(row, limb) for row in q[k : k + 2]] for k in (up - 1, down))
            slopes = (first[1] - first[0]) * (down - up), (last[1] - last[0]) * (down - up)
            angles = _cubic(x, first[1], last[0], *slopes)
            if limb in self.shape.via or self.shape.tucked:
                middle, rest = (first[1] + last[0]) / 2, self.climber.angles(self.climber.rest, limb)
                via = self.shape.via.get(limb, middle + self.shape.tucked * (rest - middle))
                angles += 16.0 * (x * (1.0 - x)) ** 2 * (via - _cubic(0.5, first[1], last[0], *slopes))
            self.closure.put(limb, q[up : down + 1], angles)
        if held:
            self._close(s[between], q[between], {k: poses[between] for k, poses in held.items()}, FREE_BODY)
        self.even = self._steps(q)
        self.even[:up], self.even[down:] = 0.0, 0.0
        for limb in set(self.held).difference(even):
            self.even[:, self.climber.joints(limb) - 6] = 0.0
        return between

    def _close(self, s: Array, q: Array, wanted: Mapping[int, Array], body: float, turned: bool = True) -> None:
        """Brings contacts to poses in the world, ``(samples, 12)``, or to their positions only; the body as well, where
        limbs cannot follow.
        """
        reached = [self.closure.followed(k, q, p, turned) for k, p in wanted.items()] if body < LIGHT_BODY else [0]
        if min(reached, default=len(s)) == len(s):
            return
        if body == 0.0 and not self.closure.short.intersection(wanted):
            name, part = self.climber.limbs[list(wanted)[int(np.argmin(reached))]].name, 100.0 * s[min(reached)]
            reason = f"is out of reach at {part:.0f} % of the way to the next stance"
            raise InfeasibleError(f"contact of {name}", float(s[min(reached)]), reason)
        left = self.closure.bring(q, wanted, body, turned)
        for k in np.flatnonzero(left > 1e3 * CLOSED)[:1]:
            at, size, here = float(s[k]), float(left[k]), slice(k, k + 1)
            away = {limb: self.closure.error(q[here], {limb: poses[here]}) for limb, poses in wanted.items()}
            kind, limb = InfeasibleError if body == 0.0 else HeldError, max(away, key=lambda limb: away[limb])
            reason = f"is off by {size:.3g} m or rad at {100.0 * at:.0f} % of the way to the next stance"
            raise kind(f"contact of {self.climber.limbs[limb].name}", size, reason)

    def _kind(self, dof: str) -> type[InfeasibleError]:
        """Of an error of a joint: whether it is one of a limb that holds."""
        number = self.climber.robot.dof_names.index(dof)
        return HeldError if any(number in self.climber.joints(limb) for limb in self.held) else InfeasibleError

    def _steps(self, q: Array) -> Array:
        """Of joints from sample to sample [m, rad]."""
        return np.array([pin.difference(self.climber.robot.model, a, b)[6:] for a, b in itertools.pairwise(q)])

    def _check(self, q: Array, count: int) -> None:
        robot, most = self.climber.robot, JUMP * FEWEST / count
        steps = self._steps(q)
        jumps = np.abs(steps - self.even)
        if jumps.size and jumps.max() > most:
            k, joint = np.unravel_index(int(jumps.argmax()), steps.shape)
            name, size = robot.dof_names[6 + int(joint)], float(abs(steps[k, joint]))
            raise self._kind(name)(name, size, f"jumps by {size:.3g} rad or m on the way to the next stance")
        if worst := beyond_limits(robot, q):
            raise self._kind(worst[0])(
                worst[0], worst[1], f"is {worst[1]:.3g} rad or m beyond its limit on the way to the next"
            )


def _cubic(x: Array | float, a: Array, b: Array, slope: Array, last: Array) -> Array:
    """The cubic from a to b over 0 .. 1 with these slopes at its ends."""
    return np.asarray(
        (1.0 + 2.0 * x) * (1.0 - x) ** 2 * a
        + x**2 * (3.0 - 2.0 * x) * b
        + x * (1.0 - x) ** 2 * slope
        - x**2 * (1.0 - x) * last
    )


def _product(a: Array, b: Array) -> Array:
    """Quaternions a b, of x, y, z, w: one and several."""
    vector = a[3] * b[:, :3] + b[:, 3:] * a[:3] + np.cross(a[:3], b[:, :3])
    return np.column_stack([vector, a[3] * b[:, 3] - b[:, :3] @ a[:3]])
