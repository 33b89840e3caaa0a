"""Checks of time, joints and twist: what needs no hands."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from wbc.validation import Array
from wbc.walking.checker.holds import rotations, turns_between
from wbc.walking.checker.report import Tally
from wbc.walking.checker.rules import Rules
from wbc.walking.checker.samples import Samples
from wbc.walking.checker.urdf import Urdf
from wbc.walking.log.log import WalkLog

#: A step of time below this [s] is none
LEAST_STEP = 1e-12
HARD = "joint acceleration / limit"
#: A body that is driven may take so long to slow down, or to take up a turn's end [s]
SLOWING = 1.0
FAST, SPIN_FAST = "body's speed beyond what was asked", "body's turn rate beyond what was asked"
JUMP, SPIN_JUMP = "jump of the body's velocity", "jump of the body's turn rate"


def declare(tally: Tally, rules: Rules) -> None:
    """The checks of this module."""
    tally.declare("time increases", LEAST_STEP, "s", least=True)
    tally.declare("time step is dt", 1e-9, "s")
    tally.declare("joint beyond its limit", rules.position, "rad")
    tally.declare("joint rate / limit", 1.0 + rules.rate)
    tally.declare("joint step rate / limit", 1.0 + rules.rate)
    tally.declare("joint step less rate x dt", rules.rounding, "rad")
    tally.declare(HARD, 1.0 + rules.acceleration)
    tally.declare("twist speed", rules.twist_speed, "m/s")
    tally.declare("twist turn rate", rules.twist_rate, "rad/s")
    tally.declare(FAST, rules.asked_speed, "m/s")
    tally.declare(SPIN_FAST, rules.asked_rate, "rad/s")
    tally.declare(JUMP, rules.jump_speed, "m/s")
    tally.declare(SPIN_JUMP, rules.jump_rate, "rad/s")


def check_time(log: WalkLog, tally: Tally) -> None:
    """t increases strictly, by dt each tick."""
    steps = np.diff(log.t)
    tally.add("time increases", steps, log.t[1:], lambda k: f"tick {k + 1}")
    tally.add("time step is dt", np.abs(steps - log.dt), log.t[1:], lambda k: f"tick {k + 1}")


def check_rates(log: WalkLog, urdf: Urdf, tally: Tally) -> None:
    """|v| and |q[k + 1] - q[k]| / (t[k + 1] - t[k]) within the URDF's rates, and q[k + 1] = q[k] + v[k] dt."""
    limits = np.array([urdf.joint(name).velocity for name in log.joints])
    steps, gaps = np.diff(log.q, axis=0), np.diff(log.t)[:, None]

    def where(tick: int, joint: int) -> str:
        return log.joints[joint]

    tally.add("joint rate / limit", np.abs(log.v) / limits, log.t, where)
    with np.errstate(divide="ignore", invalid="ignore"):
        # Where time stands still a joint that moves has no rate
        ratios = np.where(steps == 0.0, 0.0, np.abs(steps) / np.maximum(gaps, 0.0)) / limits
    tally.add("joint step rate / limit", ratios, log.t, where)
    tally.add("joint step less rate x dt", np.abs(steps - log.v[:-1] * gaps), log.t, where)


def check_accelerations(log: WalkLog, rules: Rules, tally: Tally) -> None:
    """|v[k] - v[k - 1]| / dt within the limits of the rules, from rest on and to rest at the end."""
    names = [name for name in log.joints if name in rules.accelerations]
    if not names:
        return
    rates = log.v[:, [log.joints.index(name) for name in names]]
    limits = np.array([rules.accelerations[name] for name in names])
    changes = np.abs(np.diff(rates, axis=0, prepend=0.0 * rates[:1])) / log.dt
    tally.add(HARD, changes / limits, log.t, lambda _, joint: names[joint])


def check_positions(samples: Samples, log: WalkLog, urdf: Urdf, tally: Tally) -> None:
    """Joints within the URDF's limits at all samples."""
    joints = [urdf.joint(name) for name in log.joints]
    lower, upper = np.array([joint.lower for joint in joints]), np.array([joint.upper for joint in joints])
    beyond = np.maximum(lower - samples.q, samples.q - upper)
    tally.add("joint beyond its limit", beyond, samples.t, lambda _, joint: log.joints[joint])


def check_twist(log: WalkLog, rules: Rules, tally: Tally) -> None:
    """Means over a window of the body's motion against what was asked for, and of the logged twist against that."""
    rotation, position = rotations(log.pose_body_in_structure[:, 3:]), log.pose_body_in_structure[:, :3]
    window = min(max(round(rules.twist_window / log.dt), 1), len(log) - 1)
    gaps = np.diff(log.t)[:, None]

    def sums(part: slice) -> Array:
        steps = (rotation[:-1] @ log.twist_body[:-1, part, None])[..., 0] * gaps
        total = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        return np.asarray(total[window:] - total[:-window])

    span = np.maximum(log.t[window:] - log.t[:-window], 1e-12)
    moved = position[window:] - position[:-window]
    if (asked := _asked(log, window)) is not None:
        speed, turn_rate, about_z = asked
        before, after = rotation[:-window], rotation[window:]
        turned = turns_between(before, after)
        if about_z:
            step = np.swapaxes(before, 1, 2) @ after
            turned = np.abs(np.arctan2(step[:, 1, 0] - step[:, 0, 1], step[:, 0, 0] + step[:, 1, 1]))
        tally.add(FAST, np.linalg.norm(moved, axis=1) / span - speed, log.t, lambda _: "body")
        tally.add(SPIN_FAST, turned / span - turn_rate, log.t, lambda _: "body")
    tally.add("twist speed", np.linalg.norm(sums(slice(0, 3)) - moved, axis=1) / span, log.t, lambda _: "body")
    # exp(sum of w dt) R[k] against R[k + w]: to second order in the turn, which is small within a window
    turn, angle = sums(slice(3, 6)), np.linalg.norm(sums(slice(3, 6)), axis=1)
    axis = turn / np.maximum(angle, 1e-300)[:, None]
    half = np.concatenate([axis * np.sin(angle / 2)[:, None], np.cos(angle / 2)[:, None]], axis=1)
    off = turns_between(rotations(half) @ rotation[:-window], rotation[window:])
    tally.add("twist turn rate", off / span, log.t, lambda _: "body")


def _asked(log: WalkLog, window: int) -> tuple[Array | float, Array | float, bool] | None:
    """Largest speed [m/s] and turn rate [rad/s] that were asked for, and whether the turn is that about z alone: by a
    path's request, or by the commands in each window and :data:`SLOWING` before it. None: by nothing.
    """
    request = log.meta.get("request")
    if not isinstance(request, Mapping) or request.get("plan"):
        return None
    if request.get("kind") == "path":
        return request["speed"], request["turn_rate"], False
    if request.get("kind") != "drive":
        return None
    rates = np.stack([np.linalg.norm(log.command[:, part], axis=1) for part in (slice(0, 3), slice(3, 6))])
    lag = round(SLOWING / log.dt)
    most = sliding_window_view(np.pad(rates, ((0, 0), (lag, 0))), lag + window + 1, axis=1).max(axis=2)
    return most[0], most[1], True


def check_jumps(log: WalkLog, tally: Tally) -> None:
    """|v[k] - v[k - 1]| and |w[k] - w[k - 1]| of the body, out of its logged poses, from rest on."""
    rotation, position = rotations(log.pose_body_in_structure[:, 3:]), log.pose_body_in_structure[:, :3]
    gaps = np.maximum(np.diff(log.t), LEAST_STEP)[:, None]
    turn = rotation[1:] @ np.swapaxes(rotation[:-1], 1, 2)
    skew = np.stack(
        [turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1]], axis=1
    )
    angle = np.arctan2(np.linalg.norm(skew, axis=1), np.trace(turn, axis1=1, axis2=2) - 1.0)[:, None]
    # Of a turn by no angle that can be told from 0, half of the skew part is the turn
    length = np.linalg.norm(skew, axis=1, keepdims=True)
    spin = skew * np.where(length > 1e-12, angle / np.maximum(length, 1e-12), 0.5)
    for kind, moved in ((JUMP, np.diff(position, axis=0)), (SPIN_JUMP, spin)):
        rate = moved / gaps
        steps = np.linalg.norm(np.diff(rate, axis=0, prepend=0.0 * rate[:1]), axis=1)
        tally.add(kind, steps, log.t, lambda _: "body")
