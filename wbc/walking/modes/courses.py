"""Another path for a body that moves: it begins as the present one, with the hands and swings that there are."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from math import ceil, inf

import numpy as np

from wbc.robots import Walker, WalkerData
from wbc.validation import Array
from wbc.walking.arms.puma import limb_of
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.loop.state import Swinging
from wbc.walking.loop.walk import Walk
from wbc.walking.planner.grips.table import Grips, Holding, grip_slices
from wbc.walking.planner.plan import NoPlanError, Plan, Regrasp
from wbc.walking.planner.planner import plan_slices
from wbc.walking.planner.stances.body import BodySearch
from wbc.walking.planner.swings.law import SwingLaw
from wbc.walking.planner.swings.swings import SETTLE

#: A new path begins so many samples behind the body, so that grips that are about to end are no shorter than grips are
TAIL = 5
#: Delays [s] and widths of the searches: what they do not find is looked for on another path
TRIES = ((0.0, 16), (0.5, 16), (inf, 16))


@dataclass(frozen=True, eq=False)
class Course:
    """What of a walk goes on while another path is planned.

    Attributes:
        begins: path time of the present plan at which the new path begins, and splice: until which both agree [s].
        since: number of the present plan's re-grasp that comes next.
        kept: re-grasps of the present plan that are lifted before the splice, by the path time of the new one.
        laws: of ``kept``.
        hands: for each arm the grips of the present plan that it has, or swings to, and then those of ``kept``.
        sample: of the new path, at which the first of each arm's grips holds.
        swings: row of the arm that is swinging, -1 for none.
    """

    begins: float
    splice: float
    since: int
    kept: tuple[Regrasp, ...]
    laws: tuple[SwingLaw, ...]
    hands: tuple[tuple[int, ...], ...]
    sample: tuple[int, ...]
    swings: int


def course(walk: Walk, lead: float, lifts: bool = True) -> Course:
    """What goes on in a walk on the next ``lead`` seconds of its path, as far as its plan leads.

    Args:
        lifts: whether hands are lifted meanwhile.
    """
    plan, spacing, u = walk.plan, walk.plan.path.spacing, walk.path_time
    end = plan.path.duration if plan.complete else plan.reached
    # On a sample; but a body that stands has a path of its own from where it is
    splice = max(min(ceil((u + lead) / spacing - 1e-9), int(end / spacing + 1e-9)) * spacing, u) if walk.pace else u
    begins = splice - int((splice - max(u - TAIL * spacing, 0.0)) / spacing + 1e-9) * spacing
    here = max(int((u - begins) / spacing + 1e-9), 0)
    sample, swinging, since = [here] * len(walk.walker.arms), walk.swinging, walk.progress.next
    if swinging is not None:
        since += int(swinging.counted)
        sample[swinging.arm] = ceil((u - begins + time_left(swinging, walk.hands.data)) / spacing)
    steps = []
    for step in plan.regrasps[since:]:
        if not lifts or step.lift >= splice:
            break
        steps.append(step)
    kept = tuple(replace(s, lift=s.lift - begins, land=s.land - begins, until=s.until - begins) for s in steps)
    hands = []
    for arm, chain in zip(walk.walker.arms, plan.chain, strict=True):
        before = sum(step.arm == arm.name for step in plan.regrasps[:since])
        more = sum(step.arm == arm.name for step in steps)
        hands.append(tuple(chain[before : before + more + 1]))
    laws, swings = plan.laws[since : since + len(kept)], -1 if swinging is None else swinging.arm
    return Course(begins, splice, since, kept, laws, tuple(hands), tuple(sample), swings)


def course_slices(
    walker: Walker, structure: Structure, now: Plan, begun: Course, path: BodyPath, quick: bool
) -> Generator[Plan | None, None, Plan]:
    """A plan along a path that begins with a course, complete or not.

    Args:
        now: the plan of which the course is. quick: yield, after some milliseconds, a plan that lifts no hand, with
            which the body goes over to the new path; hands are lifted
            :attr:`wbc.robots.Margins.onward` later.

    Raises:
        NoPlanError: a hand cannot be where it is, or is to come down.
    """
    old, names = now.grips, [arm.name for arm in walker.arms]
    assert old is not None
    shift, splice = (round(u / path.spacing) for u in (begun.begins, begun.splice - begun.begins))
    lands = [[at] for at in begun.sample]
    for step in begun.kept:
        lands[names.index(step.arm)].append(round(step.land / path.spacing))
    sample, holding = max([splice, *(samples[-1] for samples in lands)]), _holding(old, begun, lands, shift)
    if quick:
        rows = [int(old.hold[grips[-1]]) for grips in begun.hands]
        few = yield from grip_slices(walker, structure, path, rows, holding)
        chain = _chain(walker, structure, old, few, begun, lands, shift)
        search = BodySearch(walker, structure, path, few)
        until = search.until([grips[-1] for grips in chain], max(samples[-1] for samples in lands))
        # The plan needs a stance that goes on behind it
        sample = max(min(sample + round(walker.margins.onward / path.spacing), until - 1), sample)
        start = tuple(structure.ids[few.hold[grips[0]]] for grips in chain)
        yield Plan(path, start, (), False, sample * path.spacing, "being planned", few, chain)
    grips = yield from grip_slices(walker, structure, path, holding=holding)
    chain = _chain(walker, structure, old, grips, begun, lands, shift)
    stance = tuple(grips[-1] for grips in chain)
    rest = yield from plan_slices(walker, structure, path, grips=grips, stance=stance, sample=sample, tries=TRIES)
    start = tuple(structure.ids[grips.hold[mine[0]]] for mine in chain)
    return Plan(path, start, begun.kept, False, rest.reached, rest.reason, grips, chain, (), begun.laws).then(rest)


def _holding(old: Grips, begun: Course, lands: Sequence[Sequence[int]], shift: int) -> Holding:
    """The hands of a course, for another table of grips."""
    return {
        (arm, int(old.hold[grip])): (at, float(old.posture_at(grip, at + shift)[-1]))
        for arm, (hands, samples) in enumerate(zip(begun.hands, lands, strict=True))
        for grip, at in zip(hands, samples, strict=True)
    }


def _chain(
    walker: Walker,
    structure: Structure,
    old: Grips,
    new: Grips,
    begun: Course,
    lands: Sequence[Sequence[int]],
    shift: int,
) -> tuple[tuple[int, ...], ...]:
    """The grips of a course in another table, at the samples at which they begin to be held."""
    out = []
    for arm, (hands, samples) in enumerate(zip(begun.hands, lands, strict=True)):
        found = [same_grip(old, grip, new, at, shift) for grip, at in zip(hands, samples, strict=True)]
        # The first one is held already, but by a hand that swings to it
        landing = range(0 if arm == begun.swings else 1, len(found))
        fits = [grip >= 0 and (k not in landing or bent(walker, new, grip, samples[k])) for k, grip in enumerate(found)]
        if not all(fits):
            hold = structure.ids[old.hold[hands[fits.index(False)]]]
            raise NoPlanError("course", hold, "the hand that is there, or swings there, cannot hold it on the new path")
        out.append(tuple(found))
    return tuple(out)


def bent(walker: Walker, grips: Grips, grip: int, sample: int) -> bool:
    """Whether the elbow is bent, and the wrist, as planned hands land, at a sample of the path."""
    limb, margins, posture = limb_of(walker), walker.margins, grips.posture_at(grip, sample)
    elbow, wrist = float(limb.elbow_bend(posture)), float(limb.wrist_bend(posture))
    return elbow >= margins.landing_elbow and wrist >= margins.landing_wrist


def time_left(swinging: Swinging, data: WalkerData) -> float:
    """Until a swinging hand holds [s]."""
    return swinging.law.duration - swinging.clock + data.latch_time + SETTLE


def same_grip(old: Grips, grip: int, new: Grips, sample: int, shift: int) -> int:
    """The grip of another table that is the same at a sample of its path; -1 for none.

    Args:
        shift: by how many samples the old path is ahead of the new one.
    """
    mine = new.of_arm(int(old.arm[grip]))
    mine = mine[(new.hold[mine] == old.hold[grip]) & (new.branch[mine] == old.branch[grip])]
    mine = mine[(new.roll[mine] == old.roll[grip]) & (new.first[mine] <= sample) & (sample <= new.last[mine])]
    if not len(mine):
        return -1
    wrist: Array = new.posture(mine, np.full(len(mine), sample))[:, 5] - old.posture_at(grip, sample + shift)[5]
    # Of a fixed roll there may be two, a turn of joint 6 apart
    return int(mine[np.abs(wrist).argmin()])
