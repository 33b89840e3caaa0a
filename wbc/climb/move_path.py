"""Paths of a climber from one stance to the next: contacts that are held stay where they are, the others go over."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wbc.climb.clear import stray_of
from wbc.climb.closure import CLOSED, HEAVY_BODY, LIGHT_BODY, Closure
from wbc.climb.elastic_band import BandRows, ElasticBand
from wbc.climb.stance import FREE_LIMB, Stance
from wbc.climb.world import held_pose
from wbc.errors import InfeasibleError
from wbc.multibody import pin
from wbc.robot.joint_values import beyond_limits, joint_values, with_joint_values
from wbc.rotations import exponential, matrices
from wbc.symbolic.joint_steps import place
from wbc.validation import Array

#: Share of a path in which a limb lifts, and in which it lands
LIFTING = 0.2
#: Share of a path in which a limb keeps its turn as it lifts, and as it lands
ALIGNED = 0.1
#: Share of a path along a guide in which a limb that lifts or lands is on its curve: then it goes over to the guide
ON_CURVE = 0.15
#: Intervals of a path at first: they are doubled until contacts hold between them
FEWEST = 20
#: Intervals of a path at most
MOST = 160
#: Largest error of a held contact between samples [m, rad]
HELD = 2e-5
#: Largest change of a joint from sample to sample beyond what it is asked to make, as a share of 1 rad in the coarsest
#: path: more is a jump
JUMP = 0.6


@dataclass(frozen=True, eq=False)
class SwingShape:
    """How limbs in the air go from lift to land.

    Attributes:
        height: how far the contact is lifted along the normal that it leaves, and along the one that it lands on [m].
        lean: how much of that goes towards where the limb's contact is at rest, at most this share of the height [1].
        yields: without a guide the body yields to limbs that hold, which go as evenly in their joints as they can.
        still: the body stays where it is, as both stances have it.
        guide: a path that body and limbs follow, but for what contacts need; None: the body goes straight and evenly,
            contacts in the air on their curves.
    """

    height: float
    lean: float = 0.0
    yields: bool = False
    still: bool = False
    guide: MovePath | None = None


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
    closure: Closure, one: Stance, other: Stance, shape: SwingShape, normals: Mapping[int, Array]
) -> MovePath:  # fmt: skip
    """The path from a stance to the next one: contacts that both have stay closed.

    Args:
        normals: row of a foothold -> outward normal in the world ``(3)``, of footholds that are left or landed on.

    Raises:
        InfeasibleError: held contacts cannot stay closed on the way, a joint has to jump, or it leaves its limits.
    """
    count = FEWEST
    while True:
        moving = _Moving(closure, one, other, shape, normals)
        path = moving.path(count)
        if path.error < HELD and moving.strayed(path) < stray_of(closure.climber):
            return path
        count *= 2
        if count > MOST:
            if path.error < HELD:
                raise InfeasibleError("limbs in the air", path.error, f"stray from their curves between {MOST} samples")
            reason = f"leave their places by {path.error:.2g} m or rad between {MOST} samples"
            raise InfeasibleError("held contacts", path.error, reason)


def band_path(
    closure: Closure, one: Stance, other: Stance, shape: SwingShape, normals: Mapping[int, Array], band: ElasticBand
) -> MovePath:
    """A path through the samples of an elastic band from a stance to the next one.

    Raises:
        InfeasibleError: contacts cannot be where they have to.
    """
    moving, s = _Moving(closure, one, other, shape, normals), np.linspace(0.0, 1.0, FEWEST + 1).round(9)
    q, ends = moving.evenly(s), (s < LIFTING + 1e-9) | (s > 1.0 - LIFTING - 1e-9)
    curves = moving.curves(s)
    poses = np.tile([place(pose) for pose in moving.poses[0]], (len(s), 1, 1))
    closed = np.zeros(poses.shape[:2], dtype=bool)
    for limb in moving.held:
        poses[:, limb] = place(held_pose(closure.climber, band.world.scene, limb, one.contacts[limb], one.q))
        closed[:, limb] = True
    for limb, curve in curves.items():
        poses[:, limb], closed[:, limb] = curve, ends
    contacts = [band.world.places_of(stance.contacts) for stance in (one, other)]
    near = np.repeat(contacts, [len(s) // 2, len(s) - len(s) // 2], axis=0)
    bears = np.where(contacts[0] == contacts[1], contacts[0], FREE_LIMB).astype(np.int32)
    rows = BandRows(near, poses, closed, bears)
    q = closure.climber.with_states(q, band.relaxed(closure.climber.states(q), rows))
    moving.close_ends(s, q)
    q[0], q[-1] = one.q, other.q
    # Contacts go on their curves up to where these end: a spline through few samples would have a kink there
    fine = np.linspace(0.0, 1.0, 4 * FEWEST + 1)
    fine = np.union1d(s, fine[(fine < LIFTING + 1e-9) | (fine > 1.0 - LIFTING - 1e-9)].round(9))
    path = MovePath(closure, moving.held, s, q)
    q = path.configurations(path.at(fine))
    moving.close_ends(fine, q)
    q[0], q[-1] = one.q, other.q
    return MovePath(closure, moving.held, fine, q)


class _Moving:
    """What goes where on the way from one stance to the next."""

    def __init__(
        self, closure: Closure, one: Stance, other: Stance, shape: SwingShape, normals: Mapping[int, Array]
    ) -> None:  # fmt: skip
        self.closure, self.one, self.other, self.shape = closure, one, other, shape
        self.climber = closure.climber
        self.poses = closure.poses(one.q), closure.poses(other.q)
        pairs = list(zip(one.contacts, other.contacts, strict=True))
        self.held = {k: self.poses[0][k] for k, (a, b) in enumerate(pairs) if a == b != FREE_LIMB}
        self.swings = [k for k, (a, b) in enumerate(pairs) if a != b]
        #: Steps of joints that a guide makes, or that are asked of limbs in the air, from sample to sample [m, rad]
        self.even: Array | float = 0.0
        self.lifts = {
            k: tuple(self._lift(k, end, row, normals) for end, row in enumerate(pairs[k])) for k in self.swings
        }

    def _lift(self, limb: int, end: int, row: int, normals: Mapping[int, Array]) -> Array:
        """From a contact of the first or second stance to where it is lifted [m]."""
        if row == FREE_LIMB:
            return np.zeros(3)
        out = self.shape.height * normals[row]
        if self.shape.lean > 0.0:
            climber, stance = self.climber, (self.one, self.other)[end]
            rest = climber.body_pose(climber.rest).actInv(climber.contact_pose(climber.rest, limb))
            away = (climber.body_pose(stance.q) * rest).translation - self.poses[end][limb].translation
            away -= (away @ normals[row]) * normals[row]
            out += self.shape.lean * away * min(1.0, self.shape.height / max(float(np.linalg.norm(away)), 1e-9))
        return np.asarray(out)

    def path(self, count: int) -> MovePath:
        s = np.linspace(0.0, 1.0, count + 1)
        if self.shape.guide is not None:
            q = self.shape.guide.configurations(self.shape.guide.at(s))
            self.even = self._steps(q)
            self.close_ends(s, q)
        else:
            q, held, curves = self.evenly(s), self._places(s), self.curves(s)
            if self.closure.short.intersection([*held, *curves]):
                # The body goes where limbs that fix more rows than they have joints take it
                self._close(s, q, held | curves, HEAVY_BODY)
            else:
                self._close(s, q, held, LIGHT_BODY if self.shape.yields else HEAVY_BODY)
                self._by_curves(s, q, curves)
        q[0], q[-1] = self.one.q, self.other.q
        self._check(q, count)
        return MovePath(self.closure, self.held, s, q)

    def _by_curves(self, s: Array, q: Array, curves: Mapping[int, Array]) -> None:
        """Limbs in the air go on their curves, and keep their turns as they lift and land; in between these are free,
        as branches and singular wrists lie there: joints go evenly but for what positions on the curves need.
        """
        up, down = (int(k) for k in np.flatnonzero((s > ALIGNED - 1e-9) & (s < 1.0 - ALIGNED + 1e-9))[[0, -1]])
        for part in (slice(up + 1), slice(down, None)):
            self._follow(s[part], q[part], {limb: poses[part] for limb, poses in curves.items()})
        between, x = slice(up + 1, down), np.linspace(0.0, 1.0, down - up + 1)[:, None]
        for limb in curves:
            first, last = ([self.climber.angles(row, limb) for row in q[k : k + 2]] for k in (up - 1, down))
            slopes = (first[1] - first[0]) * (down - up), (last[1] - last[0]) * (down - up)
            free = q[up : down + 1]
            free[:] = self.climber.with_limb(free, limb, _cubic(x, first[1], last[0], *slopes))
        self.even = self._steps(q)
        self.even[:up], self.even[down:] = 0.0, 0.0
        for limb in self.held:
            self.even[:, self.climber.joints(limb) - 6] = 0.0
        self._follow(s[between], q[between], {limb: poses[between] for limb, poses in curves.items()}, turned=False)

    def close_ends(self, s: Array, q: Array) -> None:
        """Brings contacts that hold, and those that lift or land, to where they have to be, in place."""
        up, down = s < ON_CURVE + 1e-9, s > 1.0 - ON_CURVE - 1e-9
        for part, curves in ((up, self.curves(s[up])), (~(up | down), {}), (down, self.curves(s[down]))):
            some = q[part]
            self._close(s[part], some, curves | self._places(s[part]), 0.0 if self.shape.still else LIGHT_BODY)
            q[part] = some

    def curves(self, s: Array) -> dict[int, Array]:
        """Of each limb in the air the poses of its contact ``(n, 12)``."""
        return {limb: self._curve(limb, s) for limb in self.swings}

    def _places(self, s: Array) -> dict[int, Array]:
        return {limb: np.tile(place(pose), (len(s), 1)) for limb, pose in self.held.items()}

    def strayed(self, path: MovePath) -> float:
        """How far limbs that lift or land are from their curves half-way between samples [m]."""
        middle = (path.s[1:] + path.s[:-1]) / 2
        share = LIFTING if self.shape.guide is None else ON_CURVE
        chosen = middle[(middle < share) | (middle > 1.0 - share)] if self.swings else middle[:0]
        left = self.closure.bring(path.configurations(path.at(chosen)), self.curves(chosen), turned=False, steps=0)
        return float(left.max(initial=0.0))

    def evenly(self, s: Array) -> Array:
        """Body on the straight line, joints evenly."""
        robot, ends = self.climber.robot, (self.one.q, self.other.q)
        first, last = (self.climber.body_pose(q) for q in ends)
        turn, part = pin.log3(first.rotation.T @ last.rotation), s[:, None]
        steps = pin.difference(robot.model, *ends)[6:]
        joints = joint_values(robot, ends[0][None]) + part * steps
        out = with_joint_values(robot, np.tile(ends[0], (len(s), 1)), joints)
        positions = (1.0 - part) * first.translation + part * last.translation
        for q, rotation, position in zip(out, first.rotation @ exponential(part * turn), positions, strict=True):
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

    def _close(self, s: Array, q: Array, wanted: Mapping[int, Array], body: float) -> None:
        """Brings contacts to poses in the world, ``(samples, 12)``; the body as well, where that is not 0."""
        left = self.closure.bring(q, wanted, body)
        for k in np.flatnonzero(left > 1e3 * CLOSED)[:1]:
            at, size, here = float(s[k]), float(left[k]), slice(k, k + 1)
            away = {limb: self.closure.error(q[here], {limb: poses[here]}) for limb, poses in wanted.items()}
            limb = max(away, key=lambda limb: away[limb])
            reason = f"is off by {size:.3g} m or rad at {100.0 * at:.0f} % of the way to the next stance"
            raise InfeasibleError(f"contact of {self.climber.limbs[limb].name}", size, reason)

    def _follow(self, s: Array, q: Array, wanted: Mapping[int, Array], turned: bool = True) -> None:
        """Brings contacts to poses in the world ``(samples, 12)``, or to their positions only, one limb after the other
        from sample to sample, the body as it is.
        """
        for limb, poses in wanted.items():
            if (reached := self.closure.followed(limb, q, poses, turned)) < len(s):
                part, name = float(s[reached]), self.climber.limbs[limb].name
                reason = f"is out of reach at {100.0 * part:.0f} % of the way to the next stance"
                raise InfeasibleError(f"contact of {name}", part, reason)

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
            raise InfeasibleError(name, size, f"jumps by {size:.3g} rad or m on the way to the next stance")
        if worst := beyond_limits(robot, q):
            raise InfeasibleError(
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
