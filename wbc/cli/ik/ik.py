"""``wbc ik``: configurations that put a frame where it shall be."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from wbc.cli import completion, options
from wbc.cli.console import print_json
from wbc.cli.ik.answers import TargetAnswer, check_output, report, save
from wbc.cli.ik.targets import Target, given_targets
from wbc.cli.planning import given_obstacles, planned
from wbc.errors import InfeasibleError, RangeError
from wbc.ik import InverseKinematics, Solution
from wbc.ik.hindrance import hindrance
from wbc.track.setup import MovingObstacle
from wbc.validation import Array

#: Exit code where not every target was reached
UNSOLVED = 1

_WHAT, _SEARCH, _OUTPUT = "What it does", "How it searches", "What it writes"

TargetTexts = Annotated[
    list[str] | None,
    typer.Option(help="X,Y,Z or X,Y,Z,QX,QY,QZ,QW in m in the world; may be repeated.", rich_help_panel=_WHAT),
]
TargetFile = Annotated[
    Path | None,
    typer.Option(help="CSV file with columns x,y,z[,qx,qy,qz,qw], or npz file with poses.", rich_help_panel=_WHAT),
]
FrameName = Annotated[
    str | None,
    typer.Option(help="Frame. Default: the robot's tip.", rich_help_panel=_WHAT, autocompletion=completion.frames),
]
Start = Annotated[
    str | None,
    typer.Option(help="Where the search begins, numbers with commas. Default: neutral.", rich_help_panel=_WHAT),
]
Every = Annotated[
    bool, typer.Option("--branches", help="All configurations, not only the first one.", rich_help_panel=_WHAT)
]
Seed = Annotated[int, typer.Option(help="Of the random configurations to start from.", rich_help_panel=_SEARCH)]
Budget = Annotated[
    float | None,
    typer.Option(help="Time for each target, in s. Default: until the restarts are used up.", rich_help_panel=_SEARCH),
]
Restarts = Annotated[
    int | None,
    typer.Option(help="Random configurations. Default: 100, with --branches 500.", rich_help_panel=_SEARCH),
]
Tolerance = Annotated[float, typer.Option(help="Of each component, in m and rad.", rich_help_panel=_SEARCH)]
Out = Annotated[Path | None, typer.Option(help="CSV or npz file with all configurations.", rich_help_panel=_OUTPUT)]
Force = Annotated[bool, typer.Option("--force", help="Write over a file that is there.", rich_help_panel=_OUTPUT)]


def ik(
    robot: options.RobotName = "panda",
    target: TargetTexts = None,
    targets: TargetFile = None,
    frame: FrameName = None,
    start: Start = None,
    sphere: options.Spheres = None,
    floor: options.Floor = None,
    hold: options.Holds = None,
    branches: Every = False,
    margin: options.Margin = 0.02,
    seed: Seed = 0,
    budget: Budget = None,
    restarts: Restarts = None,
    tolerance: Tolerance = 1e-5,
    backend: options.Backend = "auto",
    out: Out = None,
    force: Force = False,
    as_json: options.AsJson = False,
) -> None:
    """Find joint positions that put a frame at a pose or a position, clear of obstacles and within the limits.

    Of the configurations of a redundant arm those nearest to --start are preferred. Exit code 1 if a target is not
    reached; the nearest configuration and what binds are printed then.

    Example: [bold]wbc ik ur5 --target 0.4,0.2,0.5,1,0,0,0 --floor -0.1 --branches --out q.csv[/bold]
    """
    check_output(out, force)
    wanted = given_targets(target, targets)
    plan = planned(robot, frame, start, hold, _standing(given_obstacles(sphere, floor)), margin=margin)
    solver = plan.stack().inverse_kinematics(goals=("hand",), backend=backend)
    given: dict[str, Any] = {"seed": seed, "budget": budget, "tolerance": tolerance}
    if restarts is not None:
        given["restarts"] = restarts
    answers = []
    for number, one in enumerate(wanted, 1):
        answers += _answers(solver, plan.start, number, one, branches, given)
    if as_json:
        print_json([answer.data() for answer in answers])
    else:
        report(plan.robot, plan.frame, answers)
    if out is not None:
        save(out, plan.robot, answers)
    if not all(answer.solved for answer in answers):
        raise typer.Exit(UNSOLVED)


def _answers(
    solver: InverseKinematics, first: Array, number: int, target: Target, every: bool, given: dict[str, Any]
) -> list[TargetAnswer]:
    """What was found for one target, or the nearest configuration."""
    hand = solver["hand"]
    hand.target = target.pose
    hand.mask = np.array([1.0] * 3 + [float(target.oriented)] * 3)
    found: tuple[Solution, ...] = (solver.solve(first, **given),)
    if every and found[0].solved:
        # Where the time ends before the first of all branches, there is the one answer
        with contextlib.suppress(InfeasibleError):
            found = solver.branches(first, **given).solutions
    why = None if found[0].solved else hindrance(solver, first, **given)
    return [TargetAnswer(number, k, solution, target.oriented, why) for k, solution in enumerate(found, 1)]


def _standing(obstacles: dict[str, MovingObstacle]) -> dict[str, MovingObstacle]:
    """Obstacles that do not move.

    Raises:
        RangeError: one does.
    """
    for name, obstacle in obstacles.items():
        if obstacle.velocity.any():
            raise RangeError(name, obstacle.velocity, "there is no time here: leave the velocity out")
    return obstacles
