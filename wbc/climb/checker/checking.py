"""The check of a climb: time, joints, contacts and what was asked of the body; then clearances and cones."""

from __future__ import annotations

import numpy as np

from wbc.climb.checker.clearances import check_clearances
from wbc.climb.checker.cones import check_cones
from wbc.climb.checker.record import OPEN, Climbed
from wbc.climb.checker.report import CheckRules, ClimbReport, RuleTally
from wbc.climb.climber import Climber
from wbc.climb.scene import ClimbScene
from wbc.errors import RangeError
from wbc.log import Log
from wbc.multibody import pin

#: Relative change of a period that is rounding
ROUNDING = 1e-6
#: Time over which rates of the body are means [s]
MEAN = 0.1
#: By how much such a mean may be above what was asked [m/s]
FASTER = 0.01
#: The same of the turn rate [rad/s]: 1 deg/s
TURNS_FASTER = float(np.deg2rad(1.0))
#: Rounding of times [s]
INSTANT = 1e-9


def check(log: Log, climber: Climber, scene: ClimbScene, rules: CheckRules | None = None) -> ClimbReport:
    """Whether a climb is one that robot and scene allow: everything is computed anew from t, q and contacts.

    Joints are within their limits of position, and of rate and acceleration as means over ``rules.window``; closed
    contacts are at footholds that their limbs may hold, one each, that have not vanished, and still; the body goes as
    it was asked to; links keep clear of bodies and of each other at every tick (by Coal) and between them
    (:mod:`wbc.climb.checker.clearances`); and the contacts can bear the robot (:mod:`wbc.climb.checker.cones`), or do
    as logged.

    Args:
        log: of :class:`wbc.climb.loop.ClimbLoop`. climber: the robot. scene: what it climbed. rules: default:
            ``CheckRules()``.

    Raises:
        ShapeError: a log of another robot or scene. RangeError: one whose digest is another's.
    """
    digest = log.meta.get("robot_digest", climber.robot.fingerprint)
    if digest != climber.robot.fingerprint:
        raise RangeError(
            "log", log.meta.get("robot"), f"it is of another robot than {climber.robot.name} as it is given"
        )
    rules, climbed, tally = rules or CheckRules(), Climbed.of(log, climber, scene), RuleTally()
    _check_time(climbed, float(log.meta.get("period", np.median(np.diff(climbed.t)))), tally)
    _check_joints(climbed, rules, tally)
    _check_contacts(climbed, rules, tally)
    _check_presence(climbed, tally)
    _check_body(climbed, rules, tally)
    check_clearances(climbed, rules, tally)
    check_cones(climbed, rules, tally)
    return tally.report()


def _check_time(climbed: Climbed, period: float, tally: RuleTally) -> None:
    tally.declare("step of time", ROUNDING, "of the period")
    steps = np.diff(climbed.t)
    tally.add("step of time", np.abs(steps / period - 1.0), climbed.t[1:], "clock")


def _check_joints(climbed: Climbed, rules: CheckRules, tally: RuleTally) -> None:
    robot = climbed.climber.robot
    limits, names, index = robot.limits, robot.dof_names, robot.position_index
    tally.declare("joint beyond its limit", rules.position, "m or rad")
    tally.declare("joint's rate", 1.0 + rules.rate, "of its limit")
    tally.declare("joint's acceleration", 1.0 + rules.acceleration, "of its limit")
    stride = max(1, round(rules.window / float(np.median(np.diff(climbed.t)))))
    t, model = climbed.t[::stride], robot.model
    means = np.array([pin.difference(model, x, y) for x, y in zip(climbed.q[::stride], climbed.q[stride::stride],
                                                                  strict=False)])  # fmt: skip
    steps = np.diff(t)[:, None]
    rates = means.reshape(-1, robot.nv) / steps
    # The first mean has none before it: a climb begins at rest, its plant settles
    changes = np.diff(rates, axis=0) / steps[1:]
    for dof, name in enumerate(names):
        if dof >= robot.base_nv and index[dof] >= 0:
            angle = climbed.q[:, int(index[dof])]
            beyond = np.maximum(limits.position_lower[dof] - angle, angle - limits.position_upper[dof])
            tally.add("joint beyond its limit", beyond, climbed.t, name)
        for rule, values, limit in (("joint's rate", rates, limits.velocity[dof]),
                                    ("joint's acceleration", changes, limits.acceleration[dof])):  # fmt: skip
            if np.isfinite(limit) and limit > 0.0:
                tally.add(rule, np.abs(values[:, dof]) / limit, t[len(t) - len(values) :], name)


def _check_contacts(climbed: Climbed, rules: CheckRules, tally: RuleTally) -> None:
    tally.declare("closed contact off its foothold", rules.hold_distance, "m")
    tally.declare("closed contact turned", rules.hold_angle, "rad")
    slips = {True: "closed grip slips", False: "closed contact slips"}
    for pulls in sorted({limb.contact.pulls for limb in climbed.climber.limbs}):
        tally.declare(slips[pulls], rules.grip_slip if pulls else rules.slip, "m")
    tally.declare("foothold that is another's", 0.0, "limbs")
    places, turns = climbed.tips
    for k, limb in enumerate(climbed.climber.limbs):
        for first, last, row in climbed.stretches(k):
            if row == OPEN:
                continue
            foothold, t = climbed.scene.footholds[row], climbed.t[first:last]
            where = f"{limb.name} on {foothold.id}"
            off = np.linalg.norm(places[first:last, k] - limb.contact.held_at(foothold.pose).translation, axis=1)
            tally.add("closed contact off its foothold", off, t, where)
            moved = np.linalg.norm(places[first:last, k] - places[first, k], axis=1)
            # A grip that closes draws itself to its foothold: that is no slip
            tally.add(slips[limb.contact.pulls], moved - np.maximum(off[0] - off, 0.0), t, where)
            turned = turns[first:last, k]
            if limb.contact.fixed != "position":
                across = np.linalg.norm(np.cross(turned[:, :, 2], foothold.pose.rotation[:, 2]), axis=1)
                tilt = np.arctan2(across, turned[:, :, 2] @ foothold.pose.rotation[:, 2])
                tally.add("closed contact turned", tilt, t, where)
            if limb.contact.fixed == "pose":
                trace = np.einsum("nij,ij->n", turned, turned[0])
                tally.add("closed contact turned", np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0)), t, where)
            wrong = float(bool(foothold.limbs) and limb.name not in foothold.limbs)
            tally.add("foothold that is another's", np.array([wrong]), t[:1], where)
    for k, contacts in enumerate(climbed.contacts):
        closed = contacts[contacts != OPEN]
        shared = len(closed) - len(np.unique(closed))
        tally.add("foothold that is another's", np.array([float(shared)]), climbed.t[k : k + 1], "two limbs on one")


def _check_body(climbed: Climbed, rules: CheckRules, tally: RuleTally) -> None:
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


def _check_presence(climbed: Climbed, tally: RuleTally) -> None:
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
