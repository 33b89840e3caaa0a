"""The free-gait planner: from a structure and a body path to a plan."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from wbc import validation
from wbc.multibody import pin
from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.arms.puma import limb_of
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.around import NONE_MET, Around, around
from wbc.walking.planner.detours.beside import ROUTE, Search, plan_beside
from wbc.walking.planner.fewest import fewer_slices
from wbc.walking.planner.grips.table import Grips, grip_slices
from wbc.walking.planner.objective import Objective
from wbc.walking.planner.plan import NoPlanError, Plan, Regrasp
from wbc.walking.planner.slices import Allowance, Slices, counted, drained
from wbc.walking.planner.slower import SLOWER, check_stance, plan_slower
from wbc.walking.planner.sound import sound_slices
from wbc.walking.planner.stances.body import BodySearch
from wbc.walking.planner.stances.nodes import Found
from wbc.walking.planner.starts import ALL_STARTS, NOTHING, STARTS, Beginning, holding_of, stance_slices
from wbc.walking.planner.swings.law import SwingLaw

#: Delays of one swing that velocity mode allows one after the other [s]
DELAYS = (0.0, 0.25, 0.5, 1.0, 2.0, float("inf"))
SOON = (0.0, 0.25, float("inf"))
#: Where all searches fail, the one with any delay is made again, so many times as wide
WIDER = 5


def plan_walk(
    walker: Walker,
    structure: Structure,
    path: BodyPath,
    *,
    start: Mapping[str, str] | None = None,
    postures: Mapping[str, Array] | None = None,
    avoid: Mapping[str, Collection[str]] | None = None,
    objective: Objective = "velocity",
    width: int | None = 16,
    time_budget: float | None = None,
    partial: bool = False,
    detour: bool = False,
) -> Plan:
    """Which hands to move where so that the body can follow a path.

    Velocity: of the plans that delay no swing by more than 0, else 0.25, 0.5, ... s, one with the fewest re-grasps.
    Destination: the fewest re-grasps, however much the body slows down.

    Args:
        start: arm name -> hold id of the hands that hold at the beginning; default: the planner chooses.
        postures: arm name -> its joints now [rad]: a hand that holds keeps the branch of its wrist.
        avoid: arm name -> holds that it does not begin on.
        width: stances stored for each number of re-grasps; None: all, which finds the fewest.
        time_budget: [s]; after it what is found is returned or refused.
        partial: return a plan that does not lead to the end instead of refusing.
        detour: where the body cannot follow the path, go slower where only joints are too slow for it, else look for
            a detour: lower, turned, beside it, see :mod:`wbc.walking.planner.detours`; the plan's path says what was
            found.

    Raises:
        UnknownNameError: another arm, hold or objective. ShapeError: a walker that is no body with PUMA arms.
        NoPlanError: there is no plan, with where it ends, holds and limits.
    """
    beginning = start or {}, postures or {}, avoid or {}
    _check_ends(walker, structure, path)
    deadline = None if time_budget is None else time.perf_counter() + time_budget
    search = functools.partial(
        plan_slices, walker, structure, width=width, deadline=deadline, thorough=time_budget is None
    )
    # Where a detour is looked for, the widest searches come last
    narrow = [(delay, width) for delay in (DELAYS if objective == "velocity" else DELAYS[-1:])] if detour else ()

    def begin(way: BodyPath, wide: int | None, work: Allowance | None) -> Plan:
        tries = [(DELAYS[-1], wide)]
        return drained(search(way, beginning, objective="destination", tries=tries, allowance=work))

    def go_on(begun: Plan, kept: int, wide: int | None, work: Allowance | None) -> Plan:
        return drained(rest_of(walker, search, begun, kept, tries=[(DELAYS[-1], wide)], allowance=work))

    plan, refused = None, None
    try:
        plan = drained(search(path, beginning, objective=objective, tries=narrow))
        if plan.complete or (partial and not detour):
            return plan
    except NoPlanError as error:
        refused = error
    try:
        check_stance(walker, structure, path.poses[0], "beginning", beginning)
        check_stance(walker, structure, path.poses[-1], "end")
    except NoPlanError as error:
        if plan is None or not partial:
            raise
        return replace(plan, reason=f"{error}; {plan.reason}", separating=error.separating)
    # Where it can stand at the beginning and yet no stance lasts, something soon ends all of them
    joint = "a joint" if plan is None else plan.too_slow
    late = deadline is not None and time.perf_counter() > deadline
    slower = None if late or not joint else plan_slower(path, joint, lambda way: begin(way, width, Allowance(ROUTE)))
    if slower is not None and detour:
        return slower
    if plan is None:
        assert refused is not None
        reason = f"the body can stand at its beginning, but not go on, not even {max(SLOWER)} times slower: {refused}"
        raise NoPlanError("plan", structure.name, reason, separating=refused.separating)
    if detour:
        plan = plan_beside(walker, structure, path, plan, Search(begin, go_on, width, deadline))
    if not plan.complete and not partial:
        reason = f"{plan.reason}; {slower.note}" if slower is not None else plan.reason
        raise NoPlanError("plan", structure.name, reason, separating=plan.separating)
    return plan


def _check_ends(walker: Walker, structure: Structure, path: BodyPath) -> None:
    """Refuse a path whose first or last pose has the body, or what stands still on it, in something's way."""
    there, ends = around(walker, structure), path.poses[[0, -1]]
    for where, pose, met in zip(("beginning", "end"), ends, there.bodies(ends).tolist(), strict=True):
        if met != NONE_MET:
            reason = f"at its {where} the body is nearer than {1e3 * there.of_body:.0f} mm to {there.names[met]}"
            hold = _clear_over(there, pose)
            raise NoPlanError("path", structure.name, f"{reason}; {hold}" if hold else reason)


def _clear_over(there: Around, pose: Array) -> str:
    """Over which hold the body would be clear, the nearest one in the same attitude and height; "" for none."""
    places, axes = there.structure.positions, there.structure.axes
    order = np.argsort(np.linalg.norm(places - pose[:3, 3], axis=1), kind="stable")
    height = float((places[order[0]] - pose[:3, 3]) @ pose[:3, 2])
    poses = np.repeat(pose[None], len(order), axis=0)
    poses[:, :3, 3] = places[order] - height * axes[order]
    for k, axis in enumerate(axes[order]):
        poses[k, :3, :3] = pin.Quaternion.FromTwoVectors(pose[:3, 2], axis).toRotationMatrix() @ pose[:3, :3]
    clear = np.flatnonzero(there.bodies(poses) == NONE_MET)
    if not len(clear):
        return ""
    k = int(clear[np.argmin(np.linalg.norm(poses[clear, :3, 3] - pose[:3, 3], axis=1))])
    far = float(np.linalg.norm(poses[k, :3, 3] - pose[:3, 3]))
    return f"over {there.structure.ids[order[k]]}, {far:.2f} m from there, it is clear"


def plan_slices(
    walker: Walker,
    structure: Structure,
    path: BodyPath,
    beginning: Beginning = NOTHING,
    *,
    objective: Objective = "velocity",
    width: int | None = 16,
    deadline: float | None = None,
    grips: Grips | None = None,
    stance: tuple[int, ...] | None = None,
    sample: int = 0,
    soon: bool = False,
    thorough: bool = False,
    tries: Sequence[tuple[float, int | None]] = (),
    first: tuple[int, int] | None = None,
    allowance: Allowance | None = None,
) -> Slices[Plan]:
    """The best plan along one path, complete or not, in slices of some milliseconds of work; the same every time.

    Args:
        beginning: start, postures and avoid of :func:`plan_walk`. deadline: of ``time.perf_counter``.
        grips: of the path, if they are known. stance: grips that hold at the sample, instead of a beginning.
        sample: of the path, from which on hands may be lifted.
        soon: somebody waits: fewer delays are tried (:data:`SOON`).
        thorough: to a destination, begin on more holds, let hands wait in the air for as long as it takes, and look for
            fewer re-grasps than were found (:mod:`wbc.walking.planner.fewest`).
        tries: delays and widths of the searches, one after the other, instead of what objective and width say.
        first: row of an arm and of a hold: the first re-grasp, whether it is needed or not.
        allowance: work that the searches may take.

    Raises:
        as :func:`plan_walk`, where no stance is possible at the beginning.
    """
    validation.one_of("objective", objective, ("velocity", "destination"))
    limb_of(walker)
    if grips is None:
        grips = yield from grip_slices(walker, structure, path, holding=holding_of(walker, structure, beginning))
    best: tuple[Found, tuple[SwingLaw, ...]] | None = None
    delays: tuple[float, ...] = DELAYS[-1:] if objective == "destination" else SOON if soon else DELAYS
    usual: list[tuple[float, int | None]] = [(delay, width) for delay in delays]
    if width is not None:
        usual.append((delays[-1], WIDER * width))
    search: BodySearch | None = None
    thorough = thorough and objective == "destination"
    most = ALL_STARTS if thorough else STARTS
    for delay, wide in tries or usual:
        more = {"longest_delay": delay, "width": wide, "first": first, "allowance": allowance}
        search = BodySearch(walker, structure, path, grips, known=search, patient=thorough, **more)
        starts = [stance] if stance else (yield from stance_slices(walker, structure, search, beginning, sample, most))
        yield None
        found, laws = yield from counted(sound_slices(search, starts, sample, deadline), allowance)
        if best is None or (found.complete, found.reached) > (best[0].complete, best[0].reached):
            best = found, laws
        if found.complete or (deadline is not None and time.perf_counter() > deadline):
            break
        if allowance is not None and allowance.spent:
            break
    assert best is not None
    if thorough and search is not None and best[0].complete and not (stance or first):
        best = (yield from fewer_slices(search, beginning, best[0], sample)) or best
    return plan_found(walker, structure, path, grips, *best)


def rest_of(walker: Walker, search: Callable[..., Slices[Plan]], plan: Plan, kept: int, **more: Any) -> Slices[Plan]:
    """A plan that keeps the first re-grasps of one, the others searched for anew.

    Args:
        search, more: :func:`plan_slices`, and what it is given.
    """
    begun = plan.cut([arm.name for arm in walker.arms], kept, 0.0)
    stance, sample = tuple(grips[-1] for grips in begun.chain), round(begun.regrasps[-1].land / plan.path.spacing)
    more |= {"grips": plan.grips, "stance": stance, "sample": sample}
    rest = yield from search(plan.path, objective="destination", **more)
    return begun.then(rest)


def _roll(structure: Structure, grips: Grips, grip: int) -> float | None:
    """Which of the allowed rolls a grip has [rad]; None where the hand may roll."""
    rolls = structure.holds[grips.hold[grip]].rolls
    return rolls[grips.roll[grip]] if rolls else None


def plan_found(
    walker: Walker, structure: Structure, path: BodyPath, grips: Grips, found: Found, laws: tuple[SwingLaw, ...]
) -> Plan:
    """The plan of what a search found, and of the laws of its moves."""
    ids, spacing = structure.ids, path.spacing
    steps, chain = [], [[g] for g in found.start]
    for move in found.moves:
        chain[move.arm].append(move.target)
        steps.append(
            Regrasp(
                walker.arms[move.arm].name,
                ids[grips.hold[move.source]],
                ids[grips.hold[move.target]],
                int(grips.branch[move.target]),
                round(move.lift * spacing, 9),
                round(move.land * spacing, 9),
                round(move.duration, 6),
                round(move.delay, 6),
                round(float(grips.last[move.source] - move.lift) * spacing, 9),
                grips.reasons[grips.ends[move.target]],
                round(float(grips.last[move.target]) * spacing, 9),
                move.curve,
                _roll(structure, grips, move.target),
            )
        )
    reason, separating, limits = "", list[str](), list[str]()
    if not found.complete:
        limits = [grips.reasons[grips.ends[g]] for g in found.blocking]
        causes = [
            f"{walker.arms[grips.arm[g]].name} on {ids[grips.hold[g]]}: {grips.reasons[grips.ends[g]]}"
            for g in found.blocking
        ] or ["arms in each other's way"]
        reason = (
            f"no hand can be moved in time after {found.reached * spacing:.2f} s of {path.duration:.2f} s "
            f"({'; '.join(causes)})"
        )
        separating = sorted(ids[grips.hold[grip[-1]]] for grip in chain)
    start = tuple(ids[grips.hold[g]] for g in found.start)
    used = tuple(map(tuple, chain))
    reached = found.reached * spacing
    plan = Plan(path, start, tuple(steps), found.complete, reached, reason, grips, used, tuple(separating), laws)
    return replace(plan, limits=tuple(limits))
