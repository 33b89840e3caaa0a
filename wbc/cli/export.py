"""``wbc export``: the tick of a robot as C."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from wbc.cli import options
from wbc.cli.console import say
from wbc.cli.planning import given_obstacles, planned
from wbc.controller import core_of

_WHAT, _CONTROL = "What it writes", "How it is controlled"

Folder = Annotated[Path | None, typer.Option(help="Folder. Default: ROBOT_tick.", rich_help_panel=_WHAT)]
Cap = Annotated[
    int, typer.Option(help="Iterations of the QP solver a tick at most; 0: no cap.", rich_help_panel=_CONTROL)
]
States = Annotated[int, typer.Option(help="States of the check.", rich_help_panel=_WHAT)]
SolverSource = Annotated[
    bool,
    typer.Option(
        "--solver-source",
        help="The QP solver's source, fetched from the package index, in place of its library for this platform.",
        rich_help_panel=_WHAT,
    ),
]
SolverArchive = Annotated[
    Path | None, typer.Option(help="The archive of that source, where there is no network.", rich_help_panel=_WHAT)
]
Force = Annotated[bool, typer.Option("--force", help="Replace an export that is there.", rich_help_panel=_WHAT)]


def export(
    robot: options.RobotName = "panda",
    output: Folder = None,
    frame: options.FrameName = None,
    sphere: options.Spheres = None,
    floor: options.Floor = None,
    start: options.Start = None,
    plane: options.Plane = "off",
    hold: options.Holds = None,
    rate: options.Rate = 200.0,
    gain: options.Gain = 10.0,
    margin: options.Margin = 0.02,
    backend: options.Backend = "auto",
    iteration_cap: Cap = 0,
    states: States = 1000,
    solver_source: SolverSource = False,
    solver_archive: SolverArchive = None,
    force: Force = False,
) -> None:
    """Write one control cycle of a robot, QP solver included, as C99 with a header, build files and a check.

    The stack is that of [bold]wbc track[/bold]: a hand that follows a target, a posture, joint limits, obstacles. Other
    stacks: controller.export in Python.
    """
    obstacles = given_obstacles(sphere, floor)
    plan = planned(
        robot, frame, start, hold, obstacles, plane=(plane, 0.0), rate=rate, margin=margin, gain=gain, backend=backend
    )
    controller = plan.stack().compile(backend=plan.backend)
    controller.reset(plan.start)
    tick = core_of(controller).tick
    tick.q[:] = plan.start
    tick.check()
    for name, obstacle in plan.obstacles.items():
        controller[name].velocity = np.concatenate([obstacle.velocity, np.zeros(3)])
    if iteration_cap:
        controller.iteration_cap = iteration_cap
    place = Path(f"{plan.robot.name}_tick") if output is None else output
    source: bool | Path = solver_source if solver_archive is None else solver_archive
    controller.export(place, overwrite=force, solver_source=source, states=states)
    say(f"{place}: {plan.robot.name}, {plan.robot.nv} degrees of freedom; try `make -C {place} run`")
