"""``wbc relative-motion``: the published tables of the compensation of relative motion, and exact lines beside them."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from wbc.validation import Array

TableName = Annotated[str | None, typer.Option("--table", help="One table, 4.3 to 4.8, row by row. Default: all.")]
Solves = Annotated[int, typer.Option(help="Of the Jacobian along an exact line.", min=1)]
Out = Annotated[Path | None, typer.Option(help="Run folder. Default: runs/relative-motion-TIME.")]
Force = Annotated[bool, typer.Option("--force", help="Write into a folder that has a run.")]
ARM = ("4.3", "4.4", "4.5", "4.6", "4.7", "4.8")


def relative_motion(table: TableName = None, solves: Solves = 32, out: Out = None, force: Force = False) -> None:
    """Largest errors in inches of each table's straight lines: as measured, by the published solve, and exactly.

    Example: [bold]wbc relative-motion --table 4.6[/bold]
    """
    import numpy as np
    from rich.table import Table

    from wbc.cli.console import out as console
    from wbc.cli.console import say
    from wbc.cli.folders import filled, run_folder
    from wbc.published.relative_motion import INCH
    from wbc.published.relative_motion import printed as known
    from wbc.validation import one_of

    chosen = ARM if table is None else (one_of("table", table, ARM),)
    rows: list[dict[str, Any]] = []
    for name in chosen:
        command = known.commanded(name) / INCH
        errors = {"measured": known.tables()[name].modified[:, :3] - command}
        errors |= {method: known.predicted(name, method) - command for method in known.METHODS}
        lines = known.line_errors(name, solves)
        for k, size in enumerate(known.tables()[name].commands[1:]):
            worst = {key: float(np.abs(off[k]).max()) for key, off in errors.items()}
            rows.append({"table": name, "command": float(size), **worst, "line end": lines[k, 0], "line": lines[k, 1]})
    folder = run_folder(out, "relative-motion", ("summary.json", "tables.csv", "tables.png"), force)
    columns = list(rows[0])
    largest = {
        name: {key: max(row[key] for row in rows if row["table"] == name) for key in columns[2:]} for name in chosen
    }
    with filled(folder) as fresh:
        with (fresh / "tables.csv").open("w", newline="") as stream:
            writer = csv.DictWriter(stream, columns, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
        (fresh / "summary.json").write_text(json.dumps({"solves": solves, "inches": largest}, indent=1) + "\n")
        _plot(fresh / "tables.png", {name: known.tables()[name].modified[:, :3] for name in chosen})
    shown = Table(header_style="bold", box=None, pad_edge=False)
    for column in columns if table else [c for c in columns if c != "command"]:
        shown.add_column(column, justify="right", no_wrap=True)
    for row in rows if table else [{"table": name, **largest[name]} for name in chosen]:
        shown.add_row(*(x if isinstance(x, str) else f"{x:.2g}" if x < 0.01 else f"{x:.3f}" for x in row.values()))
    console().print(shown)
    say(f"largest error of x, y, z [in]; line: {solves} solves with feedback, end and way")
    say(str(folder))


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
