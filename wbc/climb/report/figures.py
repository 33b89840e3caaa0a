"""The figures of a climb: what is printed, and kept in ``figures.json``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wbc.climb.checker import ClimbReport
from wbc.climb.loop import ClimbRun
from wbc.climb.loop.limb_state import LimbState
from wbc.log import Log
from wbc.track.summary import Figure
from wbc.validation import Array

#: Time over which speeds are means [s]
WINDOW = 0.1
#: From rest to full speed [s], left out of the mean speed at both ends of a climb that is longer than six of it
RAMP = 0.5
#: Figures that who writes a climb knows: key -> (label, text of the value)
GIVEN = {
    "robot": ("robot", "{}"),
    "scene": ("scene", "{}"),
    "planning": ("planned in", "{:.3g} s of processor time"),
    "looping": ("ticks in", "{:.3g} s of processor time"),
    "loop_real_time": ("real-time factor of the ticks", "{:.3g}"),
    "real_time": ("real-time factor with planning", "{:.3g}"),
    "note": ("note", "{}"),
}


def climb_figures(run: ClimbRun, report: ClimbReport | None, about: Mapping[str, Any]) -> list[Figure]:
    """The figures of a climb in the order in which they are shown.

    Args:
        report: of its check, None: there was none.
        about: more of them, plain data by key; ``speed`` is that of the body that was asked for [m/s].
    """
    log, told = run.log, f"{run.outcome}{': ' if run.reason else ''}{run.reason}"
    held = {int(row) for row in np.unique(log.array("contact")) if row >= 0}
    steps = sum(state is LimbState.LATCHING for *_, state, _ in run.changes)
    duration = float(log["t"][-1] - log["t"][0])
    out = [
        Figure("outcome", "outcome", str(run.outcome), told + ("" if report is not None else " (not checked)")),
        Figure("reason", "", run.reason, ""),
        Figure("duration", "duration", duration, f"{duration:.2f} s, {len(log) - 1} ticks"),
        Figure(
            "steps", "moves", steps, f"{steps} of limbs, by {len(run.plans)} plan{'s' if len(run.plans) > 1 else ''}"
        ),
        Figure("plans", "", len(run.plans), ""),
        Figure("footholds", "footholds held", len(held), f"{len(held)} of {len(run.scene.footholds)}"),
        *_speed(run, float(about.get("speed") or 0.0)),
        *_joints(run),
    ]
    unkept = int((~log["kept"].astype(bool)).sum())
    out.append(Figure("unsolved", "ticks without a solution", unkept, f"{unkept} of {len(log) - 1}"))
    for key, value in about.items():
        label, text = GIVEN.get(key, ("", "")) if value else ("", "")
        if key != "speed":
            out.append(Figure(key, label, value, text.format(value)))
    return out + _checked(report)


def body_speed(log: Log) -> tuple[Array, Array, Array]:
    """(times [s], speed of the body's origin [m/s], its turn rate [rad/s]), means over :data:`WINDOW`."""
    t, q = log["t"], log.array("q")
    step = min(max(round(WINDOW / float(np.median(np.diff(t)))), 1), len(t) - 1)
    lasts = t[step:] - t[:-step]
    speed = np.linalg.norm(q[step:, :3] - q[:-step, :3], axis=1) / lasts
    # |a - b| and |a + b| of unit quaternions are 2 sin and 2 cos of a quarter of the angle
    first, last = q[:-step, 3:7], q[step:, 3:7]
    chords = np.linalg.norm(last - first, axis=1), np.linalg.norm(last + first, axis=1)
    angle = 4.0 * np.arctan2(np.minimum(*chords), np.maximum(*chords))
    return (t[step:] + t[:-step]) / 2.0, speed, angle / lasts


def rate_shares(run: ClimbRun) -> dict[str, Array]:
    """Joint with a limit of its rate -> rate as a share of it."""
    robot = run.plans[0].climber.robot
    limits = robot.limits.velocity
    return {
        name: np.abs(run.log[f"v.{name}"]) / limits[k]
        for k, name in enumerate(robot.dof_names)
        if k >= robot.base_nv and np.isfinite(limits[k]) and limits[k] > 0.0
    }


def _speed(run: ClimbRun, asked: float) -> list[Figure]:
    if len(run.log) < 3:
        return []
    times, speed, turning = body_speed(run.log)
    t = run.log["t"]
    ramp = RAMP if t[-1] - t[0] > 6.0 * RAMP else 0.0
    full = (times >= t[0] + ramp) & (times <= t[-1] - ramp)
    mean, value = float(speed[full].mean()), dict[str, float]()
    value["mean"], text = mean, f"{mean:.4f} m/s"
    if asked > 0.0:
        value |= {"asked": asked, "kept": mean / asked}
        text += f", {mean / asked:.3f} of the {asked:.4f} m/s that were asked for"
    turn = float(turning[full].mean())
    return [
        Figure("speed", "mean speed of the body", value, text),
        Figure("turn_rate", "its mean turn rate", turn, f"{turn:.4f} rad/s"),
    ]


def _joints(run: ClimbRun) -> list[Figure]:
    largest = {name: float(share.max()) for name, share in rate_shares(run).items()}
    if not largest:
        return []
    name = max(largest, key=largest.__getitem__)
    return [Figure("rate", "largest joint rate", largest[name], f"{largest[name]:.4f} of its limit, {name}")]


def _checked(report: ClimbReport | None) -> list[Figure]:
    if report is None:
        return [Figure("violations", "", None, "")]
    broken = [str(finding) for finding in report.violations]
    kept = f"all {len(report.findings)} rules are kept"
    out = [Figure("violations", "checker", broken, "; ".join(broken) or kept)]
    looked = [finding for finding in report.findings if finding.count]
    worst = {
        finding.rule: {"worst": finding.worst, "limit": finding.limit, "unit": finding.unit, "time": finding.time}
        for finding in looked
        if np.isfinite(finding.worst)
    }
    out.append(Figure("checks", "", worst, ""))
    for finding in looked:
        if finding.least and finding.unit == "m" and np.isfinite(finding.worst):
            text = f"at least {1e3 * finding.worst:.2f} mm at {finding.time:.2f} s, {finding.where}"
            out.append(Figure(finding.rule, finding.rule, finding.worst, text))
    return out
