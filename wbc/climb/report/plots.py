"""Plots of a climb: contacts, the body's speed, the joints' rates, and what contacts bore."""

from __future__ import annotations

import pathlib
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from wbc import style
from wbc.climb.checker.cones import STANDARD, cone_at
from wbc.climb.checker.record import OPEN, Climbed
from wbc.climb.loop import ClimbRun
from wbc.climb.report.figures import body_speed, rate_shares
from wbc.climb.report.surroundings import limb_colour
from wbc.log.plots import LogPanel, over_time, save_each
from wbc.validation import Array

#: Plots that a climb has, in the order of its page
PLOTS = ("contacts", "speed", "rates", "loads")
#: Share of a plot's width that a letter takes
LETTER = 0.013
#: Letters that fit upright into a bar, at most
SHORT_NAME = 5


def save_plots(run: ClimbRun, folder: pathlib.Path, about: Mapping[str, Any]) -> list[pathlib.Path]:
    """Writes ``contacts.png``, ``speed.png``, ``rates.png`` and, of a climb under torques, ``loads.png``.

    Args:
        about: as of :func:`wbc.climb.report.climb_figures`.

    Raises:
        MissingPackageError: matplotlib is not installed.
    """
    climbed = Climbed.of(run.log, run.plans[0].climber, run.scene)
    draws: dict[str, Callable[[Any], Any]] = {
        "contacts": lambda plt: _contacts(plt, climbed),
        "speed": lambda plt: _speed(plt, run, float(about.get("speed") or 0.0)),
        "rates": lambda plt: _rates(plt, run),
    }
    if climbed.wrenches is not None:
        draws["loads"] = lambda plt: _loads(plt, climbed)
    return save_each(draws, folder)


def _contacts(plt: Any, climbed: Climbed) -> Any:
    """Which limb is on which foothold when."""
    t, limbs = climbed.t, climbed.climber.limbs
    figure, panel = plt.subplots(figsize=(9.2, 0.55 * len(limbs) + 1.5), layout="constrained")
    for row in range(len(limbs)):
        for first, last, foothold in climbed.stretches(row):
            begin, end = float(t[first]), float(t[min(last, len(t) - 1)])
            if foothold == OPEN:
                panel.plot([begin, end], [row, row], color=limb_colour(row), lw=1.2, ls=(0, (1, 1.5)))
                continue
            panel.barh(row, end - begin, left=begin, height=0.62, color=limb_colour(row), lw=0)
            name, share = climbed.scene.footholds[foothold].id, (end - begin) / max(float(t[-1] - t[0]), 1e-9)
            upright = share > LETTER * len(name)
            if upright or (share > LETTER and len(name) <= SHORT_NAME):
                panel.text(
                    (begin + end) / 2.0, row, name, ha="center", va="center", color="white", fontsize=8.5,
                    rotation=0 if upright else 90,
                )  # fmt: skip
    panel.set_yticks(range(len(limbs)), [limb.name for limb in limbs])
    panel.invert_yaxis()
    panel.grid(visible=False, axis="y")
    panel.set_xlabel("time [s]")
    panel.margins(x=0.01)
    panel.set_title("Footholds over time; dotted: the limb is in the air", fontsize=13)
    return figure


def _speed(plt: Any, run: ClimbRun, asked: float) -> Any:
    """Speed and turn rate of the body."""
    times, speed, turning = body_speed(run.log)
    panels = [LogPanel("m/s", [(speed, style.BLUE, "")], title="Speed of the body's origin, means over 0.1 s"),
              LogPanel("rad/s", [(turning, style.ORANGE, "")], title="Its turn rate")]  # fmt: skip
    figure = over_time(plt, times, panels, "The body")
    if asked > 0.0:
        figure.axes[0].axhline(asked, color=style.GREY, ls=(0, (4, 2)), lw=1.2)
        figure.axes[0].annotate("asked", (times[0], asked), (4, 3), textcoords="offset points", color=style.GREY)
        figure.axes[0].set_ylim(0.0, 1.15 * max(asked, float(speed.max())))
    return figure


def _rates(plt: Any, run: ClimbRun) -> Any:
    """A panel a limb: rates of its joints as shares of their limits."""
    climber, shares, names = run.plans[0].climber, rate_shares(run), run.plans[0].climber.robot.dof_names
    panels, shown = list[LogPanel](), set[str]()
    for row, limb in enumerate(climber.limbs):
        own = [names[k] for k in climber.joints(row) if names[k] in shares]
        shown.update(own)
        panels += _shares_panel(limb.name, own, shares)
    panels += _shares_panel("other joints", [name for name in shares if name not in shown], shares)
    return over_time(plt, run.log["t"], panels, "Rates of joints as shares of their limits", 2)


def _shares_panel(title: str, names: list[str], shares: Mapping[str, Array]) -> list[LogPanel]:
    curves = [(shares[name], style.CYCLE[k % len(style.CYCLE)], "") for k, name in enumerate(names)]
    return [LogPanel("of the limit", curves, high=1.0, title=title)] if curves else []


def _loads(plt: Any, climbed: Climbed) -> Any:
    """Force of every contact, and how far its wrench is inside its cone; both in weights of the robot on earth."""
    weight = climbed.climber.mass * STANDARD
    forces, slacks = list[tuple[Array, str, str]](), list[tuple[Array, str, str]]()
    assert climbed.wrenches is not None
    for row, limb in enumerate(climbed.climber.limbs):
        slack = np.full(len(climbed.t), np.nan)
        for first, last, foothold in climbed.stretches(row):
            if foothold != OPEN:
                a, b, gives = cone_at(climbed, row, foothold)
                slack[first:last] = (b - climbed.wrenches[first:last, row] @ a.T)[:, gives].min(axis=1) / weight
        size = np.linalg.norm(climbed.wrenches[:, row, :3], axis=1) / weight
        forces.append((np.where(np.isnan(slack), np.nan, size), limb_colour(row), limb.name))
        slacks.append((slack, limb_colour(row), limb.name))
    panels = [
        LogPanel("of the weight", forces, title="Force of each contact"),
        LogPanel(
            "of the weight", slacks, low=0.0, title="Least slack of its rows A w <= b: below 0 it is outside its cone"
        ),
    ]
    return over_time(plt, climbed.t, panels, "What contacts bore")
