"""A climber and a scene as the compiled planner reads them, and what it answers."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wbc.clearance import SweptBody
from wbc.climb.chain import STRUCTURES, address_of as _at, library, limb_table
from wbc.climb.clear import SINK, climber_bodies, sunk_tips
from wbc.climb.climber import Climber
from wbc.climb.contacts import ContactKind
from wbc.climb.reach import LIMIT_MARGIN
from wbc.climb.scene import ClimbScene, SceneBody
from wbc.climb.stance import FREE_LIMB, Stance
from wbc.errors import RangeError
from wbc.geometry.kernel import ShapeTable, checked, distances
from wbc.multibody import pin
from wbc.shapes import PlacedShape
from wbc.symbolic.joint_steps import place
from wbc.symbolic.kinematics import frame_index
from wbc.validation import Array

_ConeStruct, _PieceStruct, _ClimbStruct = map(STRUCTURES.structure, ("cone_t", "piece_t", "climb_t"))
#: Turns about its normal at which a foothold is tried that says nothing of them, by limbs that fix their turn
TURNS = 12
#: What postures keep more than motions have to [m]: between two postures links may come nearer
SPARE = 1e-3
#: Rows of a cone and singular values below this are none
TINY = 1e-12


class PostureOutcome(IntEnum):
    """What became of a posture that was sought; the same numbers stand in ``native/posture.h``."""

    STANDS = 0
    NOT_REACHED = 1
    NOT_BORNE = 2
    TOUCHES = 3
    BREAKS = 4


class SampleAims(NamedTuple):
    """What contacts of some states are to be.

    Attributes:
        near: places near which tips may be ``(n, limbs)``.
        closed: which contacts are to be where they are wanted ``(n, limbs)``.
        poses: where, in the world ``(n, limbs, 12)``.
    """

    near: NDArray[np.int32]
    closed: NDArray[np.bool_]
    poses: Array


@dataclass(frozen=True, eq=False)
class SlackCone:
    """Wrenches w = N x of a contact, with A x + s t <= b where t is their slack.

    Attributes:
        N: ``(6, k)``: directions of the wrenches that the contact bears at all.
        A, b, s: ``(rows, k)``, ``(rows)``, ``(rows)``; b in newtons and newton metres, s of a slack of 1 N.
    """

    N: Array
    A: Array
    b: Array
    s: Array

    @classmethod
    def of(cls, kind: ContactKind) -> SlackCone:
        """That of a way to hold. The slack of a row is a force of that size along it; of a row of moments alone, that
        force at the lever by which the kind's largest moments are larger than its largest forces.
        """
        A, b = (np.asarray(part, dtype=np.float64) for part in kind.cone())
        A, b = A[np.isfinite(b)], b[np.isfinite(b)]
        tied = np.array([(np.abs(A + row) < TINY).all(axis=1).any() for row in A], dtype=bool) & (np.abs(b) < TINY)
        _, sizes, basis = np.linalg.svd(np.vstack([A[tied], np.zeros((1, 6))]))
        N, A, b = _tidy(basis[int((sizes > TINY).sum()) :].T), A[~tied], b[~tied]
        forces, moments = np.linalg.norm(A[:, :3], axis=1), np.linalg.norm(A[:, 3:], axis=1)
        pure = forces < TINY
        lever = 0.0
        if pure.any() and (~pure & (b > 0.0)).any():
            lever = float((b[pure] / moments[pure]).min() / (b[~pure] / forces[~pure]).max())
        return cls(N, A @ N, b, np.where(pure, lever * moments, forces))


def _tidy(basis: Array) -> Array:
    """A basis of the same space whose columns are unit vectors where they can be."""
    chosen = [np.eye(6)[k] for k in range(6) if np.linalg.norm(basis @ basis[k]) > 1.0 - 1e-9]
    if len(chosen) == basis.shape[1] and all(np.abs(basis @ (basis.T @ c) - c).max() < 1e-9 for c in chosen):
        return np.array(chosen).T.reshape(6, -1)
    return basis


class ClimbWorld:
    """A climber and a scene in memory. Contacts are rows of int32, one a limb: numbers of places, each a foothold with
    the turn about its normal at which it is held, or ``FREE_LIMB``.

    Args:
        start: a stance whose contacts count as places where they are.
        margin: from limits of joints [m, rad]. clear, apart: distances that links keep from bodies and from each other
            [m].
        spare: how much more they keep, also from what tips hold, than :class:`Clearances` says [m].
        friction: share of the coefficients of friction that counts, and its square of soles [1]: a loop that counts on
            the share of them has the rest to follow with.

    Attributes:
        places: poses ``(places, 12)``. hold: the foothold of each. start: places of the start's contacts.
        weight: size of a unit of force [N]: the robot's weight, or 1 N where nothing weighs.
    """

    def __init__(
        self, climber: Climber, scene: ClimbScene, start: Stance | None = None, margin: float = LIMIT_MARGIN,
        clear: float = 0.0, apart: float = 0.0, *, friction: float = 1.0, spare: float = SPARE,
    ) -> None:  # fmt: skip
        self.climber, self.scene, self.margin = climber, scene, margin
        self.limbs = limb_table(climber, margin)
        self._code = checked(library(), wbc_climb_size=_ClimbStruct)
        self._code.wbc_slack.restype = ctypes.c_double
        self._code.wbc_candidates.restype = ctypes.c_long
        counts = [len(rest) for rest in self.limbs.rest]
        self.offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        gravity = np.asarray(scene.gravity, dtype=np.float64)
        strength = float(np.linalg.norm(gravity))
        if strength > 0.0 and not climber.mass > 0.0:
            reason = f"{climber.name} has no masses, so nothing says what its limbs bear: expected 0, 0, 0"
            raise RangeError("scene.gravity", gravity.tolist(), reason)
        self.weight = climber.mass * strength if strength > 0.0 else 1.0
        self.length = float(max(row.length for row in self.limbs.numbers))
        self.places, self.hold, turns, self.start = self._all_places(start)
        names = list(scene.bodies)
        on_body = [names.index(h.on) if h.on in names else -1 for h in scene.footholds]
        on = np.array(on_body, dtype=np.int32)[self.hold]
        self._cones, self.cone_of = self._shapes_of_cones(turns, friction)
        pieces, links, shapes, poses, pairs = self._bodies(spare, apart + spare)
        self.links, self.bodies = links, names
        self._shape_table = ShapeTable(shapes, _pieces_of(climber, margin).table)
        self._held: list[Any] = [on, pieces, poses, pairs]
        self.touch = self._at_rest()
        down = gravity / strength if strength > 0.0 else np.zeros(3)
        self.numbers = _ClimbStruct(
            limbs=len(climber.limbs), footholds=len(self.places), pieces=len(links), bodies=len(names),
            pairs=len(pairs), weightless=int(strength == 0.0), mass=climber.mass, length=self.length,
            clear=clear + spare, apart=apart + spare, down=tuple(down), trunk=tuple(self.limbs.trunk),
            limb=ctypes.addressof(self.limbs.numbers),
            offset=self.offsets.ctypes.data, foothold=self.places.ctypes.data,
            cone_of=self.cone_of.ctypes.data, cone=ctypes.addressof(self._cones), on=on.ctypes.data,
            hold=self.hold.ctypes.data,
            piece=ctypes.addressof(pieces), shape=self._shape_table.address, body=poses.ctypes.data,
            pair=pairs.ctypes.data,
        )  # fmt: skip
        self._world = ctypes.byref(self.numbers)

    def __del__(self) -> None:
        if hasattr(self, "_world"):
            self._code.wbc_climb_forget(self._world)

    def cone(self, limb: int, foothold: int) -> SlackCone:
        """Of a limb at a foothold, with the lower of their frictions."""
        return self._slack_cones[int(self.cone_of[limb, foothold])]

    def forces(self, limb: int) -> set[int]:
        """Numbers of independent wrenches that a limb bears at the places that it may hold."""
        return {self._slack_cones[k].N.shape[1] for k in np.unique(self.cone_of[limb]) if k >= 0}

    def state_of(self, q: Array) -> Array:
        """Pose of the body and angles of all limbs, as of :meth:`Climber.states`."""
        return np.asarray(self.climber.states(np.asarray(q)[None])[0])

    def q_of(self, state: Array) -> Array:
        """The configuration of such a row; joints of no limb are at rest."""
        return np.asarray(self.climber.with_states(self.climber.rest[None], state[None])[0])

    def slack(
        self, contacts: Sequence[int] | NDArray[np.int32], center: Array, poses: Array | None = None
    ) -> tuple[float, Array]:
        """Slack in shares of weight, and its bound (offset, gradient over the centre of mass) ``(4)``; infinite where
        nothing weighs and contacts hold.

        Args:
            poses: of the contacts ``(limbs, 12)``; None: those of their places.
        """
        bound, at = np.zeros(4), np.ascontiguousarray(center, dtype=np.float64)
        given = None if poses is None else _at(poses)
        slack = float(self._code.wbc_slack(self._world, _at(self.contacts(contacts)), given, _at(at), _at(bound)))
        if self.numbers.weightless:
            slack = np.inf if slack > 1e-9 else -np.inf
        return slack, bound

    def wrench_slacks(
        self, contacts: Sequence[int] | NDArray[np.int32], poses: Array, point: Array, wrenches: Array
    ) -> tuple[Array, Array]:  # fmt: skip
        """Slacks ``(n)`` in shares of weight for wrenches that the contacts have to give, and bounds ``(n, 7)``:

            slack(w) <= b[0] + b[1:] w      for every w about that point

        Args:
            poses: of the contacts ``(limbs, 12)``. point: in the world ``(3)`` [m].
            wrenches: ``(n, 6)``: force and moment about the point [weights, weights m].
        """
        given, at = np.ascontiguousarray(wrenches), np.ascontiguousarray(point)
        slacks, bounds = np.empty(len(given)), np.empty((len(given), 7))
        self._code.wbc_wrench_slacks(
            self._world, _at(self.contacts(contacts)), _at(poses), _at(at), ctypes.c_long(len(given)), _at(given),
            _at(slacks), _at(bounds),
        )  # fmt: skip
        return slacks, bounds

    def largest_slack(self, G: Array, r: Array, A: Array, s: Array, b: Array) -> float:
        """The largest t <= 1 with G x = r and A x + s t <= b, of ``G`` ``(6, n)`` and ``A`` ``(m, n)``; -inf: none."""
        given = [np.ascontiguousarray(part) for part in (G, r, A, b, s)]
        self._code.wbc_largest_slack.restype = ctypes.c_double
        return float(self._code.wbc_largest_slack(G.shape[1], len(A), *map(_at, given)))

    def look(self, contacts: NDArray[np.int32], state: Array) -> tuple[Array, str]:
        """Slack, clearance [m] and each limb's distance from its foothold [m] of a state; what is nearest."""
        numbers, which = np.zeros(2 + len(self.climber.limbs)), np.zeros(4, dtype=np.int32)
        self._code.wbc_look(self._world, _at(contacts), _at(state), _at(numbers), _at(which))
        if self.numbers.weightless:
            numbers[0] = np.inf if numbers[0] > 1e-9 else -np.inf
        return numbers, self.touching(which) if np.isfinite(numbers[1]) else ""

    def stand(
        self,
        contacts: NDArray[np.int32],
        bears: NDArray[np.int32],
        wanted: float,
        state: Array,
        *,
        body: Array | None = None,
        weights: tuple[float, float] = (0.0, 0.0),
        followed: bool = True,
    ) -> tuple[PostureOutcome, Array, float]:
        """A posture on contacts that ``bears`` of them bear with a slack: outcome, state, slack.

        Args:
            body: pose to which the body is drawn, 12 numbers, by ``weights`` of its place and turn.
            followed: whether limbs are followed from ``state`` on.
        """
        wish = np.concatenate([weights, state[:12] if body is None else body])
        given = _at(contacts), _at(bears), ctypes.c_double(wanted), _at(wish), int(followed)
        return self._sought(self._code.wbc_stand, state, *given)

    def stuck(self, contacts: NDArray[np.int32], state: Array) -> int:
        """How many limbs cannot lift off where they hold without links that touch, the body as it is."""
        return int(self._code.wbc_stuck(self._world, _at(contacts), _at(state)))

    def lift(
        self, contacts: NDArray[np.int32], kept: NDArray[np.int32], wanted: float, state: Array, attempt: int = 0
    ) -> tuple[PostureOutcome, Array, float, bool]:
        """The state from which all limbs but those kept let go: outcome, state, slack, and whether it is another state
        than the one given. Each ``attempt`` from 1 to 3 begins elsewhere.
        """
        moves = ctypes.c_int()
        given = _at(contacts), _at(kept), ctypes.c_double(wanted), _at(self.touch), attempt, ctypes.byref(moves)
        return *self._sought(self._code.wbc_lift, state, *given), bool(moves.value)

    def land(
        self, after: NDArray[np.int32], kept: NDArray[np.int32], wanted: float, state: Array, attempt: int = 0
    ) -> tuple[PostureOutcome, Array, float]:
        """The state from there on in which limbs hold again: outcome, state, slack."""
        given = _at(after), _at(kept), ctypes.c_double(wanted), _at(self.touch), attempt
        return self._sought(self._code.wbc_land, state, *given)

    def _sought(self, call: Any, state: Array, *given: Any) -> tuple[PostureOutcome, Array, float]:
        """What a call makes of a state: outcome, state, slack."""
        out, slack = state.copy(), np.zeros(1)
        how = call(self._world, *given, _at(out), _at(slack))
        return PostureOutcome(how), out, float(slack[0])

    def band(
        self, aims: SampleAims, bounds: Array, slack: float, aside: float, states: Array
    ) -> tuple[Array, Array, float, Array, Array, Array]:  # fmt: skip
        """Normal equations of states ``(n, ...)`` over the twist of the body and all angles, m of them: H, of which the
        lower half counts, ``(n, m, m)`` and g ``(n, m)``; their cost; clearances less what is kept ``(n)`` [m]; squared
        errors of contacts ``(n)`` [lengths squared]; centres of mass ``(n, 3)`` [m].

        Args:
            aims: of contacts. bounds: of slack ``(k, 4)``, as of :meth:`slack`. slack: that they are to leave.
            aside: how much further apart than they have to be links are led [m].
        """
        n, m = len(states), states.shape[1] - 6
        H, g, each, centers = np.empty((n, m, m)), np.empty((n, m)), np.empty((3, n)), np.empty((n, 3))
        given = [np.ascontiguousarray(part) for part in (*aims, bounds, states)]
        self._code.wbc_band(
            self._world, ctypes.c_long(n), *map(_at, given[:3]), len(bounds), _at(given[3]), ctypes.c_double(slack),
            ctypes.c_double(aside), _at(given[4]), _at(H), _at(g), *map(_at, each), _at(centers),
        )  # fmt: skip
        return H, g, float(each[0].sum()), each[1], each[2], centers

    def candidates(
        self, contacts: NDArray[np.int32], state: Array, least: float, most: float, guesses: bool = True
    ) -> tuple[NDArray[np.int32], Array]:
        """Places that limbs may hold next, as far from where they are at rest as squared lengths of the limb within
        [least, most): limb and place ``(n, 2)``; the stretch then and the body's place ``(n, 4)``, or that far and
        where it is, where they are not guessed.
        """
        room = len(self.climber.limbs) * len(self.places)
        out, stretch = np.empty((room, 2), dtype=np.int32), np.empty((room, 4))
        count = self._code.wbc_candidates(
            self._world, _at(contacts), _at(self.touch), _at(state), ctypes.c_double(least), ctypes.c_double(most),
            int(guesses), _at(out), _at(stretch),
        )  # fmt: skip
        return out[:count], stretch[:count]

    def stretch(self, contacts: NDArray[np.int32], state: Array) -> float:
        """The stretch of contacts, as of :meth:`candidates`."""
        self._code.wbc_stretch.restype = ctypes.c_double
        return float(self._code.wbc_stretch(self._world, _at(contacts), _at(self.touch), _at(state)))

    def contacts(self, contacts: Sequence[int] | NDArray[np.int32]) -> NDArray[np.int32]:
        """A row for the other calls."""
        return np.array(contacts, dtype=np.int32)

    def places_of(self, contacts: Sequence[int] | NDArray[np.int32]) -> NDArray[np.int32]:
        """The first place of each foothold, of rows of these."""
        rows = np.asarray(contacts)
        return np.where(rows >= 0, self._first[self._level, rows], rows).astype(np.int32)

    def touching(self, which: NDArray[np.int32]) -> str:
        """The names of two bodies that touch."""
        other = int(which[1])
        return f"{self.links[which[0]]} and {self.bodies[other] if other >= 0 else self.links[-1 - other]}"

    def _all_places(self, start: Stance | None) -> tuple[Array, NDArray[np.int32], NDArray[np.bool_], tuple[int, ...]]:
        """Poses of all places, their footholds, which of them limbs of fixed turn alone hold, and those of the start.

        Footholds that say nothing of turns are held at ``TURNS`` of them where a limb fixes its turn. Limbs whose
        contact frames are at different heights over footholds have places of their own.
        """
        climber, holds = self.climber, self.scene.footholds
        fixes = [climber.fixed(limb) == "pose" for limb in range(len(climber.limbs))]
        counts = np.array([(hold.rolls or TURNS) if any(fixes) else 1 for hold in holds], dtype=np.int32)
        each = np.repeat(np.arange(len(holds), dtype=np.int32), counts)
        turn = np.arange(len(each)) - np.repeat(np.cumsum(counts) - counts, counts)
        angle = 2.0 * np.pi * turn / counts[each]
        given = np.array([hold.pose.rotation for hold in holds]).reshape(-1, 3, 3)[each]
        across, beside = given[:, :, 0], given[:, :, 1]
        spun = given.copy()
        spun[:, :, 0] = np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * beside
        spun[:, :, 1] = np.cos(angle)[:, None] * beside - np.sin(angle)[:, None] * across
        heights, self._level = np.unique([limb.contact.height for limb in climber.limbs], return_inverse=True)
        levels = np.repeat(np.arange(len(heights)), len(each))
        self._first = np.searchsorted(each, np.arange(len(holds))) + len(each) * np.arange(len(heights))[:, None]
        over = self.scene.positions[each] + heights[:, None, None] * self.scene.normals[each]
        poses = np.hstack([np.tile(spun.reshape(-1, 9), (len(heights), 1)), over.reshape(-1, 3)])
        each, turn = np.tile(each, len(heights)), np.tile(turn, len(heights))
        first = [FREE_LIMB] * len(climber.limbs) if start is None else list(start.contacts)
        contacts, turned = self.places_of(first).tolist(), list[tuple[int, int, Array]]()
        for limb, k in enumerate(first):
            if start is not None and k >= 0 and fixes[limb]:
                contacts[limb] = len(each) + len(turned)
                turned.append((limb, k, place(held_pose(climber, self.scene, limb, k, start.q))))
        if turned:
            limbs, rows, held = zip(*turned, strict=True)
            poses, each = np.vstack([poses, held]), np.append(each, rows)
            levels, turn = np.append(levels, self._level[list(limbs)]), np.append(turn, np.ones(len(rows), dtype=int))
        self._levels = levels
        return np.ascontiguousarray(poses), each.astype(np.int32), turn > 0, tuple(contacts)

    def _shapes_of_cones(self, turned: NDArray[np.bool_], share: float) -> tuple[Any, NDArray[np.int32]]:
        """Each cone once, and which of them each limb has at each place, -1 where it may not hold."""
        limbs, holds = self.climber.limbs, self.scene.footholds
        table = np.full((len(limbs), len(holds)), FREE_LIMB, dtype=np.int32)
        frictions = np.array([float(hold.friction) for hold in holds])
        self._slack_cones: list[SlackCone] = []
        for limb, one in enumerate(limbs):
            able = np.array([not hold.limbs or one.name in hold.limbs for hold in holds], dtype=bool)
            lower = np.minimum(float(getattr(one.contact, "friction", np.inf)), frictions)
            for friction in dict.fromkeys(lower[able].tolist()):
                table[limb, able & (lower == friction)] = len(self._slack_cones)
                self._slack_cones.append(SlackCone.of(one.contact.lower(friction, share, share**2)))
        numbers = (_ConeStruct * max(1, len(self._slack_cones)))()
        self._cone_arrays = []
        for row, cone in zip(numbers, self._slack_cones, strict=False):
            arrays = [np.ascontiguousarray(a) for a in (cone.N, cone.A, cone.b / self.weight, cone.s)]
            self._cone_arrays.append(arrays)
            row.forces, row.rows = cone.N.shape[1], len(cone.b)
            row.N, row.A, row.b, row.s = (a.ctypes.data for a in arrays)
        table = table[:, self.hold]
        for limb in range(len(limbs)):
            table[limb, self._levels != self._level[limb]] = FREE_LIMB
            if self.climber.fixed(limb) != "pose":
                table[limb, turned] = FREE_LIMB
        return numbers, np.ascontiguousarray(table)

    def _bodies(self, spare: float, apart: float) -> tuple[Any, list[str], list[Any], Array, NDArray[np.int32]]:
        """Pieces of the robot with their links' names, all shapes, poses of the bodies, and pairs of pieces."""
        robot = _pieces_of(self.climber, self.margin)
        links, shapes = robot.links, list(robot.shapes)
        pieces = (_PieceStruct * max(1, len(links)))()
        for k, (limb, step, sunk, at) in enumerate(robot.places):
            pieces[k] = _PieceStruct(limb, step, k, int(sunk is not None), 0.0 if sunk is None else sunk - spare, at)
        bodies = list(self.scene.bodies.values())
        shapes += [body.shape for body in bodies]
        poses = np.array([place(_centre(body)) for body in bodies]).reshape(-1, 12)
        return pieces, links, shapes, poses, robot.pairs[robot.apart <= apart].astype(np.int32)

    def _at_rest(self) -> Array:
        """Contact poses at rest in the body's frame ``(limbs, 12)``."""
        climber = self.climber
        body = climber.body_pose(climber.rest)
        poses = [body.actInv(climber.contact_pose(climber.rest, limb)) for limb in range(len(climber.limbs))]
        return np.ascontiguousarray([place(pose) for pose in poses])


class _Pieces(NamedTuple):
    """Shapes of a climber on its limbs.

    Attributes:
        links: of each shape. shapes: all. table: of these. pairs: of shapes that may touch ``(n, 2)``.
        apart: how far those pairs are apart that never move relative to each other, -inf: they do ``(n)`` [m].
        places: limb and its step (-1, -1: the body), how deep the tip of a limb may be in what it holds [m], None:
            it is no tip; the pose there, twelve numbers.
    """

    links: list[str]
    shapes: list[Any]
    table: ShapeTable
    pairs: NDArray[np.intp]
    apart: Array
    places: list[tuple[int, int, float | None, tuple[float, ...]]]


@functools.lru_cache(maxsize=16)
def _pieces_of(climber: Climber, margin: float) -> _Pieces:
    """Those of a climber, made once."""
    model, limbs = climber.robot.model, limb_table(climber, margin)
    data = model.createData()
    pin.framesForwardKinematics(model, data, climber.rest)
    last_step = {
        joint: (limb, steps - 1)
        for limb, chain in enumerate(climber.chains)
        for joint, steps in zip(chain, limbs.steps_to[limb], strict=True)
    }
    depths = {tip.body.name: tip.sink + SINK for tips in sunk_tips(climber) for tip in tips}
    links, shapes, places = list[str](), list[Any](), list[tuple[int, int, float | None, tuple[float, ...]]]()
    rows: dict[str, list[int]] = {}
    for body in climber_bodies(climber):
        frame = frame_index(model, body.link)
        parent = int(model.frames[frame].parentJoint)
        on = next((int(j) for j in reversed(list(model.supports[parent])) if int(j) in last_step), 1)
        at = data.oMi[on].actInv(data.oMf[frame]) * _centre(body)
        rows.setdefault(body.link, []).append(len(links))
        places.append((*last_step.get(on, (-1, -1)), depths.get(body.name), tuple(place(at))))
        links.append(body.link if body.link in climber.robot.shapes else body.name)
        shapes.append(body.shape)
    chosen = climber.robot.self_pairs or ()
    pairs = [(a, b) for one, other in chosen for a in rows.get(one, ()) for b in rows.get(other, ())]
    both = np.array(pairs, dtype=np.intp).reshape(-1, 2)
    on_step = np.array([at[:2] for at in places]).reshape(-1, 2)
    poses = np.array([at[3] for at in places]).reshape(-1, 12)
    still = (on_step[both[:, 0]] == on_step[both[:, 1]]).all(axis=1)
    table, apart = ShapeTable(shapes), np.full(len(both), -np.inf)
    apart[still] = distances(table, poses, *both[still].T)[:, 0]
    return _Pieces(links, shapes, table, both, apart, places)


def held_pose(climber: Climber, scene: ClimbScene, limb: int, foothold: int, q: Array) -> pin.SE3:
    """Pose of a limb's contact frame at a foothold; that of limbs that fix their turn is turned as they are."""
    given = climber.limbs[limb].contact.held_at(scene.footholds[max(foothold, 0)].pose)
    if foothold < 0 or climber.fixed(limb) != "pose":
        return given
    about = pin.log3(given.rotation.T @ climber.contact_pose(q, limb).rotation)[2]
    return given * pin.SE3(pin.utils.rotate("z", float(about)), np.zeros(3))


def _centre(placed: PlacedShape | SweptBody | SceneBody) -> pin.SE3:
    pose = placed.placement or pin.SE3.Identity()
    return pose * pin.SE3(np.eye(3), np.asarray(placed.shape.center, dtype=np.float64))
