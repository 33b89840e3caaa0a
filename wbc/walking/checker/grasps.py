"""Checks of what hands do: states, holds, how many hold, and how they close."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from wbc.validation import Array
from wbc.walking.checker.report import Tally
from wbc.walking.checker.rules import Rules
from wbc.walking.checker.samples import holding
from wbc.walking.log.log import CLOSED, CLOSING, HAND_STATES, OPEN, OPENING, WalkLog

#: Changes of state from a tick to the next; closed to open only where the hold vanished
ALLOWED = {
    (OPEN, CLOSING),
    (CLOSING, CLOSED),
    (CLOSING, OPEN),
    (CLOSED, OPENING),
    (OPENING, OPEN),
    *((state, state) for state in range(len(HAND_STATES))),
}


def declare(tally: Tally, rules: Rules, log: WalkLog) -> None:
    """The checks of this module."""
    tally.declare("hands that hold", rules.fewest(len(log.arms)), "", least=True)
    tally.declare("body declared fixed", 0.0)
    tally.declare("hand state", 0.0)
    tally.declare("latch time", rules.latch_time - 1.001 * log.dt, "s", least=True)
    tally.declare("shared hold", 0.0)
    tally.declare("hold is there", 0.0)
    tally.declare("closing distance", rules.hold_distance, "m")
    tally.declare("closing angle", rules.hold_angle, "rad")
    tally.declare("closing speed", rules.close_speed, "m/s")
    tally.declare("closing turn rate", rules.close_rate, "rad/s")
    tally.declare("drift", rules.drift_distance, "m")
    tally.declare("drift of the angle", rules.drift_angle, "rad")


def check_counts(log: WalkLog, rules: Rules, tally: Tally) -> None:
    """Enough hands hold at every tick, unless the body is declared fixed, as it may be until they do."""
    count, fewest = holding(log).sum(axis=1), rules.fewest(len(log.arms))
    free = ~log.body_fixed
    tally.add(
        "hands that hold",
        count[free],
        log.t[free],
        lambda k: f"tick {int(np.flatnonzero(free)[k])}",
    )
    # Fixed although it was free before, although enough hands held a tick before, or although it moves
    before = np.concatenate([[False], (np.cumsum(free)[:-1] > 0) | (count[:-1] >= fewest)])
    moves = np.abs(np.diff(log.pose_body_in_structure, axis=0)).max(axis=1) > 1e-9
    bad = log.body_fixed & (before | np.append(moves, False))
    tally.add("body declared fixed", bad, log.t, lambda k: f"tick {k}")


def check_states(log: WalkLog, rules: Rules, tally: Tally) -> None:
    """Hands open and close in order, keep their hold meanwhile, and take the latch time."""
    state, hold = log.hand_state, log.hand_hold
    allowed = np.zeros((len(HAND_STATES),) * 2, dtype=bool)
    allowed[tuple(np.array(sorted(ALLOWED)).T)] = True
    there = log.present(hold, log.t[:, None])
    later_there = log.present(hold[:-1], log.t[1:, None])
    good = allowed[state[:-1], state[1:]] | ((state[1:] == OPEN) & ~later_there)
    kept = (state[:-1] == OPEN) | (state[1:] == OPEN) | (hold[:-1] == hold[1:])
    bad = np.zeros(state.shape, dtype=bool)
    bad[1:] = ~(good & kept)
    bad |= (state != OPEN) & (hold < 0)

    def where(tick: int, arm: int) -> str:
        old = HAND_STATES[state[max(tick - 1, 0), arm]]
        return f"{log.arms[arm]}: {old} to {HAND_STATES[state[tick, arm]]} at {hold_name(log, int(hold[tick, arm]))}"

    tally.add("hand state", bad, log.t, where)
    tally.add(
        "hold is there",
        ((state == CLOSING) | (state == CLOSED)) & (hold >= 0) & ~there,
        log.t,
        lambda tick, arm: f"{log.arms[arm]}: {hold_name(log, int(hold[tick, arm]))} is gone",
    )
    for arm, name in enumerate(log.arms):
        for kind, then in ((CLOSING, CLOSED), (OPENING, OPEN)):
            for first, last in _spans(state[:, arm] == kind):
                # A span that the log begins or ends in, or that the hold's end cuts short, has no length
                if first == 0 or last + 1 == len(log) or state[last + 1, arm] != then:
                    continue
                if not log.present(hold[last, arm], log.t[last + 1]):
                    continue
                took = log.t[last + 1] - log.t[first]
                what = f"{name}: {HAND_STATES[kind]} at {hold_name(log, int(hold[first, arm]))}"
                tally.add("latch time", [took], [log.t[first]], lambda _, what=what: what)


def check_shared(log: WalkLog, tally: Tally) -> None:
    """No two hands on one hold."""
    taken = log.hand_state != OPEN
    for a, b in combinations(range(len(log.arms)), 2):
        both = taken[:, a] & taken[:, b] & (log.hand_hold[:, a] == log.hand_hold[:, b]) & (log.hand_hold[:, a] >= 0)
        pair = f"{log.arms[a]} and {log.arms[b]}"
        tally.add(
            "shared hold", both, log.t, lambda k, pair=pair, a=a: f"{pair}: {hold_name(log, int(log.hand_hold[k, a]))}"
        )


def check_closing(log: WalkLog, distance: Array, angle: Array, speed: Array, rate: Array, tally: Tally) -> None:
    """A closing hand is at its hold and at rest.

    Args:
        distance, angle: off the hold at ticks, [n, a]. speed, rate: of the hand from a tick to the next, [n, a]; of the
            last tick 0.
    """
    closing = (log.hand_state == CLOSING) & (log.hand_hold >= 0)
    ticks, arms = np.nonzero(closing)

    def where(k: int) -> str:
        return f"{log.arms[arms[k]]}: {hold_name(log, log.hand_hold[ticks[k], arms[k]])}"

    tally.add("closing distance", distance[closing], log.t[ticks], where)
    tally.add("closing angle", angle[closing], log.t[ticks], where)
    # The motion before the first tick of closing counts too
    for kind, values in (("closing speed", speed), ("closing turn rate", rate)):
        before = np.concatenate([np.zeros((1, values.shape[1])), values[:-1]])
        begins = closing & ~np.concatenate([np.zeros((1, closing.shape[1]), dtype=bool), closing[:-1]])
        tally.add(kind, np.maximum(values, np.where(begins, before, 0.0))[closing], log.t[ticks], where)


def check_drift(log: WalkLog, distance: Array, angle: Array, tally: Tally) -> None:
    """The offset of a closed hand, [n, a], does not grow again after it was small."""
    for arm, name in enumerate(log.arms):
        for first, last in _spans(holding(log)[:, arm]):
            part, what = slice(first, last + 1), f"{name}: {hold_name(log, log.hand_hold[first, arm])}"
            for kind, values in (("drift", distance), ("drift of the angle", angle)):
                off = values[part, arm]
                tally.add(kind, off - np.minimum.accumulate(off), log.t[part], lambda _, what=what: what)


def hold_name(log: WalkLog, hold: int) -> str:
    """The id of a row of the holds' table."""
    return "no hold" if hold < 0 else f"hold {log.hold_id[hold]}"


def _spans(flags: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """(first, last) of every run of True."""
    edges = np.diff(np.concatenate([[0], flags.astype(np.int8), [0]]))
    for first, end in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
        yield int(first), int(end) - 1
