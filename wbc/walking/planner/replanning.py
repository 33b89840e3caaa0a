"""Plans that are made while the walk goes on, slice by slice: a first one to begin with, the rest between ticks."""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Iterator, Mapping
from dataclasses import replace
from itertools import combinations, product
from typing import Any, Protocol

import numpy as np

from wbc.errors import ShapeError
from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.arms.puma import limb_of
from wbc.walking.body_path import BodyPath, straight_path
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.grips.conflicts import LimbShapes
from wbc.walking.planner.grips.table import Grips, Ints, grip_slices
from wbc.walking.planner.objective import Objective
from wbc.walking.planner.plan import NoPlanError, Plan
from wbc.walking.planner.planner import plan_slices
from wbc.walking.planner.proof import EVERY, clear_scene
from wbc.walking.planner.slices import Allowance
from wbc.walking.planner.stances.body import BodySearch
from wbc.walking.planner.starts import Beginning, holding_of, stances
from wbc.walking.planner.swings.curve import Pivots, between
from wbc.walking.planner.swings.joints import blend
from wbc.walking.planner.swings.law import SwingLaw, least_time_law
from wbc.walking.planner.swings.swings import FINE

#: Yields None or, first, a plan to begin with; returns the whole one
PlanSlices = Generator[Plan | None, None, Plan]
#: (plan, row of a free arm, law of its hand, row of an arm -> row of its hold, configuration) -> it touches nothing
MayBring = Callable[[Plan, int, SwingLaw, Mapping[int, int], Array], bool]
#: A new plan begins with a body that stands for so many samples
STANDING = 10
#: How far the body goes back to where a hand may be lifted [m]
BACK = (0.05, 0.1, 0.2, 0.4)
#: Slices of work on plans from there, all together
WORK = 2000.0
#: Part of what an arm has left to its limits, or to other arms, that a plan from there leaves
PART = 0.9
#: How far it goes towards a hold instead, at the height that it has [m], and how fast [m/s]
TOWARDS, ASIDE = (0.15, 0.3), 0.05


class HandsThere(Protocol):
    """Where all hands are in the structure, when it is asked: their origins [m] and z axes, ``[arms, 3]`` each."""

    @property
    def origins(self) -> Array: ...

    @property
    def axes(self) -> Array: ...


def plan_from_stance(
    walker: Walker,
    structure: Structure,
    path: BodyPath,
    start: Mapping[str, str],
    *,
    postures: Mapping[str, Array] | None = None,
    objective: Objective = "velocity",
) -> PlanSlices:
    """A plan for a body that stands at the beginning of a path, all its hands on holds.

    The first plan that is yielded, after some milliseconds, moves no hand: the body may go :data:`HEAD` seconds of path
    time as far as its hands reach. From there on hands are moved in the plan that is returned.

    Args:
        start, postures: as of :func:`wbc.walking.planner.planner.plan_walk`; ``start`` has every arm.

    Raises:
        as ``plan_walk``, also where no plan leads to the end.
    """
    beginning: Beginning = start, postures or {}, {}
    rows = [structure.index(start[arm.name]) for arm in walker.arms]
    grips = yield from grip_slices(walker, structure, path, rows, holding_of(walker, structure, beginning))
    search = BodySearch(walker, structure, path, grips)
    stance = stances(walker, structure, search, beginning)[0]
    # The plan that follows keeps the branches
    here = {arm.name: grips.posture_at(grip, 0) for arm, grip in zip(walker.arms, stance, strict=True)}
    beginning = start, here, {}
    yield None
    until = search.until(stance, 0)
    # The plan needs a stance that goes on behind it
    head = min(round(walker.margins.head / path.spacing), max(until - 1, 0))
    yield _standing(path, grips, tuple(start[arm.name] for arm in walker.arms), stance, head)
    plan = yield from plan_slices(walker, structure, path, beginning, objective=objective, sample=head, soon=True)
    return _complete(structure, plan)


def plan_rest(
    walker: Walker, structure: Structure, plan: Plan, kept: int, here: float, objective: Objective = "velocity"
) -> PlanSlices:
    """A plan along the same path that keeps the first re-grasps and makes the others anew.

    The first plan that is yielded has the kept ones alone.

    Args:
        plan: whose grips know which holds are gone. kept: so many re-grasps. here: path time of the body [s].

    Raises:
        NoPlanError: there is none.
    """
    grips, path = plan.grips, plan.path
    assert grips is not None
    landed = round(plan.regrasps[kept - 1].land / path.spacing) if kept else 0
    names = [arm.name for arm in walker.arms]
    stance = tuple(grips[-1] for grips in plan.cut(names, kept, 0.0).chain)
    search, soonest = (
        BodySearch(walker, structure, path, grips),
        max(landed, round((here + walker.margins.onward) / path.spacing)),
    )
    # The plan needs a stance that goes on behind it
    sample = max(min(soonest, search.until(stance, landed) - 1), landed)
    begun = plan.cut(names, kept, sample * path.spacing)
    yield begun
    rest = yield from plan_slices(
        walker, structure, path, objective=objective, grips=grips, stance=stance, sample=sample, soon=True
    )
    return begun.then(_complete(structure, rest))


def plan_from_here(
    walker: Walker,
    structure: Structure,
    path: BodyPath,
    held: Mapping[int, int],
    q: Array,
    hands: HandsThere,
    behind: Array,
    may: MayBring | None = None,
) -> PlanSlices:
    """A plan along a path that begins where the body stands. If there is none, the body first goes back where it came
    from, by :data:`BACK`, or towards one of its holds, by :data:`TOWARDS`, and returns: a hand at the edge of its reach
    cannot be lifted there.

    Args:
        held: row of the arm -> row of the hold, of hands that hold. q: configuration. hands: where they are.
        behind: poses that the body had, the last ones first ``[n, 4, 4]``.
        may: whether a free hand may go to where a plan begins; None: wherever it can.

    Raises:
        NoPlanError: there is none.
    """
    here = np.repeat(path.poses[:1], STANDING, axis=0)
    walker = _as_it_holds(walker, path.poses[0], held, q, hands)
    refused: NoPlanError | None = None
    work = Allowance(WORK)
    for there in _asides(path.poses[0], behind, structure.positions[list(held.values())]):
        other = BodyPath(np.concatenate([here, there, there[::-1], path.poses]), path.spacing)
        sample = STANDING + len(there) if len(there) else 0
        try:
            plan = yield from _from_here(walker, structure, other, held, q, hands, sample, may, work)
            return plan
        except NoPlanError as error:
            refused = refused or error
        if work.spent:
            break
    assert refused is not None
    raise refused


def _as_it_holds(walker: Walker, pose: Array, held: Collection[int], q: Array, hands: HandsThere) -> Walker:
    """The walker with margins that its holding arms keep where they are: where a body was stopped they may be nearer to
    a limit, or to each other, than plans let them.

    Args:
        pose: of the body ``[4, 4]``.
    """
    limb, margins, shapes = limb_of(walker), walker.margins, LimbShapes(walker)
    angle, reach, apart = margins.held_angle, margins.held_reach, margins.held_clearance
    free = len(limb.position_limits) - 1
    for arm in held:
        frame = pose @ walker.arms[arm].base.homogeneous
        place, axis = (hands.origins[arm] - frame[:3, 3]) @ frame[:3, :3], hands.axes[arm] @ frame[:3, :3]
        reach = min(reach, PART * float(limb.wrist_reach(limb.wrist_of(place[None], axis[None]))[0]))
        angle = min(angle, PART * float(np.delete(limb.margins(q[walker.arms[arm].q]), free).min()))
    for one, other in combinations(held, 2):
        a, b = (shapes.points(arm, q[walker.arms[arm].q])[None] for arm in (one, other))
        apart = min(apart, PART * (float(shapes.between(a, b)[0]) + margins.held_clearance))
    less = {"held_angle": max(angle, 0.0), "held_reach": max(reach, 0.0), "held_clearance": max(apart, 0.0)}
    return walker if replace(margins, **less) == margins else replace(walker, margins=replace(margins, **less))


def _asides(pose: Array, behind: Array, holds: Array) -> Iterator[Array]:
    """Where the body may go first, poses ``[n, 4, 4]``; nowhere to begin with."""
    yield behind[:0]
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(behind[:, :3, 3], axis=0), axis=1))])
    for back in BACK:
        if back < length[-1]:
            yield behind[: int(np.searchsorted(length, back)) + 1]
    for far, hold in product(TOWARDS, holds):
        offset = hold - pose[:3, 3]
        offset -= pose[:3, 2] * (pose[:3, 2] @ offset)
        end = pose.copy()
        end[:3, 3] += far * offset / max(float(np.linalg.norm(offset)), 1e-9)
        yield straight_path([pose, end], ASIDE).poses


def _from_here(
    walker: Walker,
    structure: Structure,
    path: BodyPath,
    held: Mapping[int, int],
    q: Array,
    hands: HandsThere,
    sample: int,
    may: MayBring | None,
    work: Allowance,
) -> PlanSlices:
    """Along one path, with free hands where they can be brought to."""
    arms, avoid = walker.arms, dict[str, set[str]]()
    start = {arms[arm].name: structure.ids[hold] for arm, hold in held.items()}
    postures = {arms[arm].name: q[arms[arm].q] for arm in held}
    free = [arm for arm in range(len(arms)) if arm not in held]
    grips = yield from grip_slices(
        walker, structure, path, holding=holding_of(walker, structure, (start, postures, {}))
    )
    while True:
        beginning: Beginning = start, postures, avoid
        more: dict[str, Any] = {"grips": grips, "sample": sample, "allowance": work}
        asked = plan_slices(walker, structure, path, beginning, objective="destination", **more)
        plan = _complete(structure, (yield from asked))
        far = list[int]()
        for arm in free:
            law = way_to(walker, structure, plan, arm, hands, q, held)
            if not law.possible or (may is not None and not may(plan, arm, law, held, q)):
                far.append(arm)
        if not far:
            return plan
        for arm in far:
            avoid.setdefault(arms[arm].name, set()).add(plan.start[arm])
            there = grips.arm == arm
            if {structure.ids[k] for k in np.unique(grips.hold[there & (grips.first == 0)])} <= avoid[arms[arm].name]:
                reason = "the hand cannot be brought from where it is in the air to any hold that it reaches"
                raise NoPlanError("plan", arms[arm].name, reason, separating=avoid[arms[arm].name])


def way_to(
    walker: Walker,
    structure: Structure,
    plan: Plan,
    arm: int,
    hands: HandsThere,
    q: Array,
    held: Collection[int],
) -> SwingLaw:
    """From where a free hand is to where the plan has it at the beginning; the body stands there.

    Args:
        held: rows of the arms whose hands hold; of the others those before this one have been brought.
    """
    grips, guided = plan.grips, limb_of(walker).guided
    if grips is None:
        raise ShapeError("plan", plan, "expected a plan of the planner for a body with arms")
    grip, mine = plan.chain[arm][0], q[walker.arms[arm].q]
    turn = grips.posture_at(grip, 0)[:1] - mine[:1]
    pivots = Pivots((plan.path.poses[0] @ walker.arms[arm].base.homogeneous)[None], turn)
    hold = structure.index(plan.start[arm])
    places, axes = (
        (now[arm][None], there[[hold]])
        for now, there in ((hands.origins, structure.positions), (hands.axes, structure.axes))
    )
    curve = between(walker, structure, places, axes, np.array([[True, False]]), pivots)
    first, last = np.array(mine[guided:]), grips.posture_at(grip, 0)[guided:]
    bent = first + blend(np.linspace(0.0, 1.0, FINE))[None, :, None] * (last - first)
    near = _from_where_it_is(walker, mine)
    law = least_time_law(near, arm, plan.path, curve, np.zeros(FINE), lambda _: bent, 1.0)
    if not law.possible:
        return law
    limb, base = limb_of(walker), plan.path.poses[0] @ walker.arms[arm].base.homogeneous
    times = np.arange(0.0, law.duration + EVERY, EVERY)
    way, part = law.along(times)
    guide = first + part[:, None] * (last - first)
    angles, _ = limb.follow(np.repeat(base[None, None], len(times), axis=1), way[None], guide[None], near.margins)
    postures, holds = list[Array](), list[Ints]()
    for k, other in enumerate(walker.arms):
        # Hands that are free as well are brought there one after the other, from where they are
        now = grips.posture_at(plan.chain[k][0], 0) if k < arm and k not in held else q[other.q]
        postures.append(angles[0] if k == arm else np.repeat(now[None], len(times), axis=0))
        holds.append(np.array([structure.index(plan.start[k])]))
    # Hands that have just left a hold may be near to what that is mounted on, also where the hold is gone since
    near_by = np.linalg.norm(structure.positions - hands.origins[arm], axis=1).argmin()
    holds[arm] = np.append(holds[arm], near_by)
    poses = np.repeat(plan.path.poses[:1], len(times), axis=0)
    left = {k: np.array(hands.origins[k]) for k in range(arm, len(walker.arms)) if k not in held}
    law.possible = clear_scene(walker, structure).touched(times, poses, postures, holds, left) is None
    return law


def _from_where_it_is(walker: Walker, posture: Array) -> Walker:
    """The walker with margins of swings that the posture of a hand in the air keeps: it may be nearer to a limit."""
    left = PART * max(float(limb_of(walker).margins(posture[None])[0].min()), 0.0)
    margins = walker.margins
    if left >= max(margins.swing_elbow, margins.swing_angle):
        return walker
    angle, elbow = min(margins.swing_angle, left), min(margins.swing_elbow, left)
    return replace(walker, margins=replace(margins, swing_angle=angle, swing_elbow=elbow, swing_reach=0.0))


def _standing(path: BodyPath, grips: Grips, start: tuple[str, ...], stance: tuple[int, ...], sample: int) -> Plan:
    """A plan without re-grasps up to a sample."""
    reached = sample * path.spacing
    return Plan(path, start, (), False, reached, "being planned", grips, tuple((grip,) for grip in stance))


def _complete(structure: Structure, plan: Plan) -> Plan:
    if not plan.complete:
        raise NoPlanError("plan", structure.name, plan.reason)
    return plan
