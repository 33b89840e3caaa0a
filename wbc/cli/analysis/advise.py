"""``wbc advise``: which pair of coordinates an arm is best commanded by, here."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import typer
from rich.markup import escape
from rich.table import Table

from wbc.cli import completion
from wbc.cli.analysis.modes import SHORT_NAMES
from wbc.cli.console import err, out
from wbc.coordinates import Adviser, advice_time, mode_pairs, parts, restriction_table, survey_pairs
from wbc.errors import ShapeError
from wbc.robot import Robot

#: What the best pair is to keep of the task's least singular value
GOALS = {"ssrms": 0.1, "spdm_arm": 0.3, "spdm": 0.3}
#: Pairs that an adviser's time is measured with, and the time of a tick that it is to stay below [us]
TIMED, GOAL_TIME = 5, 100


def advise(
    robot: Annotated[
        str,
        typer.Argument(
            help="A name of `wbc modes` or `wbc robots`, or a URDF or MJCF file.", autocompletion=completion.robots
        ),
    ],
    at: Annotated[str, typer.Option(help="Joint coordinates with commas, in rad and m. Default: neutral.")] = "",
    mode: Annotated[str, typer.Option(help=f"Pairs of this mode: {', '.join(SHORT_NAMES)}.")] = "M1",
    current: Annotated[str | None, typer.Option(help="The pair in use: stay where none is much better.")] = None,
    restrictions: Annotated[bool, typer.Option("--restrictions", help="Only the written restrictions.")] = False,
    survey: Annotated[int, typer.Option(help="Only how the best pair does at so many random configurations.")] = 0,
    exact: Annotated[bool, typer.Option("--exact/--no-exact", help="Factor determinants for exact loci.")] = True,
) -> None:
    """Say which pairs are well conditioned at a configuration, where the next locus is, and which pair to use."""
    if restrictions:
        out().print(restriction_table(robot, mode), soft_wrap=True, markup=False)
        return
    if survey:
        print_survey(robot, mode, survey)
        return
    machine = parts(robot).robot
    adviser = Adviser(machine, mode_pairs(robot, mode), exact=exact)
    q = configuration_of(machine, at)
    rows = Table(header_style="bold", box=None, pad_edge=False)
    for name in ("task | constraint", "sigma", "of the task", "condition", "distance", "to"):
        rows.add_column(name)
    for found in adviser.advise(q):
        turn = found.direction * found.distance
        shown = np.abs(turn) >= min(0.05, np.abs(turn).max())
        turns = ", ".join(f"{n} {x:+.2g}" for n, x, is_ in zip(machine.dof_names, turn, shown, strict=True) if is_)
        far = found.distance > np.pi
        where = "none within half a turn" if far else found.locus or f"{found.basis}: {turns}"
        distance = "none" if far else f"{found.distance:.3f}"
        numbers = f"{found.sigma:.4f}", f"{found.ratio:.3f}", str(found.condition), distance
        rows.add_row(escape(found.pair), *numbers, escape(where))
    out().print(rows)
    out().print(f"use: [bold]{escape(adviser.recommend(q, current))}[/bold]")
    err().print(
        "sigma: least singular value, metres over the arm's length; of the task: over that of the task alone; "
        f"condition: what loses its rank within {adviser.near:g} rad; distance in rad, exact to a joint's angle, "
        "else an estimate",
        soft_wrap=True,
    )


def print_survey(robot: str, mode: str, count: int) -> None:
    """The best pair at random configurations, its least singular value over that of the task; the time of asking.

    Raises:
        UnknownNameError, MissingPartError, RangeError: no such robot or mode; a bad count.
    """
    machine, pairs = parts(robot).robot, mode_pairs(robot, mode)
    found = survey_pairs(machine, pairs, count)
    k = found.worst
    out().print(
        f"best of {len(pairs)} pairs at {count} configurations: least singular value over that of the task alone",
        soft_wrap=True,
    )
    goal = f" (goal {GOALS[robot]:g})" if robot in GOALS else ""
    out().print(
        f"minimum {found.ratios[k]:.3f}{goal}: {found.best[k]}, task {found.tasks[k]:.4f}", soft_wrap=True, markup=False
    )
    out().print(f"  --at={','.join(f'{x:.4f}' for x in found.states[k])}", soft_wrap=True, markup=False)
    out().print(", ".join(f"{100 * part:g} % below {found.quantile(part):.3f}" for part in (0.01, 0.1, 0.5)))
    some = pairs[:TIMED]
    spent = 1e6 * advice_time(Adviser(machine, some, exact=False))
    out().print(f"adviser of {len(some)} pairs: {spent:.0f} us a tick (goal {GOAL_TIME} us for {TIMED})")


def configuration_of(robot: Robot, text: str) -> list[float]:
    """Numbers with commas, one a coordinate; the neutral configuration for no text.

    Raises:
        ShapeError: something else.
    """
    if not text:
        return [float(x) for x in robot.neutral]
    count = robot.nq
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        raise ShapeError("at", text, f"expected {count} numbers with commas") from None
    if len(numbers) != count:
        raise ShapeError("at", text, f"expected {count} numbers with commas")
    return numbers
