"""A walk from what was asked for to its folder: carried out with a bar of progress, written, shown, and reported."""

from __future__ import annotations

import datetime
import json
from pathlib import Path
from typing import Any

import typer
from rich.markup import escape
from rich.table import Table

from wbc.cli.console import err, out, progress_bar
from wbc.cli.session import INTERRUPTED, Stopper
from wbc.cli.walking.modes import Perform
from wbc.cli.walking.published_walk import perform_published, published_figures, save_published
from wbc.errors import ShapeError
from wbc.robots import TwoEndedData, Walker, WalkerData
from wbc.track.summary import Figure
from wbc.walking.report.figures import figures_of, save_figures
from wbc.walking.report.folder import make_folder, save_pictures, save_run
from wbc.walking.run import WalkRun
from wbc.walking.run.compiling import keep
from wbc.walking.run.request import PublishedRequest, Request

#: Exit codes: the walk is not possible or did not arrive, and what a check of it violates
REFUSED, VIOLATED = 3, 4
#: Outcomes of a walk that did what it was to do
WELL = ("arrived", "time", "key")


def new_folder(request: Request, output: Path | None, force: bool) -> Path:
    """The folder that was asked for, or a new one under ``runs``."""
    stamp = datetime.datetime.now().strftime("%Y%m%d-%H%M%S")
    name = Path(request.site.structure).stem
    return make_folder(output or Path("runs") / f"walk-{name}-{stamp}", force)


def changed_data(changes: list[str], two_ended: bool = False) -> WalkerData | TwoEndedData:
    """The machine's data with fields changed, from NAME=VALUE.

    Raises:
        ShapeError: no such text. UnknownNameError: no such field. What the data raise.
    """
    values: dict[str, Any] = {}
    for text in changes:
        name, sign, value = text.partition("=")
        try:
            read = json.loads(value)
        except ValueError as error:
            raise ShapeError("set", text, "expected NAME=NUMBER or NAME=[NUMBER, ...]") from error
        if not sign:
            raise ShapeError("set", text, "expected NAME=NUMBER or NAME=[NUMBER, ...]")
        values[name] = tuple(read) if isinstance(read, list) else read
    return TwoEndedData.read(**values) if two_ended else WalkerData.read(**values)


def walk_free(
    perform: Perform, machine: Walker, folder: Path, backend: str, check: bool, pictures: bool, strict: bool
) -> None:
    """Carry out a walk of the planner ``free`` and write its folder."""
    stopper, console = Stopper(), err()
    with progress_bar() as bar:
        stage = bar.add_task("planning", total=None)

        def report_progress(what: str, part: float | None) -> None:
            bar.update(stage, description=what, total=None if part is None else 1.0, completed=part or 0.0)

        with stopper.listening():
            keep()  # a full collection would look at all modules of the program in the middle of a tick
            run = perform(backend, report_progress, stopper)
            report_progress("checking and writing", None)
            files, report = save_run(run, folder, check)
            missing = list[str]()
            if pictures and not stopper():
                shown, missing = save_pictures(run, folder, report_progress, stopper)
                files += shown
    _report(f"{machine.robot.name} on {run.structure.name}", figures_of(run, report), folder, files)
    for text in missing:
        console.print(f"[yellow]note[/yellow]: {escape(text)}", soft_wrap=True)
    _end(run, stopper())
    if report is not None and not report.ok:
        kinds = ", ".join(finding.kind for finding in report.violations)
        console.print(f"[bold red]the checker finds violations[/bold red]: {kinds}; see check.txt", soft_wrap=True)
        if strict:
            raise typer.Exit(VIOLATED)


def _end(run: WalkRun, interrupted: bool) -> None:
    """The exit code of a walk that did not arrive."""
    if interrupted:
        raise typer.Exit(INTERRUPTED)
    if run.outcome not in WELL:
        err().print(f"[bold red]{run.outcome}[/bold red]: {escape(run.reason)}", soft_wrap=True)
        raise typer.Exit(REFUSED)


def walk_published(request: PublishedRequest, folder: Path) -> None:
    """The same of the planner ``published``."""
    run = perform_published(request)
    figures = published_figures(run)
    _report(
        "published walker on cylinder", figures, folder, [*save_published(run, folder), *save_figures(figures, folder)]
    )
    if not run.arrived:
        err().print(f"[bold red]stopped[/bold red]: {escape(run.reason)}", soft_wrap=True)
        raise typer.Exit(REFUSED)


def _report(title: str, figures: list[Figure], folder: Path, files: list[Path]) -> None:
    console = out()
    table = Table(title=title, title_justify="left", title_style="bold", show_header=False, box=None, pad_edge=False)
    table.add_column(style="cyan", no_wrap=True)
    table.add_column()
    for figure in figures:
        if figure.label:
            table.add_row(figure.label, escape(figure.text))
    console.print(table)
    console.print(f"[bold]{escape(str(folder))}[/bold]: {', '.join(file.name for file in files)}", soft_wrap=True)
