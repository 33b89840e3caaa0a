"""``wbc modes``: which pairs of coordinates an arm can be commanded by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from wbc.cli import completion
from wbc.cli.console import err, out, print_json
from wbc.coordinates import CoordinatePair
from wbc.coordinates.advice.modes import Mode, mode_row, mode_table, table_text

#: M1 to M8
SHORT_NAMES = tuple(mode.name for mode in Mode)


def modes(
    robot: Annotated[
        str,
        typer.Argument(
            help="A name, or a URDF or MJCF file; default: the published arms.", autocompletion=completion.robots
        ),
    ] = "",
    markdown: Annotated[bool, typer.Option("--markdown", help="As the table of the documentation.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the results as JSON.")] = False,
) -> None:
    """Say in which modes arms can be commanded: how many pairs, or what is missing; of one robot, which pairs."""
    if robot and as_json:
        print_json(_data(mode_row(robot)))
        return
    if robot:
        _show(robot)
        return
    table = mode_table()
    if as_json:
        print_json({name: _data(found) for name, found in table.items()})
        return
    if markdown:
        out().print(table_text(table), soft_wrap=True, markup=False)
        return
    rows = Table(title="Pairs by mode", title_justify="left", header_style="bold", box=None, pad_edge=False)
    rows.add_column("robot", style="bold", no_wrap=True)
    for mode in Mode:
        rows.add_column(mode.name)
    for name, found in table.items():
        rows.add_row(name, *("-" if isinstance(f, str) else str(len(f)) for f in found.values()))
    out().print(rows)
    err().print("; ".join(f"{mode.name} {mode.value}" for mode in Mode), soft_wrap=True)
    err().print("Any other arm works, too: wbc modes NAME or FILE", soft_wrap=True)


def _data(found: Mapping[Mode, Sequence[CoordinatePair] | str]) -> dict[str, object]:
    """Mode -> names of its pairs, or what is missing."""
    return {
        mode.name: {"missing": pairs} if isinstance(pairs, str) else {"pairs": [pair.name for pair in pairs]}
        for mode, pairs in found.items()
    }


def _show(robot: str) -> None:
    """Pairs of one robot, or what it lacks.

    Raises:
        UnknownNameError, RobotFileError, MissingPartError: no such robot; one that has no arm.
    """
    for mode, pairs in mode_row(robot).items():
        if isinstance(pairs, str):
            out().print(f"[bold]{mode.name}[/bold] {mode.value}: no {escape(pairs)}", soft_wrap=True)
            continue
        names = "; ".join(escape(pair.name) for pair in pairs)
        out().print(f"[bold]{mode.name}[/bold] {mode.value}: {names}", soft_wrap=True)
