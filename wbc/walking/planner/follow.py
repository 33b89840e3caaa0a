"""A plan of a file made again: the same hands go to the same holds at the same points of the path."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc import validation
from wbc.errors import ShapeError
from wbc.robots import Walker
from wbc.walking.arms.puma import limb_of
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.eased import eased_law
from wbc.walking.planner.grips.table import Grips, Ints, find_grips
from wbc.walking.planner.plan import NoPlanError, Plan, Regrasp
from wbc.walking.planner.planner import plan_found
from wbc.walking.planner.proof import Proof
from wbc.walking.planner.stances.body import BodySearch
from wbc.walking.planner.stances.nodes import Found
from wbc.walking.planner.swings.law import SwingLaw, law_of
from wbc.walking.planner.swings.move import Move, Swing


def follow_plan(walker: Walker, structure: Structure, asked: Plan) -> Plan:
    """The re-grasps of a plan, with the grips and laws that a walk needs: nothing is searched for.

    Every re-grasp is looked at as the planner does: the grips last, the arms are clear of each other and of the
    structure, provably at every instant, and the swing takes no longer than the plan says.

    Args:
        asked: as of :func:`wbc.walking.planner.plan.read_plan`.

    Raises:
        UnknownNameError: an arm or a hold that is not there. ShapeError: a machine without the walker's arms, or a plan
            without a hold for each. NoPlanError: a re-grasp that is not possible here, and why.
    """
    names = [arm.name for arm in walker.arms]
    limb_of(walker)
    if len(asked.start) != len(names):
        raise ShapeError("plan.start", asked.start, f"expected holds for the {len(names)} arms of a body with arms")
    for step in asked.regrasps:
        validation.one_of("plan.arm", step.arm, names)
        structure.index(step.target)
    path = asked.path
    grips = find_grips(walker, structure, path)
    search = BodySearch(walker, structure, path, grips)
    key = [_first(structure, search, asked, arm, name) for arm, name in enumerate(names)]
    if len({int(grips.hold[g]) for g in key}) < len(key) or search.until(key, 0) <= 0:
        raise NoPlanError("plan.start", " ".join(asked.start), "the hands cannot hold them together")
    start, sample, moves, laws = tuple(key), 0, list[Move](), list[SwingLaw]()
    proof = Proof(search.swings)
    for k, step in enumerate(asked.regrasps):
        move = _move(structure, search, step, k, names.index(step.arm), key)
        law = _law(structure, search, step, k, move, key, sample)
        touched = proof.of_stance(key, sample, move.lift) or proof.of_swing(move, law, key)
        if touched:
            raise _refused(step, k, str(touched))
        laws.append(law)
        moves.append(move)
        key[move.arm], sample = move.target, move.land
    found = search.shortened(Found(start, tuple(moves), False, 0, 0, ()), len(moves))
    if touched := proof.of_stance(key, sample, found.reached):
        raise NoPlanError("plan", structure.name, str(touched))
    plan = plan_found(walker, structure, path, grips, found, tuple(laws))
    if not plan.complete:
        raise NoPlanError("plan", structure.name, plan.reason, separating=plan.separating)
    return plan


def _first(structure: Structure, search: BodySearch, asked: Plan, arm: int, name: str) -> int:
    """The grip of an arm at the beginning; of several the one that lasts as long as the plan says."""
    grips, spacing = search.grips, search.path.spacing
    row = structure.index(asked.start[arm])
    mine = grips.of_arm(arm)
    mine = mine[(grips.first[mine] == 0) & (grips.hold[mine] == row)]
    if not len(mine):
        raise NoPlanError(f"plan.start.{name}", asked.start[arm], "the arm cannot hold it at the beginning of the path")
    ends = [step.lift + step.margin for step in asked.regrasps if step.arm == name]
    return _lasting(grips, mine, round(ends[0] / spacing) if ends else len(search.path) - 1)


def _move(structure: Structure, search: BodySearch, step: Regrasp, k: int, arm: int, key: Sequence[int]) -> Move:
    """A re-grasp over the grips that there are."""
    grips, spacing = search.grips, search.path.spacing
    lift, land, row = round(step.lift / spacing), round(step.land / spacing), structure.index(step.target)
    if structure.ids[grips.hold[key[arm]]] != step.source:
        raise _refused(step, k, f"the hand is on {structure.ids[grips.hold[key[arm]]]}")
    rolls = structure.holds[row].rolls
    roll = -1 if not rolls or step.roll is None else int(np.abs(np.array(rolls) - step.roll).argmin())
    mine = grips.of_arm(arm)
    mine = mine[(grips.hold[mine] == row) & (grips.branch[mine] == step.branch) & (grips.roll[mine] == roll)]
    mine = mine[(grips.first[mine] <= land) & (land <= grips.last[mine])]
    if not len(mine):
        raise _refused(step, k, f"the arm cannot hold it at {step.land:g} s of the path")
    target = _lasting(grips, mine, round(step.until / spacing))
    return Move(arm, key[arm], target, lift, land, step.duration, step.delay, step.curve)


def _law(
    structure: Structure, search: BodySearch, step: Regrasp, k: int, move: Move, key: Sequence[int], sample: int
) -> SwingLaw:
    """The law of a move, which was looked at as the planner looks at its own."""
    grips, spacing = search.grips, search.path.spacing
    others = tuple(g for arm, g in enumerate(key) if arm != move.arm)
    if grips.hold[move.target] in grips.hold[list(others)]:
        raise _refused(step, k, "another hand is there")
    if not sample <= move.lift <= min(move.land, int(grips.last[move.source])):
        raise _refused(step, k, f"the hand cannot be lifted at {step.lift:g} s of the path")
    until = search.ends.among(others, sample)
    if move.land > until:
        raise _refused(step, k, f"the other hands hold until {until * spacing:.2f} s of the path")
    if min(search.conflicts.first_conflict(move.target, g, move.land) for g in others) <= move.land:
        raise _refused(step, k, "the arms would come too near to each other where it lands")
    # A hand that waits comes as it lands
    waits = (move.land - move.lift) * spacing > move.duration + spacing
    soonest = move.land if waits else int(search.soonest[move.target])
    swing = Swing(move.arm, move.source, move.target, move.lift, until, others, soonest)
    if not search.swings.clear(swing, move.curve):
        raise _refused(step, k, "the hand's path is out of reach, or too near to another arm or the structure")
    law = law_of(search.swings, move)
    planned = max(move.duration, 0.0 if move.delay else (move.land - move.lift) * spacing)
    late = move.duration - move.delay > (move.land - move.lift) * spacing + 1e-6
    if late or not law.possible or law.duration + search.swings.extra > planned + search.walker.margins.slower:
        raise _refused(step, k, f"the hand cannot be there in {planned:.2f} s")
    return eased_law(search.swings, move, others) or law


def _lasting(grips: Grips, mine: Ints, until: int) -> int:
    """Of some grips the one whose last sample is nearest to one; of equal ones that of the lower branch."""
    return int(min(mine.tolist(), key=lambda g: (abs(int(grips.last[g]) - until), int(grips.branch[g]), g)))


def _refused(step: Regrasp, k: int, reason: str) -> NoPlanError:
    return NoPlanError(
        f"plan.regrasps[{k}]",
        f"{step.arm} {step.source} -> {step.target}",
        reason,
        separating=[step.source, step.target],
    )
