"""``wbc replay``: the ticks of a run again, bit for bit."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn
from rich.table import Table

from wbc import record, replaying, validation
from wbc.cli.console import OutputError, err, out
from wbc.cli.session import RECORDING, STRIDE

#: Exit code of a replay whose commands are not those of the recording
DIFFERS = 1

BACKENDS = ("as recorded", "auto", "native", "vm")


def replay(
    run: Annotated[Path, typer.Argument(help="A run folder of `wbc track`, or a recording.")],
    backend: Annotated[str, typer.Option(help="native, vm, auto, or as recorded.")] = BACKENDS[0],
    trust: Annotated[
        bool, typer.Option("--trust", help="Run code from the recording: items and functions that are not wbc's.")
    ] = False,
    table: Annotated[
        Path | None, typer.Option(help="Write the recording as CSV: times, joints, residuals, margins and inputs.")
    ] = None,
) -> None:
    """Do the ticks of a recording again and compare every bit of their commands.

    Exit code 1 if a command differs. The stack comes from the recording, and without --trust only what this package
    declares is read from it.
    """
    validation.one_of("backend", backend, BACKENDS)
    recording = record.Recording(run / RECORDING if run.is_dir() else run)
    if table is not None:
        save_table(recording, table)
    console = err()
    bar = Progress(
        TextColumn("replaying"),
        BarColumn(pulse_style="cyan"),
        TextColumn("{task.completed} ticks"),
        console=console,
        transient=True,
        disable=not console.is_terminal,
        refresh_per_second=5,
    )
    with bar:
        stage = bar.add_task("ticks", total=None)

        def progress(ticks: int) -> None:
            if ticks % STRIDE == 0:
                bar.update(stage, completed=ticks)

        chosen = None if backend == BACKENDS[0] else backend
        found = replaying.replay(recording, backend=chosen, trust=trust, progress=progress)
    report(recording, found)
    for note in found.notes:
        console.print(f"[yellow]note[/yellow]: {escape(note)}", soft_wrap=True)
    if not found.complete:
        console.print("[yellow]note[/yellow]: the recording was not closed; its last ticks may be missing")
    if not found.identical:
        raise typer.Exit(DIFFERS)


def save_table(recording: record.Recording, file: Path) -> None:
    """A row a tick; the head has the units.

    Raises:
        OutputError: there is such a file, or it cannot be written. RecordingError: of an older version.
    """
    columns, units = recording.table(), recording.units
    try:
        with file.open("x", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            writer.writerow(f"{name} [{units[name]}]" if name in units else name for name in columns)
            writer.writerows(zip(*columns.values(), strict=True))
    except OSError as error:
        raise OutputError("table", str(file), f"cannot be written: {error.strerror}") from error


def report(recording: record.Recording, found: replaying.Replay) -> None:
    """Print what was replayed and what came of it."""
    about = recording.about
    table = Table(title=f"{about['robot']}: {recording.path}", title_justify="left", title_style="bold")
    table.box, table.show_header, table.pad_edge = None, False, False
    table.add_column(style="cyan", no_wrap=True)
    table.add_column()
    table.add_row("stack", escape(", ".join(f"{name} ({kind})" for name, kind in about["items"])))
    table.add_row("recorded", f"{found.ticks} ticks, dt {about['dt']:g} s, {about['solver']} ({about['backend']})")
    table.add_row("replayed", f"{about['solver']} ({found.backend})")
    table.add_row("result", escape(str(found)))
    out().print(table)
