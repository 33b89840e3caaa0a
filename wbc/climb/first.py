"""A first stance near a configuration."""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc.climb.climber import Climber
from wbc.climb.scene import ClimbScene
from wbc.climb.search import StanceOptions, counted, no_stances
from wbc.climb.stance import FREE_LIMB, Stance
from wbc.climb.world import TURNS, ClimbWorld, PostureOutcome
from wbc.validation import Array

#: Footholds that are tried of each limb, nearest first
NEAREST = 6
#: Stances that are tried at most
STANCES = 400
#: Of those in which the robot can stand at most, from which the one is chosen that the most limbs can leave
CHOSEN = 24


def first_stance(climber: Climber, scene: ClimbScene, q: Any, options: StanceOptions | None = None) -> Stance:
    """The stance on the footholds nearest to the limbs in a configuration in which the robot can stand with the margin
    of the options, and from which every limb can lift off, if there is one; limbs without a foothold near stay in the
    air.

    Args:
        q: configuration ``(nq)`` about which it is sought, contacts near their footholds.

    Raises:
        NoStancesError: none of the nearest combinations can be stood on; the best of them, in numbers. What
            ``robot.configuration`` raises.
    """
    given = StanceOptions() if options is None else options
    at = climber.robot.configuration("q", q)
    world = ClimbWorld(climber, scene, None, given.limits, given.clearance, given.apart, friction=given.friction)
    choices: list[list[tuple[float, int]]] = []
    for limb in range(len(climber.limbs)):
        pose = climber.contact_pose(at, limb)
        away = np.linalg.norm(world.places[:, 9:] - pose.translation, axis=1) / world.limbs.numbers[limb].length
        # Of turns about the normal the nearest first
        turned = 1.0 - world.places[:, [0, 3, 6]] @ pose.rotation[:, 0] if climber.fixed(limb) == "pose" else 0.0
        cost = np.where(world.cone_of[limb] >= 0, away + 0.2 * turned, np.inf)
        order = np.argsort(cost, kind="stable")
        holds = list(dict.fromkeys(world.hold[order[: NEAREST * TURNS]].tolist()))[:NEAREST]
        near = [(float(cost[k]), int(k)) for k in order if cost[k] < 1.0 and world.hold[k] in holds]
        choices.append(near or [(1.0, FREE_LIMB)])
    state, best, tried, outcomes = world.state_of(at), -np.inf, 0, Counter[PostureOutcome]()
    stands, least, touching = list[Stance](), 2 * len(choices) + 1, Counter[str]()
    for places in cheapest_first(choices):
        held = [int(world.hold[place]) for place in places if place >= 0]
        if len(set(held)) < len(held):
            continue
        tried += 1
        if tried > STANCES or outcomes[PostureOutcome.STANDS] == CHOSEN:
            break
        contacts = world.contacts(places)
        how, found, slack = world.stand(contacts, contacts, given.margin, state, followed=False)
        outcomes[how] += 1
        if how == PostureOutcome.STANDS and (stuck := _stuck(world, contacts, found, given.margin)) < least:
            rows = tuple(int(world.hold[place]) if place >= 0 else FREE_LIMB for place in places)
            stands, least = [Stance(rows, world.q_of(found))], stuck
            if not stuck:
                break
        best = max(best, slack if how == PostureOutcome.NOT_BORNE else -np.inf)
        if how == PostureOutcome.TOUCHES:
            touching[world.look(contacts, found)[1]] += 1
    if stands:
        return stands[0]
    reason = f"none of {min(tried, STANCES)} stances on the footholds nearest to it can be stood on"
    reason += f" ({counted(outcomes)})" if outcomes else ""
    reason += "".join(f"; most often {names} touch" for names, _ in touching.most_common(1))
    if np.isfinite(best):
        reason += f"; the best lacks {given.margin - best:.3g} of the weight"
    if world.numbers.weightless and not any(limb.contact.pulls for limb in climber.limbs):
        reason += "; nothing weighs, and feet that only press hold it where they press against each other alone"
    raise no_stances("q", at[:3].round(3).tolist(), reason, "start")


def _stuck(world: ClimbWorld, contacts: NDArray[np.int32], state: Array, margin: float) -> int:
    """How many limbs cannot lift off, as links touch, or the others do not bear the robot within reach."""
    others = [np.where(np.arange(len(contacts)) == limb, FREE_LIMB, contacts) for limb in np.flatnonzero(contacts >= 0)]
    lifts = [world.lift(contacts, kept.astype(np.int32), margin, state)[0] for kept in others]
    return world.stuck(contacts, state) + len(lifts) - lifts.count(PostureOutcome.STANDS)


def cheapest_first(choices: list[list[tuple[float, int]]]) -> Iterator[list[int]]:
    """Combinations of one choice a limb, by the sum of their costs; the choices of a limb are sorted."""
    first = (0,) * len(choices)
    waiting, known = [(sum(limb[0][0] for limb in choices), first)], {first}
    while waiting:
        cost, at = heapq.heappop(waiting)
        yield [limb[k][1] for limb, k in zip(choices, at, strict=True)]
        for row, (limb, k) in enumerate(zip(choices, at, strict=True)):
            further = (*at[:row], k + 1, *at[row + 1 :])
            if k + 1 < len(limb) and further not in known:
                known.add(further)
                heapq.heappush(waiting, (cost - limb[k][0] + limb[k + 1][0], further))
