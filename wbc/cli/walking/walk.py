"""``wbc walk``: a walk on holds, planned, carried out, checked and shown; ``wbc plans`` compares two plans."""

from __future__ import annotations

import datetime
import json
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from wbc import robots
from wbc.cli.console import err, out, progress_bar
from wbc.cli.session import INTERRUPTED, Stopper
from wbc.cli.walking import options
from wbc.cli.walking.modes import Perform, performance
from wbc.cli.walking.published_walk import perform_published, published_figures, save_published
from wbc.errors import RangeError, ShapeError
from wbc.robots import TwoEndedData, Walker, WalkerData
from wbc.track.summary import Figure
from wbc.walking.planner.plan import differences, read_plan
from wbc.walking.report.figures import figures_of, save_figures
from wbc.walking.report.folder import make_folder, save_pictures, save_run
from wbc.walking.run.compiling import keep
from wbc.walking.run.perform import WalkRun
from wbc.walking.run.request import GRAPPLES, SPEED, WalkRequest

#: Exit codes: the walk is not possible or did not arrive, and what a check of it violates
REFUSED, VIOLATED = 3, 4
#: Outcomes of a walk that did what it was to do
WELL = ("arrived", "time", "key")


def walk(
    structure: options.StructureName = "",
    robot: options.RobotName = "three-armed",
    gait: options.Gait = "any",
    mode: options.Mode = "velocity",
    speed: options.Speed = SPEED,
    turn_rate: options.TurnRate = 0.05,
    start: options.From = "",
    to: options.To = None,
    remove_rows: options.RemoveRows = "",
    remove_columns: options.RemoveColumns = "",
    remove: options.Remove = 0.0,
    seed: options.Seed = 0,
    rigid: options.Rigid = False,
    commands: options.Commands = "",
    arm: options.ArmName = "",
    do: options.Do = None,
    free_start: options.FreeStart = False,
    resume: options.Resume = "",
    ask: options.Ask = False,
    planner: options.PlannerName = "free",
    plan: options.PlanFile = "",
    change: options.Change = None,
    backend: options.Backend = "auto",
    output: options.RunFolder = None,
    force: options.Force = False,
    check: options.Check = True,
    strict: options.Strict = False,
    pictures: options.Pictures = True,
    least_time: options.LeastTime = False,
) -> None:
    """Walk on a structure of holds with three arms, or end over end, and leave log, plan, check, pictures and a page.

    Ends with 3 if the walk is not possible or does not arrive. Ctrl-C ends it early; what was done until then is
    written all the same.
    """
    two_ended = robot == "two-ended"
    structure = structure or (GRAPPLES if two_ended else "cylinder")
    request = WalkRequest(
        structure,
        mode,
        speed,
        turn_rate,
        start,
        tuple(to or ()),
        remove_rows,
        remove_columns,
        remove,
        seed,
        planner,
        rigid,
        commands,
        arm,
        tuple(do or ()),
        free_start,
        robot,
        gait,
        plan,
    )
    if change and planner == "published":
        raise RangeError("set", change, "the published planner has numbers of its own, three_arm_walker.Calibration")
    machine = robots.walker(data=changed_data(change or [], two_ended), two_ended=two_ended)
    perform = performance(request, machine, resume, ask, least_time)  # bad input shows before a folder is made
    stamp = datetime.datetime.now().strftime("%Y%m%d-%H%M%S")
    folder = make_folder(output or Path("runs") / f"walk-{Path(structure).stem}-{stamp}", force)
    if planner == "published":
        _published(request, folder)
    else:
        _free(perform, machine, folder, backend, check or strict, pictures, strict)


def plans(
    one: Annotated[Path, typer.Argument(help="A plan.json.")],
    other: Annotated[Path, typer.Argument(help="Another one.")],
) -> None:
    """Show what two plans do differently, one line each; exit code 1 if there is anything."""
    first, second = (read_plan(path) for path in (one, other))
    lines = differences(first, second)
    for line in lines:
        out().print(line, markup=False, soft_wrap=True)
    if lines:
        raise typer.Exit(1)
    out().print(f"the same {len(first.regrasps)} re-grasps")


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


def _free(
    perform: Perform, machine: Walker, folder: Path, backend: str, check: bool, pictures: bool, strict: bool
) -> None:
    stopper, console = Stopper(), err()
    with progress_bar() as bar:
        stage = bar.add_task("planning", total=None)

        def told(what: str, part: float | None) -> None:
            bar.update(stage, description=what, total=None if part is None else 1.0, completed=part or 0.0)

        with stopper.listening():
            keep()  # a full collection would look at all modules of the program in the middle of a tick
            run = perform(backend, told, stopper)
            told("checking and writing", None)
            files, report = save_run(run, folder, check)
            missing = list[str]()
            if pictures and not stopper():
                shown, missing = save_pictures(run, folder, told, stopper)
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


def _published(request: WalkRequest, folder: Path) -> None:
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
