"""Whether a climb is as it was asked for: the body's rates, and footholds only while they were there."""

from __future__ import annotations

import numpy as np

from wbc.climb.checker.record import Climbed
from wbc.climb.checker.report import CheckRules, RuleTally

#: Time over which rates of the body are means [s]
MEAN = 0.1
#: By how much such a mean may be above what was asked [m/s]
FASTER = 0.01
#: The same of the turn rate [rad/s]: 1 deg/s
TURNS_FASTER = float(np.deg2rad(1.0))
#: Rounding of times [s]
INSTANT = 1e-9


def check_body(climbed: Climbed, rules: CheckRules, tally: RuleTally) -> None:
    """Means of the body's speed and turn rate, and jumps of its velocity from tick to tick, from rest on."""
    twists, t = climbed.body, climbed.t
    count = max(1, min(round(MEAN / float(np.median(np.diff(t)))), len(twists)))
    for part, unit, name, most, more, jump in (
        (slice(0, 3), "m/s", "speed", rules.speed, FASTER, rules.jump),
        (slice(3, 6), "rad/s", "turn rate", rules.turn_rate, TURNS_FASTER, rules.jump_turn),
    ):
        sizes = np.linalg.norm(twists[:, part], axis=1)
        if most is not None:
            tally.declare(f"body's {name}", most + more, unit)
            passed = np.concatenate([[0.0], np.cumsum(sizes * np.diff(t))])
            tally.add(
                f"body's {name}", (passed[count:] - passed[:-count]) / (t[count:] - t[:-count]), t[count:], "body"
            )
        if jump is not None:
            tally.declare(f"jump of the body's {name}", jump, unit)
            jumps = np.linalg.norm(np.diff(np.vstack([np.zeros(3), twists[:, part]]), axis=0), axis=1)
            tally.add(f"jump of the body's {name}", jumps, t[1:], "body")


def check_presence(climbed: Climbed, tally: RuleTally) -> None:
    """No limb holds a foothold after it vanished."""
    rule = "held after it vanished"
    if len(climbed.presence):
        tally.declare(rule, INSTANT, "s")
    for row in np.unique(climbed.presence[:, 0]).astype(int).tolist():
        changes = climbed.presence[climbed.presence[:, 0] == row]
        latest = np.searchsorted(changes[:, 1], climbed.t - INSTANT, side="right") - 1
        gone = (latest >= 0) & (changes[latest, 2] == 0.0)
        for k, limb in enumerate(climbed.climber.limbs):
            ticks = gone & (climbed.contacts[:, k] == row)
            since = climbed.t[ticks] - changes[latest[ticks], 1]
            tally.add(rule, since, climbed.t[ticks], f"{limb.name} on {climbed.scene.footholds[row].id}")
