"""Plots of a walk, from its log and plan."""

from __future__ import annotations

import pathlib
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from wbc import style
from wbc.log.plots import LogPanel, over_time, save_each, tick_histogram
from wbc.track.page import stretches
from wbc.validation import Array
from wbc.walking.log.log import CLOSED, OPENING, WalkLog
from wbc.walking.log.ticks import TickColumns
from wbc.walking.report.figures import body_speed, wrist_angles
from wbc.walking.report.surroundings import arm_colour
from wbc.walking.run.request import DriveRequest
from wbc.walking.run.session import WalkRun

INCH = 0.0254
Draw = Callable[..., Any]


def save_plots(run: WalkRun, log: WalkLog, ticks: TickColumns, folder: pathlib.Path) -> list[pathlib.Path]:
    """Writes holds, margins, joints, rates, drift, wrists, speed, tick_time and, of a walk under torques, loads, PNG
    each; returns the files.
    """
    draws: dict[str, Draw] = {
        "holds": _holds,
        "margins": _margins,
        "joints": _joints,
        "rates": _rates,
        "drift": _drift,
        "wrists": _wrists,
        "speed": _speed,
        "tick_time": _tick_time,
    }
    if run.loads is not None:
        draws["loads"] = _loads
    return save_each({name: partial(draw, run=run, log=log, ticks=ticks) for name, draw in draws.items()}, folder)


def _holds(plt: Any, run: WalkRun, log: WalkLog, ticks: TickColumns) -> Any:
    """Which hand is on which hold when."""
    figure, panel = plt.subplots(figsize=(9.2, 0.75 * len(log.arms) + 1.5), layout="constrained")
    for arm in range(len(log.arms)):
        on = np.isin(log.hand_state[:, arm], (CLOSED, OPENING))
        for hold in np.unique(log.hand_hold[on, arm]):
            for start, end in stretches(on & (log.hand_hold[:, arm] == hold)):
                left, right = log.t[start], log.t[min(end, len(log) - 1)]
                panel.barh(arm, right - left, left=left, height=0.62, color=arm_colour(arm), lw=0)
                name, part = log.hold_id[hold], (right - left) / log.t[-1]
                turned = 0 if part > 0.013 * len(name) else 90
                panel.text(
                    (left + right) / 2,
                    arm,
                    name,
                    ha="center",
                    va="center",
                    color="white",
                    fontsize=8.5,
                    rotation=turned,
                )
        for start, end in stretches(~on):
            panel.plot(
                log.t[[start, min(end, len(log) - 1)]], [arm, arm], color=arm_colour(arm), lw=1.2, ls=(0, (1, 1.5))
            )
    panel.set_yticks(range(len(log.arms)), log.arms)
    panel.invert_yaxis()
    panel.grid(visible=False, axis="y")
    panel.set_xlabel("time [s]")
    panel.margins(x=0.01)
    panel.set_title("Holds over time; dotted: the hand is on its way", fontsize=13)
    return figure


def _margins(plt: Any, run: WalkRun, log: WalkLog, ticks: TickColumns) -> Any:
    """For how much longer the body could have gone on before a hand had to let go, at every re-grasp."""
    assert run.plan is not None
    steps = run.plan.regrasps
    figure, panel = plt.subplots(figsize=(9.2, 3.8), layout="constrained")
    names = [arm.name for arm in run.walker.arms]
    for k, name in enumerate(names):
        mine = [(n, step) for n, step in enumerate(steps, start=1) if step.arm == name]
        panel.bar([n for n, _ in mine], [s.margin for _, s in mine], 0.6, color=arm_colour(k), label=name)
    for n, step in enumerate(steps, start=1):
        panel.annotate(
            step.limit,
            (n, step.margin),
            (0, 3),
            textcoords="offset points",
            rotation=90,
            ha="center",
            va="bottom",
            fontsize=8,
            color=style.GREY,
        )
    panel.set_ylim(0.0, 1.45 * max([step.margin for step in steps], default=1.0) + 0.5)
    panel.set_xticks(range(1, len(steps) + 1))
    panel.set_xlabel("re-grasp")
    panel.set_ylabel("path time left [s]")
    panel.set_title("Left on the old hold at the lift; in grey what will end the new one", fontsize=13)
    panel.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def _joints(plt: Any, run: WalkRun, log: WalkLog, ticks: TickColumns) -> Any:
    limits = run.walker.robot.limits
    low, high = limits.position_lower[6:], limits.position_upper[6:]
    return over_time(plt, log.t, _panels(run, log, log.q, (low, high), "deg"), "Joint angles and their limits", 2)


def _rates(plt: Any, run: WalkRun, log: WalkLog, ticks: TickColumns) -> Any:
    top = run.walker.robot.limits.velocity[6:]
    return over_time(plt, log.t, _panels(run, log, log.v, (-top, top), "deg/s"), "Joint rates and their limits", 2)


def _panels(run: WalkRun, log: WalkLog, values: Array, limits: tuple[Array, Array], unit: str) -> list[LogPanel]:
    """A panel a joint number, a curve an arm; in degrees."""
    arms, column, out = run.walker.arms, {name: k for k, name in enumerate(log.joints)}, []
    for number in range(max(len(arm.joints) for arm in arms)):
        members = {k: column[arm.joints[number]] for k, arm in enumerate(arms) if number < len(arm.joints)}
        curves = [(np.degrees(values[:, j]), arm_colour(k), arms[k].name) for k, j in members.items()]
        joints = list(members.values())
        low, high = float(np.degrees(limits[0][joints].min())), float(np.degrees(limits[1][joints].max()))
        out.append(LogPanel(unit, curves, low, high, f"joint {number + 1}"))
    return out


def _drift(plt: Any, run: WalkRun, log: WalkLog, ticks: TickColumns) -> Any:
    """How far the body is off its command, and how far held hands are off their holds."""
    panels = [
        LogPanel("body [mm]", [(1e3 * ticks.body_error, style.BLUE, "")]),
        LogPanel("worst held hand [um]", [(1e6 * ticks.slip, style.ORANGE, "")]),
    ]
    return over_time(plt, log.t[1:], panels, "Drift: body off its command, held hands off their holds")


def _loads(plt: Any, run: WalkRun, log: WalkLog, ticks: TickColumns) -> Any:
    """What grips bore beside their rating, how far they gave way, and the momentum that the structure got."""
    loads = run.loads
    assert loads is not None
    panels = (
        (loads.force, "force [N]", loads.rating.force),
        (loads.moment, "moment [N m]", loads.rating.torque),
        (1e3 * loads.off, "hand off its hold [mm]", None),
    )
    figure, axes = plt.subplots(4, 1, figsize=(9.2, 8.4), sharex=True, layout="constrained")
    for panel, (values, label, most) in zip(axes, panels, strict=False):
        for k, arm in enumerate(run.walker.arms):
            panel.plot(loads.time, values[:, k], color=arm_colour(k), lw=1.2, label=arm.name)
        if most is not None:
            panel.axhline(most, color=style.RED, lw=1.0)
            panel.annotate("rating", (loads.time[0], most), (4, -11), textcoords="offset points", color=style.RED,
                           fontsize=9)  # fmt: skip
        panel.set_ylabel(label)
        panel.set_ylim(bottom=0.0)
    for values, label, colour in zip(loads.given.T, ("linear [N s]", "angular [N m s]"), (style.BLUE, style.ORANGE),
                                     strict=True):  # fmt: skip
        axes[3].plot(loads.time, values, color=colour, label=label)
    axes[3].set_ylabel("momentum given")
    axes[3].set_ylim(bottom=0.0)
    axes[3].set_xlabel("time [s]")
    for number, (time, text) in enumerate(loads.noted):
        for panel in axes:
            panel.axvline(time, color=style.RED, lw=1.0, ls=(0, (4, 2)))
        axes[2].annotate(f" {text}", (time, 0.97 - 0.13 * (number % 5)), xycoords=("data", "axes fraction"), va="top",
                         ha="right" if time > 0.5 * loads.time[-1] else "left", fontsize=8)  # fmt: skip
    axes[0].margins(x=0.01)
    for panel in (axes[0], axes[3]):
        panel.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    title = "Largest component of every grip, how far it gave way, and what the structure got"
    figure.suptitle(title, x=0.01, ha="left", fontweight="bold", fontsize=13)
    return figure


def _wrists(plt: Any, run: WalkRun, log: WalkLog, ticks: TickColumns) -> Any:
    """How far held wrists are from the singularity at theta5 = 0."""
    angles = np.degrees(wrist_angles(run, log))
    figure, panel = plt.subplots(figsize=(9.2, 3.6), layout="constrained")
    for k, arm in enumerate(run.walker.arms):
        panel.plot(log.t, angles[:, k], color=arm_colour(k), label=arm.name)
    panel.axhline(0.0, color=style.RED, lw=1.2)
    panel.annotate("singular", (log.t[0], 0.0), (4, 3), textcoords="offset points", color=style.RED, fontsize=9)
    least = np.nanmin(np.abs(angles))
    panel.set_xlabel("time [s]")
    panel.set_ylabel("theta5 [deg]")
    panel.margins(x=0.01)
    panel.set_title(f"Wrists of holding arms; the nearest to 0 is {least:.1f} deg", fontsize=13)
    panel.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def _speed(plt: Any, run: WalkRun, log: WalkLog, ticks: TickColumns) -> Any:
    """Speed of the body's origin, commanded at the request and achieved."""
    time, speed, _ = body_speed(log)
    assert run.plan is not None
    poses, spacing = run.plan.path.poses, run.plan.path.spacing
    asked = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1) / spacing
    at = np.interp(time, log.t[1:], ticks.path_time)
    command = asked[np.clip((at / spacing).astype(int), 0, len(asked) - 1)]
    if isinstance(run.request, DriveRequest):
        command = np.interp(time, log.t, np.linalg.norm(log.command[:, :2], axis=1))
    figure, panel = plt.subplots(figsize=(9.2, 3.6), layout="constrained")
    panel.plot(time, command, color=style.GREY, ls=(0, (4, 2)), label="commanded")
    panel.plot(time, speed, color=style.BLUE, lw=1.8, label="achieved")
    panel.set_ylim(0.0, 1.2 * max(float(command.max()), float(speed.max()), 1e-3))
    panel.secondary_yaxis("right", functions=(lambda v: v / INCH, lambda v: v * INCH)).set_ylabel("[in/s]")
    panel.set_xlabel("time [s]")
    panel.set_ylabel("speed of the body [m/s]")
    panel.margins(x=0.01)
    panel.set_title("Speed of the body's origin in the structure's frame, means over 0.1 s", fontsize=13)
    panel.legend(loc="lower center", ncols=2)
    return figure


def _tick_time(plt: Any, run: WalkRun, log: WalkLog, ticks: TickColumns) -> Any:
    """Histogram of the controller's tick."""
    return tick_histogram(plt, ticks.cost, f"Tick time, {len(ticks.cost)} ticks")
