"""``wbc relative-motion``: the published tables of the compensation of relative motion, and each part of its system."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from wbc.published.relative_motion.studies import Row
    from wbc.validation import Array

Study = Annotated[str, typer.Argument(help="tables, measuring, holding or master-slave.")]
TableName = Annotated[str | None, typer.Option("--table", help="tables: one, 4.3 to 4.8, row by row. Default: all.")]
Solves = Annotated[int, typer.Option(help="tables: of the Jacobian along an exact line.", min=1)]
Angles = Annotated[str | None, typer.Option(help="measuring: q1,q2,q4,q6 of the arm \\[degrees].")]
Seconds = Annotated[float, typer.Option(help="holding: time on the table \\[s].")]
Period = Annotated[float, typer.Option(help="holding, master-slave: a cycle \\[s].")]
Share = Annotated[float, typer.Option("--share", help="master-slave: A, part of the way to the other arm in a cycle.")]
Carried = Annotated[float, typer.Option("--carried", help="master-slave: B, part of an arm's motion that goes on.")]
Backlash = Annotated[float, typer.Option(help="master-slave: of both arms \\[in].")]
Out = Annotated[Path | None, typer.Option(help="Run folder. Default: runs/relative-motion-TIME.")]
Force = Annotated[bool, typer.Option("--force", help="Write into a folder that has a run.")]
ARM = ("4.3", "4.4", "4.5", "4.6", "4.7", "4.8")
STUDIES = ("tables", "measuring", "holding", "master-slave")


def relative_motion(
    study: Study = "tables",
    table: TableName = None,
    solves: Solves = 32,
    angles: Angles = None,
    seconds: Seconds = 20.0,
    period: Period = 0.05,
    share: Share = 0.7,
    carried: Carried = 0.4,
    backlash: Backlash = 0.02,
    out: Out = None,
    force: Force = False,
) -> None:
    """Compensation of relative motion as published: its straight lines, or another part of its system.

    tables: largest errors in inches of each table's lines, as measured, by the published solve, and exactly. measuring:
    where the measuring arm says that the table is. holding: a hand on a table that sways. master-slave: two arms that
    meet, with backlash.

    Example: [bold]wbc relative-motion --table 4.6[/bold]
    """
    from wbc.cli.console import say
    from wbc.cli.folders import filled, run_folder
    from wbc.published.relative_motion import MasterSlave, studies
    from wbc.published.relative_motion import printed as known
    from wbc.validation import one_of

    one_of("study", study, STUDIES)
    chosen = ARM if table is None else (one_of("table", table, ARM),)
    files, summary = [f"{study}.csv"], {}
    if study == "tables":
        rows = _lines(chosen, solves)
        largest = {n: {k: max(float(r[k]) for r in rows if r["table"] == n) for k in list(rows[0])[2:]} for n in chosen}
        files, summary = [*files, "tables.png"], {"solves": solves, "inches": largest}
        shown: list[Row] = rows if table else [{"table": name, **largest[name]} for name in chosen]
        said = [(f"largest error of x, y, z [in]; line: {solves} solves with feedback, end and way", shown)]
    elif study == "measuring":
        rows = studies.measuring(_readings(angles))
        said = [
            ("the table [in, degrees] by the arm's geometry, and how far the published program is off", rows),
            (
                "tables 4.1 and 4.2 [in]: largest errors as read, and with what both say of scales and axes",
                studies.registering(),
            ),
        ]
    elif study == "holding":
        rows = studies.holding(seconds, period)
        said = [(f"largest errors on the table [in, degrees] in {seconds:g} s, cycles of {1e3 * period:g} ms", rows)]
    else:
        rows = studies.coupled(MasterSlave(share, carried), backlash, period)
        said = [
            (f"how far apart both arms are [in], A = {share:g}, B = {carried:g}; late: second half of the time", rows)
        ]
    folder = run_folder(out, "relative-motion", ("summary.json", *files), force)
    with filled(folder) as fresh:
        with (fresh / files[0]).open("w", newline="") as stream:
            writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
        (fresh / "summary.json").write_text(json.dumps(summary or {study: [part for _, part in said]}, indent=1) + "\n")
        if study == "tables":
            _plot(fresh / "tables.png", {name: known.tables()[name].modified[:, :3] for name in chosen})
    for text, part in said:
        _show(part)
        say(text)
    say(str(folder))


def _lines(chosen: Sequence[str], solves: int) -> list[Row]:
    """Largest errors of each line of some tables."""
    import numpy as np

    from wbc.published.relative_motion import INCH
    from wbc.published.relative_motion import printed as known

    rows: list[Row] = []
    for name in chosen:
        command = known.commanded(name) / INCH
        errors = {"measured": known.tables()[name].modified[:, :3] - command}
        errors |= {method: known.predicted(name, method) - command for method in known.METHODS}
        lines = known.line_errors(name, solves)
        for k, size in enumerate(known.tables()[name].commands[1:]):
            worst = {key: float(np.abs(off[k]).max()) for key, off in errors.items()}
            ends: Row = {"line end": float(lines[k, 0]), "line": float(lines[k, 1])}
            rows.append({"table": name, "command": float(size), **worst, **ends})
    return rows


def _readings(angles: str | None) -> Sequence[Sequence[float]]:
    """Readings of the measuring arm in degrees.

    Raises:
        ShapeError: no four numbers.
    """
    from wbc.errors import ShapeError
    from wbc.published.relative_motion.studies import READINGS

    if angles is None:
        return READINGS
    try:
        numbers = [float(text) for text in angles.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != 4:
        raise ShapeError("angles", angles, "expected q1,q2,q4,q6: four numbers")
    return [numbers]


def _show(rows: list[Row]) -> None:
    """Printed."""
    from rich.table import Table

    from wbc.cli.console import out as console

    shown = Table(header_style="bold", box=None, pad_edge=False)
    for column in rows[0]:
        shown.add_column(column, justify="right", no_wrap=True)
    for row in rows:
        texts = (x if isinstance(x, str) else f"{x:.2g}" if 0.0 < abs(x) < 0.01 else f"{x:.3f}" for x in row.values())
        shown.add_row(*texts)
    console().print(shown)


def _plot(file: Path, measured: dict[str, Array]) -> None:
    """Errors of x, y and z over the command: points as measured, lines by one solve."""
    import numpy as np

    from wbc import style
    from wbc.published.relative_motion import INCH
    from wbc.published.relative_motion import printed as known

    with style.pyplot() as plt:
        high, wide = (2, 3) if len(measured) > 1 else (1, 1)
        size = (3.6 * wide + 1.2, 2.9 * high)
        figure, panels = plt.subplots(high, wide, figsize=size, layout="constrained", squeeze=False)
        for panel, (name, points) in zip(panels.flat, measured.items(), strict=True):
            sizes, wanted = known.tables()[name].commands[1:], known.commanded(name) / INCH
            for axis, colour in enumerate((style.BLUE, style.ORANGE, style.TEAL)):
                label = "xyz"[axis]
                panel.plot(sizes, (points - wanted)[:, axis], "o", ms=4, color=colour, label=f"{label} measured")
                for method, look in (("order 0", "-"), ("order 1", "--")):
                    off = (known.predicted(name, method) - wanted)[:, axis]
                    panel.plot(sizes, off, look, lw=1.2, color=colour, label=f"{label} {method}")
            panel.set_title(f"{name}: along {'xyz'[known.AXIS[name]]}")
            panel.set_xlabel("command [in]")
            panel.set_ylim(-0.85, 0.6)
            panel.set_xticks(np.arange(0, np.ceil(sizes[-1]) + 1))
        panels[0][0].set_ylabel("error [in]")
        figure.legend(*panels[0][0].get_legend_handles_labels(), loc="outside right center", fontsize=8)
        figure.savefig(file)
        plt.close(figure)
