"""Swings that have time to spare: a jerk-limited law instead of the least-time one, as long as it needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

from wbc.trajectory.jerk.between_states import jerk_limited
from wbc.trajectory.laws.law import Law
from wbc.validation import Array
from wbc.walking.planner.proof import Proof
from wbc.walking.planner.slices import Slices
from wbc.walking.planner.stances.body import BodySearch
from wbc.walking.planner.stances.nodes import Found
from wbc.walking.planner.swings.curve import ALTERNATIVES
from wbc.walking.planner.swings.joints import blend, guide_between
from wbc.walking.planner.swings.law import SwingLaw, rows_over
from wbc.walking.planner.swings.least_time import SwingJoints, swing_joints
from wbc.walking.planner.swings.move import Move
from wbc.walking.planner.swings.swings import FINE, Swings

#: Parts of the time in which it gets up to its speed, and slows down; and those in which its acceleration changes
RAMP, CHANGE = 0.2, 0.06
#: Bounds of a motion from 0 to 1 in the time 1: the fastest law under them takes just as long
SPEED = 1.0 / (1.0 - RAMP)
ACCELERATION = SPEED / (RAMP - CHANGE)
JERK = ACCELERATION / CHANGE
#: Points of the table
POINTS = 401
#: An even law is looked at from so many times the least time on: none was quicker than 1.13 of it
EVEN = 1.1
#: Durations that are tried for one swing, each a little longer than the last one says
TRIES, LONGER = 4, 1.002


class Profile(NamedTuple):
    """The position from 0 to 1, and its first and second derivative, at n times from 0 to 1 ``[n]``.

    Over a duration T the derivatives are to be divided by T and T^2; the third is at most :data:`JERK` / T^3.
    """

    position: Array
    rate: Array
    acceleration: Array


@cache
def profile() -> Profile:
    """At :data:`POINTS` even times; made once."""
    out = profile_at(np.linspace(0.0, 1.0, POINTS))
    for array in out:
        array.flags.writeable = False
    return out


def profile_at(parts: Array) -> Profile:
    """At parts of the time, 0 to 1."""
    law = _law()
    position, rate, acceleration = (np.array(rows)[:, 0] for rows in law.at(law.duration * parts))
    return Profile(np.clip(position, 0.0, 1.0), rate, acceleration)


@cache
def _law() -> Law:
    """The fastest one under the bounds."""
    return jerk_limited([0.0], [1.0], velocity=SPEED, acceleration=ACCELERATION, jerk=JERK)


def eased_law(swings: Swings, move: Move, others: Sequence[int]) -> SwingLaw | None:
    """The jerk-limited law of a planned move, from rest to rest in its time; None where the plan's time is too short,
    the body late, or the arm not clear.

    Args:
        others: grips of the other arms.
    """
    return None if move.delay or move.curve >= len(ALTERNATIVES) else _tried(swings, move, others)[0]


def eased_slices(
    search: BodySearch, found: Found, laws: Sequence[SwingLaw], sample: int, proof: Proof
) -> Slices[tuple[Found, tuple[SwingLaw, ...]]]:
    """What was found, where hands that would wait for the next one to be lifted take this time for a jerk-limited law:
    they land as much later as they need.

    Args:
        sample: of the path, since when the first stance holds. proof: over the same path.
    """
    key, moves, out = list(found.start), list(found.moves), list(laws)
    spare = round(search.walker.margins.spare / search.path.spacing)
    for k, move in enumerate(moves):
        others = tuple(grip for arm, grip in enumerate(key) if arm != move.arm)
        until = moves[k + 1].lift if k + 1 < len(moves) else found.reached
        last = min(until - spare, search.ends.among(others, sample))
        longest = (max(last, move.land) - move.lift) * search.path.spacing - search.swings.extra
        if not move.delay and move.curve < len(ALTERNATIVES) and longest > EVEN * laws[k].fastest:
            yield None
            best = _eased_move(search, move, others, last)
            if best is not None and proof.of_swing(*best, key) is None:
                moves[k], out[k] = best
        key[move.arm], sample = move.target, moves[k].land
    return replace(found, moves=tuple(moves)), tuple(out)


def _eased_move(search: BodySearch, move: Move, others: Sequence[int], last: int) -> tuple[Move, SwingLaw] | None:
    """The move as it is or landed later, but not after ``last``, and its jerk-limited law."""
    extra, spacing = search.swings.extra, search.path.spacing
    for _ in range(TRIES):
        law, needed = _tried(search.swings, move, others)
        if law is not None:
            return move, law
        land = move.lift + int(np.ceil((LONGER * needed + extra) / spacing - 1e-9))
        if needed <= 0.0 or not move.land < land <= last or land > search.latest[move.target]:
            return None
        if not search.lands_at(move.target, land):
            return None
        move = move._replace(land=land)
    return None


def _tried(swings: Swings, move: Move, others: Sequence[int]) -> tuple[SwingLaw | None, float]:
    """The law with the plan's time, and how long it would have to be with the body where it is then [s]; 0 where the
    arm is out of reach or not clear.
    """
    spacing, steady = swings.path.spacing, profile()
    whole = max(move.duration, (move.land - move.lift) * spacing)
    duration = whole - swings.extra
    arms, source, target = np.array([move.arm]), np.array([move.source]), np.array([move.target])
    curve = swings.curve(arms, source, target, np.array([move.lift]), move.curve)
    x = np.linspace(0.0, 1.0, FINE)
    times = duration * np.interp(x, steady.position, np.linspace(0.0, 1.0, POINTS))
    samples = (move.lift + (move.land - move.lift) * (swings.latch + times) / whole)[None]
    guide, places = guide_between(swings.limb, swings.grips, source, target, FINE), curve.at(x)
    bases = swings.shapes.bases[[move.arm]]
    joints = swing_joints(swings.walker, bases, swings.path, places, samples, guide(samples))
    if not joints.possible[0]:
        return None, 0.0
    needed = _least_duration(swings, joints, places[0])
    if needed > duration:
        return None, needed
    if not swings.clear_along(move, others, joints.angles, samples):
        return None, 0.0
    rows = rows_over(duration)
    along = profile_at(rows / duration).position
    return SwingLaw(rows, curve.at(along)[0], blend(along), jerk_limited=True), needed


def _least_duration(swings: Swings, joints: SwingJoints, places: Array) -> float:
    """The least time for the profile under the limits of :func:`wbc.walking.planner.swings.least_time.speeds`, with
    joints over x that change with the body as they do [s].
    """
    steady, margins, x = profile(), swings.margins, np.linspace(0.0, 1.0, FINE)
    first, second, bias = (
        np.stack([np.interp(steady.position, x, row) for row in rows[0].T])
        for rows in (joints.first, joints.second, joints.bias)
    )
    rates, most = (np.array(v)[: len(first), None] for v in (swings.limb.joint_rates, swings.limb.joint_accelerations))
    free = np.maximum(margins.swing_rate * rates - np.sign(first) * bias / swings.path.spacing, 0.1 * rates)
    going = float((np.abs(first) * steady.rate / free).max())
    slope = np.interp(steady.position, x, np.linalg.norm(np.gradient(places, x, axis=0), axis=1))
    turning = np.abs(first * steady.acceleration + second * steady.rate**2) / (margins.swing_acceleration * most)
    return max(going, float((slope * steady.rate).max()) / margins.hand_speed, float(np.sqrt(turning.max())))
