"""The figures of a run: what is printed, and kept in ``summary.json`` and ``summary.txt``."""

from __future__ import annotations

import json
import pathlib
from collections.abc import Callable, Sequence

import numpy as np

from wbc.robots import Walker
from wbc.track.summary import Figure
from wbc.validation import Array
from wbc.walking.checker import Report
from wbc.walking.log.folder import write_whole
from wbc.walking.log.log import CLOSED, OPENING, WalkLog
from wbc.walking.log.ticks import TickColumns
from wbc.walking.planner.eased import JERK
from wbc.walking.planner.plan import Plan
from wbc.walking.planner.swings.law import SwingLaw
from wbc.walking.run.session import WalkRun

#: Time over which speeds are means [s]
WINDOW = 0.1
#: From rest to full speed [s], left out of the mean speed at both ends
RAMP = 0.5
#: Figures of the checker that are shown: kind -> (key, label)
CHECKED = {
    "clearance of links": ("link_clearance", "least clearance of links"),
    "clearance of the structure": ("structure_clearance", "least clearance of the structure"),
    "body position": ("body_by_hands", "body as logged and as the hands give it"),
    "held hand off its hold": ("held_hand", "held hand off its hold"),
}


def figures_of(run: WalkRun, report: Report | None = None) -> list[Figure]:
    """The figures in the order in which they are shown.

    Args:
        report: of the external checker.
    """
    data, structure = run.walker.data, run.structure
    run = run.judged(report)
    told = f"{run.outcome}: {run.reason}" if run.reason else run.outcome
    if report is None and run.log is not None:
        told += " (not checked)"
    out = [
        Figure("outcome", "outcome", run.outcome, told),
        Figure("reason", "", run.reason, ""),
        Figure(
            "robot", "robot", data.digest, f"{run.walker.robot.name} with {len(run.walker.arms)} arms, {data.summary()}"
        ),
        Figure("arms", "", len(run.walker.arms), ""),
        Figure(
            "structure",
            "structure",
            {"name": structure.name, "digest": structure.digest, "holds": len(structure)},
            f"{structure.name}, {len(structure)} holds, {structure.digest[:12]}",
        ),
    ]
    out += _plan(run)
    if run.log is None:
        out += run.more
    if run.log is not None and run.ticks is not None:
        out += _speed(run, run.log)
        out += _errors(run.log, run.ticks)
        out += _machine(run, run.log)
        out += [*run.more, *_times(run, run.log, run.ticks)]
    return out + (_checked(report) if report is not None else [])


def save_figures(figures: Sequence[Figure], folder: pathlib.Path) -> list[pathlib.Path]:
    """Writes ``summary.json``, in SI, and ``summary.txt``, as printed; returns the files.

    Raises:
        WalkLogError: a file cannot be written.
    """
    wide = max(len(figure.label) for figure in figures)
    lines = [f"{figure.label:<{wide}}  {figure.text}" for figure in figures if figure.label]
    values = json.dumps({figure.key: figure.value for figure in figures}, indent=1)
    texts = {"summary.json": values, "summary.txt": "\n".join(lines)}
    return [write_whole(folder / name, _writes(f"{text}\n")) for name, text in texts.items()]


def _writes(text: str) -> Callable[[pathlib.Path], int]:
    return lambda file: file.write_text(text)


def least_time_figure(walker: Walker, plan: Plan) -> Figure:
    """The least time of a whole plan, and what binds longest.

    Raises:
        as :func:`wbc.walking.planner.plan_time.least_plan_time`.
    """
    # toppra is imported for those who ask
    from wbc.walking.planner.plan_time import least_plan_time

    found = least_plan_time(walker, plan)
    name, part = next(iter(found.binding.items()))
    text = f"{found.least:.2f} s ({found.factor:.2f} of the plan; {name} binds {100 * part:.0f} %)"
    value = {"least": found.least, "planned": found.planned, "factor": found.factor, "binding": found.binding}
    return Figure("least_time", "least time by toppra", value, text)


def body_speed(log: WalkLog) -> tuple[Array, Array, Array]:
    """(time [s], speed of the body's origin [m/s], turn rate [rad/s]), means over :data:`WINDOW`."""
    step = min(max(round(WINDOW / log.dt), 1), len(log) - 1)
    pose = log.pose_body_in_structure
    way = np.linalg.norm(pose[step:, :3] - pose[:-step, :3], axis=1)
    # |a - b| and |a + b| of unit quaternions are 2 sin and 2 cos of a quarter of the angle
    first, last = pose[:-step, 3:], pose[step:, 3:]
    chords = np.linalg.norm(last - first, axis=1), np.linalg.norm(last + first, axis=1)
    angle = 4.0 * np.arctan2(np.minimum(*chords), np.maximum(*chords))
    return (log.t[step:] + log.t[:-step]) / 2, way / (step * log.dt), angle / (step * log.dt)


def wrist_angles(run: WalkRun, log: WalkLog) -> Array:
    """theta5 of every arm [rad], NaN while its hand does not hold; [n, a]."""
    column = {name: k for k, name in enumerate(log.joints)}
    angles = np.stack([log.q[:, column[arm.joints[4]]] for arm in run.walker.arms], axis=1)
    return np.where(np.isin(log.hand_state, (CLOSED, OPENING)), angles, np.nan)


def _plan(run: WalkRun) -> list[Figure]:
    plan = run.plan
    if plan is None:
        return []
    text = f"{len(plan.regrasps)} re-grasps, {plan.delay:.2f} s delay, path of {plan.path.duration:.2f} s"
    if not plan.complete:
        text = f"ends after {plan.reached:.2f} s of {plan.path.duration:.2f} s, {len(plan.regrasps)} re-grasps"
    value = {"regrasps": len(plan.regrasps), "delay": plan.delay, "complete": plan.complete, "reached": plan.reached}
    return [
        Figure("plan", "plan", value, text),
        *_eased(plan.laws),
        Figure("plan_time", "planned in", run.plan_time, f"{run.plan_time:.2f} s"),
    ]


def _eased(laws: Sequence[SwingLaw]) -> list[Figure]:
    """How many swings are jerk-limited, and the largest jerk of their laws, in ways per s^3."""
    jerks = [JERK / law.duration**3 for law in laws if law.jerk_limited]
    if not jerks:
        return []
    text = f"{len(jerks)} of {len(laws)}, at most {max(jerks):.1f} of their way per s^3"
    return [Figure("jerk_limited", "jerk-limited swings", {"swings": len(jerks), "jerk": max(jerks)}, text)]


def _speed(run: WalkRun, log: WalkLog) -> list[Figure]:
    time, speed, turning = body_speed(log)
    assert run.plan is not None
    poses = run.plan.path.poses
    way = float(np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).sum())
    full = (time >= log.t[0] + RAMP) & (time <= log.t[-1] - RAMP)
    out = [Figure("duration", "duration", float(log.t[-1]), f"{log.t[-1]:.2f} s, {len(log) - 1} ticks")]
    if not full.any():
        return out
    if way > 1e-6 and run.plan.grips is not None:  # else the path is as it was walked
        asked, mean = way / run.plan.path.duration, float(speed[full].mean())
        text = f"{mean:.4f} m/s ({mean / 0.0254:.2f} in/s), {mean / asked:.3f} of the command"
        out.append(Figure("speed", "mean speed", {"mean": mean, "command": asked, "part": mean / asked}, text))
    mean = float(turning[full].mean())
    out.append(Figure("turn_rate", "mean turn rate", mean, f"{mean:.4f} rad/s"))
    return out


def _errors(log: WalkLog, ticks: TickColumns) -> list[Figure]:
    body, slip = float(ticks.body_error.max()), float(ticks.slip.max())
    unsolved = int((~ticks.solved).sum())
    return [
        Figure("body_error", "body off its command", body, f"at most {1e3 * body:.2f} mm"),
        Figure("slip", "slip of held hands", slip, f"at most {1e3 * slip:.4f} mm"),
        Figure("unsolved", "ticks without a solution", unsolved, f"{unsolved} of {len(ticks.solved)}"),
    ]


def _machine(run: WalkRun, log: WalkLog) -> list[Figure]:
    limits = run.walker.robot.limits
    part = np.abs(log.v) / limits.velocity[6:]
    k = int(part.max(axis=0).argmax())
    out = [Figure("rate", "largest joint rate", float(part.max()), f"{part.max():.6f} of its limit, {log.joints[k]}")]
    angles = np.abs(wrist_angles(run, log))
    least = float(np.where(np.isnan(angles), np.inf, angles).min())
    if np.isfinite(least):  # else no hand held
        out.append(Figure("theta5", "smallest |theta5| held", least, f"{np.degrees(least):.2f} deg"))
    return out


def _times(run: WalkRun, log: WalkLog, ticks: TickColumns) -> list[Figure]:
    median, high = (float(np.percentile(ticks.cost, part)) for part in (50, 99))
    walked, whole = log.t[-1] / run.walk_time, log.t[-1] / (run.walk_time + run.plan_time)
    text = f"{walked:.1f} walking, {whole:.1f} with planning (compiling: {run.compile_time:.2f} s)"
    value = {"walking": walked, "with_planning": whole, "compile_time": run.compile_time}
    return [
        Figure(
            "tick", "controller's tick", {"p50": median, "p99": high}, f"{1e6 * median:.0f} us, p99 {1e6 * high:.0f} us"
        ),
        Figure("real_time_factor", "real-time factor", value, text),
    ]


def _checked(report: Report) -> list[Figure]:
    names = ", ".join(finding.kind for finding in report.violations)
    text = f"all {len(report.findings)} checks hold" if report.ok else f"violated: {names}"
    out = [Figure("checks", "external checker", {"ok": report.ok, "violated": names}, text)]
    for kind, (key, label) in CHECKED.items():
        finding = report[kind]
        if np.isfinite(finding.worst):
            sign = "least" if finding.least else "at most"
            shown = f"{sign} {1e3 * finding.worst:.2f} mm at {finding.time:.2f} s, {finding.where}"
            out.append(Figure(key, label, finding.worst, shown))
    return out
