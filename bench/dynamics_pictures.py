"""Draws the thesis' figures again, which are lost: ``python -m bench.dynamics_pictures [--out FOLDER]``.

On the left its own simulation, the plant of the listing; on the right the arm on its motors in a true closed loop.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from bench.pool import ROOT
from wbc import style
from wbc.published.newton_euler import (
    Adaptive,
    DecoupledTwo,
    Drive,
    Linearised,
    discretised,
    linear_model,
    simulate,
)
from wbc.published.newton_euler.comparison import published_scenario
from wbc.published.newton_euler.control import Controller
from wbc.published.newton_euler.simulation import Run
from wbc.published.newton_euler.three_link import MOTOR, arm, task

DT = 0.01
#: Plant -> what a column is called
COLUMNS = {"listing": "as the thesis simulates", "motor": "true closed loop, arm on its motors"}
#: Joints that move, their colours and their units
JOINTS = {1: (style.BLUE, "rad"), 2: (style.ORANGE, "m")}
#: Elements [row, column] of [F G] whose estimates are drawn
ELEMENTS = ((4, 7), (5, 8))


class Watched(Adaptive):
    """Controller 3, with its estimates beside what the linearised model says, a row a step."""

    def __init__(self) -> None:
        super().__init__(arm(), task(), DT)
        self.rows: list[tuple[float, ...]] = []

    def command(self, time: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Torques [n]."""
        torque = super().command(time, q, v)
        A, B = linear_model(self.arm, *self.motion(time)).system
        Phi, E = discretised(A, DT)
        computed = np.hstack([Phi, E @ B])
        self.rows.append(tuple(float(x[k]) for k in ELEMENTS for x in (self.estimator.theta, computed)))
        return torque


CONTROLLERS: dict[str, tuple[str, str, Callable[[], Controller]]] = {
    "linearised": ("1, linearised", "9 to 14", lambda: Linearised(arm(), task(), DT)),
    "adaptive": ("3, adaptive", "15 to 22", Watched),
    "decoupled": ("2, decoupled", "23 to 28", lambda: DecoupledTwo(task(), DT)),
}


def simulated(make: Callable[[], Controller]) -> dict[str, tuple[Run, Controller]]:
    """A controller on both plants."""
    out = {}
    for plant in COLUMNS:
        law = make()
        out[plant] = simulate(arm().model, law, task(), plant=plant, drive=Drive([MOTOR] * 3)), law
    return out


def controller(plt: Any, title: str, runs: dict[str, tuple[Run, Controller]]) -> Any:
    """Positions, torques, voltages, and what is estimated."""
    estimated = any(isinstance(law, Watched) for _, law in runs.values())
    rows = 4 + estimated
    figure, panels = plt.subplots(rows, 2, figsize=(10, 2.1 * rows + 0.6), sharex=True, layout="constrained")
    for column, (plant, (run, law)) in enumerate(runs.items()):
        wanted, steps = run.q + run.errors, run.times[:-1]
        for k, (colour, unit) in JOINTS.items():
            name = f"joint {k + 1}"
            panels[0, column].plot(run.times, wanted[:, k], "--", color=style.INK, lw=1.0)
            panels[0, column].plot(run.times, run.q[:, k], color=colour, label=f"{name} [{unit}]")
            panels[1, column].step(steps, run.nominal[:, k], where="post", color=colour, label=name)
            panels[2, column].step(steps, (run.torques - run.nominal)[:, k], where="post", color=colour, label=name)
            panels[3, column].step(steps, run.voltages[:, k], where="post", color=colour, label=name)
        if isinstance(law, Watched):
            values = np.array(law.rows)
            for e, colour in enumerate((style.BLUE, style.ORANGE)):
                label = f"G[{ELEMENTS[e][0] + 1}, {ELEMENTS[e][1] - 5}]"
                panels[4, column].plot(steps, values[:, 2 * e], color=colour, label=label)
                panels[4, column].plot(steps, values[:, 2 * e + 1], "--", color=style.INK, lw=1.0)
        panels[0, column].set_title(COLUMNS[plant])
        panels[-1, column].set_xlabel("time [s]")
    heads = ["positions,\ndesired dashed", "nominal torque\n[N m, N]", "torque besides\n[N m, N]", "voltage [V]"]
    for row, head in zip(panels, [*heads, "estimated,\ncomputed dashed"], strict=False):
        row[0].set_ylabel(head)
    for panel in (panels[0, 0], *([panels[4, 0]] if estimated else [])):
        panel.legend(ncols=2)
    figure.suptitle(title, x=0.01, ha="left", weight="bold")
    return figure


def errors(plt: Any, runs: dict[str, dict[str, tuple[Run, Controller]]]) -> Any:
    """|q_d - q| of each joint under all controllers, and under today's torque stack at the same 100 Hz."""
    figure, panels = plt.subplots(3, 2, figsize=(10, 8), sharex=True, sharey="row", layout="constrained")
    for column, plant in enumerate(COLUMNS):
        for name, colour in zip(runs, (style.BLUE, style.ORANGE, style.RED, style.TEAL), strict=True):
            run = runs[name][plant][0]
            for k in range(3):
                sizes = np.maximum(np.abs(run.errors[1:, k]), 1e-9)
                panels[k, column].semilogy(run.times[1:], sizes, color=colour, label=name)
        panels[0, column].set_title(COLUMNS[plant])
        panels[-1, column].set_xlabel("time [s]")
    for k, unit in enumerate(("rad", "rad", "m")):
        panels[k, 0].set_ylabel(f"joint {k + 1} off [{unit}]")
        panels[k, 0].set_ylim(1e-8, None)
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    figure.suptitle("Figures 29 to 31: errors of all controllers, and of today's torque stack", x=0.01, ha="left",
                    weight="bold")  # fmt: skip
    return figure


def main() -> None:
    """Simulate and draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "images")
    folder = parser.parse_args().out
    folder.mkdir(parents=True, exist_ok=True)
    scenario = published_scenario()
    runs = {title: simulated(make) for title, _, make in CONTROLLERS.values()}
    stack = scenario.controllers["torque stack"]
    everything = runs | {"torque stack": simulated(lambda: stack(scenario.robot, task(), DT))}
    with style.pyplot() as plt:
        for name, (title, numbers, _) in CONTROLLERS.items():
            figure = controller(plt, f"Figures {numbers}: controller {title}", runs[title])
            figure.savefig(folder / f"dynamics_{name}.png", dpi=90)
        errors(plt, everything).savefig(folder / "dynamics_errors.png", dpi=90)
    for file in sorted(folder.glob("dynamics_*.png")):
        print(file)


if __name__ == "__main__":
    main()
