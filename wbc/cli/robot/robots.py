"""``wbc robots`` and ``wbc robot NAME``."""

from __future__ import annotations

import math
from dataclasses import fields
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from wbc import robots
from wbc.cli import completion, results
from wbc.cli.console import err, out, print_json
from wbc.cli.robot.collisions import SAMPLES, Collisions
from wbc.cli.robot.collisions import show as show_collisions
from wbc.robot import Robot
from wbc.robot.loading import SHAPES

_PAIRS = "With --collisions, which --samples, --srdf, --pairs and --save imply"


def table(
    match: Annotated[str, typer.Argument(help="Only names that contain this text.")] = "",
    all_: Annotated[bool, typer.Option("--all", help="Also the files that cannot be loaded, and why.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the results as JSON.")] = False,
) -> None:
    """List the robots that load by name."""
    rows = Table(title="Robots", title_justify="left", header_style="bold", box=None, pad_edge=False)
    rows.add_column("name", style="bold", no_wrap=True)
    rows.add_column("base")
    rows.add_column("about")
    count, data = 0, []
    for recipe in robots.table():
        if match.lower() not in recipe.name.lower() or (recipe.problem and not all_):
            continue
        about = f"[red]does not load: {escape(recipe.problem)}[/red]" if recipe.problem else escape(recipe.about)
        rows.add_row(recipe.name, recipe.base, about)
        shown = {key: getattr(recipe, key) for key in ("name", "base", "about", "problem")}
        data.append({**shown, "frames": dict(recipe.frames)})
        count += 1
    if count == 0:
        robots.load(match)  # not in the table: raises with the nearest names, unless it is a file
    if as_json:
        print_json(data)
        return
    out().print(rows)
    err().print(
        f"{count} robots; [bold]wbc robot NAME[/bold] shows one. A URDF or MJCF file works in the place of a name."
    )


def show(
    name: Annotated[
        str,
        typer.Argument(
            help="A name of `wbc robots`, or a URDF or MJCF file.",
            show_default=False,
            autocompletion=completion.robots,
        ),
    ],
    base: Annotated[str | None, typer.Option(help="fixed, floating, planar or differential.")] = None,
    frames: Annotated[bool, typer.Option("--frames/--no-frames", help="List the frames.")] = True,
    shapes: Annotated[str, typer.Option(help="Shapes of the links: " + ", ".join(SHAPES) + ".")] = "auto",
    collisions: Annotated[
        bool, typer.Option("--collisions", help="Shapes of the links, and the pairs that must not touch.")
    ] = False,
    samples: Annotated[
        int | None,
        typer.Option(help=f"Random configurations to look at; default {SAMPLES}.", rich_help_panel=_PAIRS),
    ] = None,
    seed: Annotated[int, typer.Option(help="Of the random configurations.", rich_help_panel=_PAIRS)] = 0,
    clearance: Annotated[
        float, typer.Option(help="Links this close count as touching, in m.", rich_help_panel=_PAIRS)
    ] = 0.0,
    srdf: Annotated[
        Path | None, typer.Option(help="SRDF file. Default: the table's, if any.", rich_help_panel=_PAIRS)
    ] = None,
    pairs: Annotated[Path | None, typer.Option(help="Show the pairs in this file.", rich_help_panel=_PAIRS)] = None,
    save: Annotated[
        Path | None, typer.Option(help="Write the pairs to this file, to be edited.", rich_help_panel=_PAIRS)
    ] = None,
    force: Annotated[bool, typer.Option(help="Write over a file that is there.", rich_help_panel=_PAIRS)] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the results as JSON.")] = False,
) -> None:
    """Show a robot: joints, limits, frames, shapes and where the numbers come from.

    With --collisions, show which links must not touch each other, and why the others need not be watched.
    """
    robot = robots.load(name, base=base, shapes=shapes)
    if collisions or samples is not None or any((srdf, pairs, save)):
        if as_json:
            results.collect()
        show_collisions(robot, Collisions(samples, seed, clearance, srdf, pairs, save, force))
        return
    if as_json:
        print_json(_data(robot))
        return
    console = out()
    console.print(
        f"[bold]{robot.name}[/bold]: {robot.nv} degrees of freedom, {robot.base} base, "
        f"characteristic length {robot.characteristic_length:.3g} m"
    )
    if robot.source:
        console.print(f"read from {escape(robot.source)}", soft_wrap=True)
    console.print(_joints(robot))
    if robot.couplings:
        names = robot.dof_names
        text = ", ".join(f"{names[c.follower]} = {c.ratio:g} {names[c.leader]} + {c.offset:g}" for c in robot.couplings)
        console.print(f"[bold]coupled[/bold]  {text}")
    if robot.loops:
        console.print("[bold]loops[/bold]    " + ", ".join(escape(loop.name) for loop in robot.loops.loops))
    if robot.frames:
        console.print("[bold]roles[/bold]    " + ", ".join(f"{role}: {frame}" for role, frame in robot.frames.items()))
    if robot.shapes:
        counts = [f"{link} {len(group)}" for link, group in robot.shapes.items()]
        console.print("[bold]shapes[/bold]   " + ", ".join(counts))
    for key, note in robot.notes.items():
        console.print(f"[bold]{key}[/bold]: {escape(note)}", soft_wrap=True)
    if frames:
        console.print(f"[bold]frames[/bold]   {', '.join(robot.frame_names)}")


def _data(robot: Robot) -> dict[str, object]:
    """What there is to know of a robot, limits by degree of freedom."""
    limits = {field.name: getattr(robot.limits, field.name).tolist() for field in fields(robot.limits)}
    return {
        "name": robot.name,
        "base": robot.base,
        "source": robot.source,
        "nq": robot.nq,
        "nv": robot.nv,
        "dofs": list(robot.dof_names),
        "units": list(robot.dof_units),
        "limits": limits,
        "neutral": robot.neutral.tolist(),
        "roles": dict(robot.frames),
        "frames": list(robot.frame_names),
        "shapes": {link: len(group) for link, group in robot.shapes.items()},
        "notes": dict(robot.notes),
    }


def _joints(robot: Robot) -> Table:
    rows = Table(header_style="bold", box=None, pad_edge=False)
    rows.add_column("joint", no_wrap=True)
    for head in ("unit", "lower", "upper", "velocity", "acceleration", "effort", "neutral"):
        rows.add_column(head, justify="right")
    limits = robot.limits
    for k, (dof, unit) in enumerate(zip(robot.dof_names, robot.dof_units, strict=True)):
        place = int(robot.position_index[k])
        numbers = (
            limits.position_lower[k],
            limits.position_upper[k],
            limits.velocity[k],
            limits.acceleration[k],
            limits.effort[k],
            robot.neutral[place] if place >= 0 else math.nan,
        )
        rows.add_row(dof, unit, *(_number(float(x)) for x in numbers))
    return rows


def _number(value: float) -> str:
    return f"{value:.4g}" if math.isfinite(value) else "-"
