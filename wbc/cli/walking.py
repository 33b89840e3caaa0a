"""A walk from its mode to its folder: carried out with a bar of progress, written, shown, and reported."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from wbc import validation
from wbc.cli.console import OutputError, out, progress_bar, show_figures, tell
from wbc.cli.folders import recording, run_folder
from wbc.cli.output import RECORDED, WalkOutput, Where
from wbc.cli.session import INTERRUPTED, Stopper
from wbc.extras import MissingPackageError
from wbc.published.three_arm_walker.on_request import perform_published, published_figures, save_published
from wbc.robots import Walker, WalkerData, walker
from wbc.robots.walker_data import data_changes, spaced_radius
from wbc.terminal import LinesOfInput
from wbc.viewer.runs import REPLAY
from wbc.viewer.walks import save_walk_page
from wbc.walking.checker import check_run
from wbc.walking.log.folder import machine_made
from wbc.walking.log.log import FILE, WalkLog, WalkLogError
from wbc.walking.planner.plan import Regrasp
from wbc.walking.report.figures import figures_of, least_time_figure, save_figures
from wbc.walking.report.folder import WRITTEN, rules_of, save_pictures, save_run
from wbc.walking.report.run_report import save_report
from wbc.walking.run import WalkRun
from wbc.walking.run.mode import Mode, keep
from wbc.walking.run.request import PublishedRequest
from wbc.walking.run.session import perform
from wbc.walking.torque.choice import PlantChoice

#: Exit code of a walk that is not possible or did not arrive
REFUSED = 3
#: Exit code of a walk that violates something by its check
VIOLATED = 4
#: Fewest and most arms of a body that walks
ARMS = 2, 6


def body(arms: int, changes: Sequence[str] = ()) -> Walker:
    """A body with arms and fields of its data changed; more than three arms stand as far from each other as three do.

    Raises:
        ShapeError: a change that is none. UnknownNameError: no such field. RangeError: arms that it cannot have. What
            the data raise.
    """
    values = data_changes(changes)
    count = validation.integer("arms", arms, *ARMS)
    data = WalkerData.read(**values)
    if "shoulder_radius" not in values:
        data = replace(data, shoulder_radius=spaced_radius(count, data.shoulder_radius))
    return walker(count, data=data)


class WalkLines(LinesOfInput):
    """Answers to proposals: lines of the standard input, until it ends or somebody stops the walk."""

    def answer(self, step: Regrasp, refused: str) -> str | None:
        """A line, "" for yes, or another hold; None at the end of the input or of the walk: nobody says yes."""
        if refused:
            tell(refused)
        tell(f"{step.arm}: {step.source} -> {step.target}? [Enter: yes, another hold, or Ctrl-D: stop]")
        return self.read()


def carried_out(
    mode: Mode[Any],
    output: WalkOutput,
    plant: PlantChoice,
    lines: WalkLines | None = None,
    least_time: bool = False,
    name: str = "",
) -> int:
    """Carry out a walk and write its folder; the exit code.

    Args:
        plant: what moves. lines: answers, which hear a stop. least_time: whether that of the plan is among the figures.
        name: of a new folder; "": by the structure.

    Raises:
        OutputError: the folder cannot be written, or not any more. What the plant raises for bad input.
    """
    folder = _folder(output, name or mode.structure.name)
    stopper = Stopper()
    if lines is not None:
        lines.stop = stopper
    with progress_bar() as bar:
        stage = bar.add_task("planning", total=None)

        def told(what: str, part: float | None) -> None:
            bar.update(stage, description=what, total=None if part is None else 1.0, completed=part or 0.0)

        try:
            with stopper.listening():
                keep()  # a full collection would look at all modules of the program in the middle of a tick
                loop = None
                if plant.dynamic:
                    told("compiling the torques", None)
                    loop = plant.build(mode.walker, mode.structure, output.backend)
                with contextlib.ExitStack() as stack:
                    run = perform(
                        mode,
                        backend=output.backend,
                        progress=told,
                        stop=stopper,
                        folder=folder,
                        plant=loop,
                        compiled=recording(stack, folder, output.mcap),
                    )
                if least_time and run.plan is not None and run.plan.complete:
                    told("least time", None)
                    run = replace(run, more=(*run.more, least_time_figure(run.walker, run.plan)))
                told("checking and writing", None)
                files, report = save_run(run, folder, output.check)
                files += [folder / name for name in RECORDED if (folder / name).is_file()]
                missing = list[str]()
                if output.pictures and not stopper():
                    files += save_pictures(run, folder, told, stopper)
                    told("replay page", None)
                    try:
                        files += save_walk_page(run, folder / REPLAY)
                    except MissingPackageError as error:
                        missing.append(str(error))
                    # Again, with the pictures in it
                    save_report(run, folder, report)
        except OSError as error:
            raise OutputError("out", str(folder), f"cannot be written: {error.strerror}") from error
    figures = ((figure.label, figure.text) for figure in figures_of(run, report))
    show_figures(f"{mode.walker.robot.name} on {run.structure.name}", figures, folder, files)
    for text in missing:
        tell(text, "note")
    return _ended(run.judged(report), stopper())


def published(request: PublishedRequest, where: Where) -> int:
    """The same of the published planner."""
    folder = _folder(where, request.site.structure)
    run = perform_published(request)
    figures = published_figures(run)
    files = [*save_published(run, folder), *save_figures(figures, folder)]
    told = ((figure.label, figure.text) for figure in figures)
    show_figures("published walker on cylinder", told, folder, files)
    if not run.arrived:
        tell(run.reason, "stopped")
    return 0 if run.arrived else REFUSED


def checked(folder: Path) -> int:
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
        tell(f"the run was ended at {log.t[-1]:.2f} s; `wbc walk resume {folder}` goes on with it", "note")
    return 0 if report.ok else VIOLATED


def _folder(where: Where, name: str) -> Path:
    """The folder that was asked for, or a new one under ``runs``; made when the walk begins."""
    return run_folder(where.out, f"walk-{Path(name).stem}", (*WRITTEN, *RECORDED), where.force, made=False)


def _ended(run: WalkRun, interrupted: bool) -> int:
    """The exit code of a walk, and why it did not do what it was to do."""
    if not run.well:
        tell(run.reason, run.outcome)
    if interrupted:
        return INTERRUPTED
    return 0 if run.well else VIOLATED if run.outcome == "violated" else REFUSED
