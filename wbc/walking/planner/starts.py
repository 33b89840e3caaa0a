"""The stances that a plan may begin with."""

from __future__ import annotations

from bisect import insort
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import combinations, product
from typing import Any

import numpy as np

from wbc import validation
from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.around import NONE_MET, around
from wbc.walking.planner.grips.held import held, near_holds
from wbc.walking.planner.grips.table import Grips, Holding, Ints
from wbc.walking.planner.plan import NoPlanError
from wbc.walking.planner.slices import Slices, drained
from wbc.walking.planner.stances.search import PAIRS, StanceSearch

#: Holds that hands begin on, postures that they have, and holds that they must not begin on, by arm
Beginning = tuple[Mapping[str, str], Mapping[str, Array], Mapping[str, Collection[str]]]
NOTHING: Beginning = ({}, {}, {})
#: Where on a path stances are looked for
BEGINNING = "beginning"
#: Grips of an arm that a start may have, and stances that a search begins with; the same of a thorough one
STARTS, ALL_STARTS = (10, 24), (24, 200)
#: Stances of more arms than this are grown arm by arm, from so many that last longest
FEW_ARMS, ENOUGH = 3, 1000
#: Joints of one branch differ by less than this from where they are [rad]; other branches by more
SAME_BRANCH = 0.3


def holding_of(walker: Walker, structure: Structure, beginning: Beginning) -> Holding:
    """The hands that hold at the beginning and whose postures are known, for the table of grips.

    Raises:
        UnknownNameError: another arm or hold.
    """
    start, postures, _ = beginning
    names = [arm.name for arm in walker.arms]
    for name in (*start, *postures):
        validation.one_of("start", name, names)
    known = [name for name in start if name in postures]
    return {(names.index(name), structure.index(start[name])): (0, float(postures[name][-1])) for name in known}


def grips_at_first(
    walker: Walker, structure: Structure, path: BodyPath, grips: Grips, beginning: Beginning, where: str = BEGINNING
) -> list[list[int]]:
    """Of each arm the grips that it may begin with, those that last longest first.

    Raises:
        UnknownNameError: another arm or hold. NoPlanError: an arm has none.
    """
    start, postures, avoid = beginning
    names = [arm.name for arm in walker.arms]
    for name in (*start, *postures, *avoid):
        validation.one_of("start", name, names)
    choices = list[list[int]]()
    for k, name in enumerate(names):
        mine = [int(g) for g in grips.of_arm(k) if grips.first[g] == 0]
        if name in start:
            row = structure.index(start[name])
            mine = [g for g in mine if grips.hold[g] == row]
            if name in postures:
                # Joint 6 counts where the hold fixes the roll
                here, counts = np.array(postures[name]), 5 if structure.free_rolls[row] else 6
                off = [np.abs(grips.posture_at(g, 0) - here)[:counts].max() for g in mine]
                mine = [g for g, gap in zip(mine, off, strict=True) if gap < SAME_BRANCH]
            if not mine:
                raise NoPlanError(
                    f"start.{name}",
                    start[name],
                    f"the arm cannot hold it at the {where} of the path",
                    separating=[start[name]],
                )
        mine = [g for g in mine if structure.ids[grips.hold[g]] not in avoid.get(name, ())]
        mine.sort(key=lambda g: (-int(grips.last[g]), int(grips.hold[g]), int(grips.branch[g])))
        if not mine:
            reason = why_no_grip(walker, structure, path, k, where)
            raise NoPlanError("plan", name, reason, separating=_at_first(structure, grips))
        choices.append(mine)
    few = _too_few(structure, grips, names, choices, where)
    if few:
        raise NoPlanError("plan", structure.name, few, separating=_at_first(structure, grips))
    return choices


def why_no_grip(walker: Walker, structure: Structure, path: BodyPath, arm: int, where: str) -> str:
    """Why an arm has no grip at the first sample of a path."""
    there, margins = around(walker, structure), walker.margins
    frames = path.poses[:1] @ walker.arms[arm].base.homogeneous
    near = near_holds(there.limb, structure, frames)
    found = held(there.limb, structure, frames, near, reach=margins.held_reach, facing=margins.facing)
    rows, branch = np.nonzero(found.within(margins.held_angle))
    met = there.postures(arm, frames[found.pose[rows]], found.q[rows, branch], found.hold[rows])
    if not len(met) or (met == NONE_MET).all():
        return f"no hold is in reach at the {where} of the path"
    name = there.names[int(np.bincount(met[met != NONE_MET]).argmax())]
    return f"{name} is in the way of every hold that it reaches at the {where} of the path"


def _too_few(
    structure: Structure, grips: Grips, names: Sequence[str], choices: Sequence[Sequence[int]], where: str
) -> str:
    """That some hands reach fewer holds than they are; "" where they do not."""
    reached = [{int(grips.hold[g]) for g in mine} for mine in choices]
    for count in range(2, len(names) + 1):
        for some in combinations(range(len(names)), count):
            union = set().union(*(reached[k] for k in some))
            if len(union) < count:
                holds, arms = ", ".join(structure.ids[k] for k in sorted(union)), ", ".join(names[k] for k in some)
                return f"at the {where} of the path the hands of {arms} reach no more holds than {holds}"
    return ""


def stances(
    walker: Walker, structure: Structure, search: StanceSearch[Any], beginning: Beginning, sample: int = 0
) -> list[tuple[int, ...]]:
    """As :func:`stance_slices`, at once."""
    return drained(stance_slices(walker, structure, search, beginning, sample))


def stance_slices(
    walker: Walker,
    structure: Structure,
    search: StanceSearch[Any],
    beginning: Beginning,
    sample: int = 0,
    most: tuple[int, int] = STARTS,
    where: str = BEGINNING,
) -> Slices[list[tuple[int, ...]]]:
    """Grips, one an arm, that hold from the beginning of the path to beyond a sample, those that last longest first.

    Args:
        most: grips of an arm that are looked at, and stances. where: of the path they are, for messages.

    Raises:
        UnknownNameError: another arm or hold. NoPlanError: there are none.
    """
    grips = search.grips
    choices = [mine[: most[0]] for mine in grips_at_first(walker, structure, search.path, grips, beginning, where)]
    pairs = [(a, b) for one, other in combinations(choices, 2) for a, b in product(one, other)]
    for begin in range(0, len(pairs), PAIRS):
        search.conflicts.prepare(pairs[begin : begin + PAIRS])
        yield None
    found = list[tuple[int, tuple[tuple[int, int], ...], tuple[int, ...]]]()
    for stance in _candidates(grips, search, choices, sample):
        # No stance lasts longer than its grips
        if len(found) >= most[1] and min(int(grips.last[g]) for g in stance) < -found[most[1] - 1][0]:
            break
        until = search.until(stance, 0)
        if until > sample:
            insort(found, (-until, search.order(stance), stance))
    if not found:
        raise NoPlanError(
            "plan",
            structure.name,
            _why_no_stance(walker, structure, search, [mine[0] for mine in choices], sample, where),
            separating=_at_first(structure, grips),
        )
    return [stance for _, _, stance in found[: most[1]]]


def _candidates(
    grips: Grips, search: StanceSearch[Any], choices: Sequence[Sequence[int]], sample: int
) -> Iterator[tuple[int, ...]]:
    """Stances on holds of their own, those whose grips last longest first; see :data:`FEW_ARMS`."""
    if len(choices) > FEW_ARMS:
        yield from _lasting_longest(grips, search, choices, sample)
        return

    hold, last = ({g: int(of[g]) for mine in choices for g in mine} for of in (grips.hold, grips.last))
    apart = (stance for stance in product(*choices) if len({hold[g] for g in stance}) == len(stance))
    yield from sorted(apart, key=lambda stance: -min(last[g] for g in stance))


def _lasting_longest(
    grips: Grips, search: StanceSearch[Any], choices: Sequence[Sequence[int]], sample: int
) -> Iterator[tuple[int, ...]]:
    """Stances that last beyond a sample, grown arm by arm from the :data:`ENOUGH` that last longest."""
    mine = [np.array(one, dtype=np.int64) for one in choices]
    until, total = grips.last[mine[0]], np.zeros(len(mine[0]), dtype=np.int64)
    places = np.arange(len(mine[0]))[:, None]
    some = mine[0][:, None]
    for k in range(1, len(mine)):
        each = np.stack([_lasting(grips, search, one, mine[k])[places[:, j]] for j, one in enumerate(mine[:k])])
        least = each.min(axis=0)
        row, column = np.nonzero(least > sample)
        until = np.minimum(until[row], least[row, column])
        total = total[row] + each.sum(axis=0)[row, column]
        places = np.column_stack([places[row], column])
        some = np.stack([one[places[:, j]] for j, one in enumerate(mine[: k + 1])], axis=1)
        # Of those that last as long, the ones whose pairs last longer
        order = np.lexsort([*-some.T[::-1], -total, -until])[:ENOUGH]
        some, places, until, total = some[order], places[order], until[order], total[order]
    yield from map(tuple, some.tolist())


def _lasting(grips: Grips, search: StanceSearch[Any], some: Ints, others: Ints) -> Ints:
    """Last samples that every two grips of two arms hold together from the first on; -1 on one hold ``[n, m]``."""
    out = np.full((len(some), len(others)), -1, dtype=np.int64)
    for i, a in enumerate(some.tolist()):
        for j, b in enumerate(others.tolist()):
            if grips.hold[a] != grips.hold[b]:
                out[i, j] = min(grips.last[a], grips.last[b], search.conflicts.first_conflict(a, b, 0) - 1)
    return out


def _why_no_stance(
    walker: Walker, structure: Structure, search: StanceSearch[Any], stance: Sequence[int], sample: int, where: str
) -> str:
    """Why the stance that would last longest does not last to beyond a sample."""
    grips, spacing = search.grips, search.path.spacing
    names = [f"{arm.name} on {structure.ids[grips.hold[g]]}" for arm, g in zip(walker.arms, stance, strict=True)]
    last = grips.last[list(stance)]
    if last.min() <= sample:
        k = int(last.argmin())
        reason = grips.reasons[grips.ends[stance[k]]]
        return f"no stance lasts long enough to begin with: {names[k]} until {last[k] * spacing:.2f} s ({reason})"
    for (i, a), (j, b) in combinations(enumerate(stance), 2):
        when = search.conflicts.first_conflict(a, b, 0)
        if when <= sample:
            return f"no stance is possible at the {where}: {names[i]} and {names[j]} would come too near to each other"
    return f"no stance is possible at the {where}"


def _at_first(structure: Structure, grips: Grips) -> list[str]:
    """Holds that some arm can hold at the beginning of the path."""
    return [structure.ids[k] for k in np.unique(grips.hold[grips.first == 0])]
