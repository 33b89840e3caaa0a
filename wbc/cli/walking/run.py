"""A walk from what was asked for to its folder: carried out with a bar of progress, written, shown, and reported."""

from __future__ import annotations

import json
from dataclasses import replace
from math import pi, sin
from pathlib import Path
from typing import Any

import typer
from rich.markup import escape
from rich.table import Table

from wbc import validation
from wbc.cli.console import OutputError, err, out, progress_bar
from wbc.cli.folders import run_folder
from wbc.cli.session import INTERRUPTED, Stopper
from wbc.cli.walking.modes import Perform
from wbc.cli.walking.published_walk import perform_published, published_figures, save_published
from wbc.errors import RangeError, ShapeError
from wbc.robots import TwoEndedData, Walker, WalkerData, walker
from wbc.track.summary import Figure
from wbc.walking.checker import check_run
from wbc.walking.log.folder import machine_made
from wbc.walking.log.log import FILE, WalkLog, WalkLogError
from wbc.walking.report.figures import figures_of, save_figures
from wbc.walking.report.folder import WRITTEN, rules_of, save_pictures, save_run
from wbc.walking.report.run_report import save_report
from wbc.walking.run import WalkRun
from wbc.walking.run.mode import keep
from wbc.walking.run.request import PublishedRequest

#: Exit codes: the walk is not possible or did not arrive, and what a check of it violates
REFUSED, VIOLATED = 3, 4
#: Fewest and most arms of a body that walks
ARMS = 2, 6


def new_folder(structure: str, output: Path | None, force: bool) -> Path:
    """The folder that was asked for, or a new one under ``runs``; made when the walk begins."""
    return run_folder(output, f"walk-{Path(structure).stem}", WRITTEN, force, made=False)


def changed_machine(changes: list[str], two_ended: bool = False, arms: int | None = None) -> Walker:
    """The machine with fields of its data changed, from NAME=VALUE.

    Args:
        arms: of the body; None: three. More than three stand as far from each other as three do, on a larger body.

    Raises:
        ShapeError: no such text. UnknownNameError: no such field. RangeError: arms that it cannot have. What the data
            raise.
    """
    values: dict[str, Any] = {}
    for text in changes:
        name, sign, value = text.partition("=")
        try:
            read = json.loads(value)
        except (ValueError, RecursionError) as error:
            raise ShapeError("set", text, "expected NAME=NUMBER or NAME=[NUMBER, ...]") from error
        if not sign:
            raise ShapeError("set", text, "expected NAME=NUMBER or NAME=[NUMBER, ...]")
        values[name] = tuple(read) if isinstance(read, list) else read
    if two_ended:
        if arms not in (None, 2):
            raise RangeError("arms", arms, "the two-ended arm has two ends")
        return walker(data=TwoEndedData.read(**values), two_ended=True)
    count = validation.integer("arms", 3 if arms is None else arms, *ARMS)
    data = WalkerData.read(**values)
    if count > 3 and "shoulder_radius" not in values:
        # As far from each other as three of them are
        data = replace(data, shoulder_radius=data.shoulder_radius * sin(pi / 3) / sin(pi / count))
    return walker(count, data=data)


def walk_free(perform: Perform, machine: Walker, folder: Path, backend: str, check: bool, pictures: bool) -> None:
    """Carry out a walk of the planner ``free`` and write its folder.

    Raises:
        OutputError: the folder cannot be written any more.
    """
    stopper, console = Stopper(), err()
    with progress_bar() as bar:
        stage = bar.add_task("planning", total=None)

        def report_progress(what: str, part: float | None) -> None:
            bar.update(stage, description=what, total=None if part is None else 1.0, completed=part or 0.0)

        try:
            with stopper.listening():
                keep()  # a full collection would look at all modules of the program in the middle of a tick
                run = perform(backend, report_progress, stopper, folder)
                report_progress("checking and writing", None)
                files, report = save_run(run, folder, check)
                missing = list[str]()
                if pictures and not stopper():
                    shown, missing = save_pictures(run, folder, report_progress, stopper)
                    files += shown
                    # Again, with the pictures in it
                    save_report(run, folder, report)
        except OSError as error:
            raise OutputError("out", str(folder), f"cannot be written: {error.strerror}") from error
    _report(f"{machine.robot.name} on {run.structure.name}", figures_of(run, report), folder, files)
    for text in missing:
        console.print(f"[yellow]note[/yellow]: {escape(text)}", soft_wrap=True)
    _end(run.judged(report), stopper())


def _end(run: WalkRun, interrupted: bool) -> None:
    """The exit code of a walk that did not do what it was to do."""
    if not run.well:
        err().print(f"[bold red]{run.outcome}[/bold red]: {escape(run.reason)}", soft_wrap=True)
    if interrupted:
        raise typer.Exit(INTERRUPTED)
    if not run.well:
        raise typer.Exit(VIOLATED if run.outcome == "violated" else REFUSED)


def check_folder(folder: Path) -> None:
    """Run the checker on a folder, and say how its run ended.

    Raises:
        WalkLogError, StructureFileError, RobotFileError: no run, or one that was ended before it walked.
    """
    if not validation.exists("run", folder) or not folder.is_dir():
        raise WalkLogError("run", str(folder), validation.no_such(folder, "there is no such folder"))
    log = WalkLog.load(folder)
    machine = log.meta.get("machine")
    report = check_run(folder, None if machine is None else rules_of(machine_made(machine)))
    out().print(report.table())
    if not (folder / FILE).is_file():
        text = f"the run was ended at {log.t[-1]:.2f} s; `wbc walk --resume {folder}` goes on with it"
        err().print(f"[yellow]note[/yellow]: {escape(text)}", soft_wrap=True)
    if not report.ok:
        raise typer.Exit(VIOLATED)


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
