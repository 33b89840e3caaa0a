"""``wbc advise``: which pair of coordinates an operator's arm is best commanded by, here."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from wbc.cli.console import err, out
from wbc.cli.modes import SHORT_NAMES
from wbc.coordinates import Adviser, mode_pairs, parts, restriction_table
from wbc.errors import ShapeError
from wbc.robot import Robot


def advise(
    robot: Annotated[str, typer.Argument(help="An arm of `wbc modes`.")],
    at: Annotated[str, typer.Option(help="Joint coordinates with commas [rad, m]. Default: neutral.")] = "",
    mode: Annotated[str, typer.Option(help=f"Pairs of this mode: {', '.join(SHORT_NAMES)}.")] = "M1",
    current: Annotated[str | None, typer.Option(help="The pair in use: stay where none is much better.")] = None,
    restrictions: Annotated[bool, typer.Option("--restrictions", help="Only the written restrictions.")] = False,
    exact: Annotated[bool, typer.Option("--exact/--no-exact", help="Factor determinants for exact loci.")] = True,
) -> None:
    """Say which pairs are well conditioned at a configuration, where the next locus is, and which pair to use."""
    if restrictions:
        out().print(restriction_table(robot, mode), soft_wrap=True, markup=False)
        return
    machine = parts(robot).robot
    adviser = Adviser(machine, mode_pairs(robot, mode), exact=exact)
    q = configuration_of(machine, at)
    rows = Table(header_style="bold", box=None, pad_edge=False)
    for name in ("task | constraint", "sigma", "of the task", "condition", "distance", "to"):
        rows.add_column(name)
    for found in adviser.advise(q):
        turn = found.direction * found.distance
        way = ", ".join(f"{n} {x:+.2f}" for n, x in zip(machine.dof_names, turn, strict=True) if abs(x) > 0.05)
        where = found.locus or f"{found.basis}: {way}"
        numbers = f"{found.sigma:.4f}", f"{found.ratio:.3f}", str(found.condition), f"{found.distance:.3f}"
        rows.add_row(escape(found.pair), *numbers, escape(where))
    out().print(rows)
    out().print(f"use: [bold]{escape(adviser.recommend(q, current))}[/bold]")
    err().print(
        "sigma: least singular value, metres over the characteristic length; of the task: over that of the task alone; "
        "distance in rad, exact to a joint's angle, else an estimate",
        soft_wrap=True,
    )


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
