"""A climb at the terminal: its bar of progress, Ctrl-C, questions, the folder, and what is printed."""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Sequence
from pathlib import Path

from wbc import validation
from wbc.api import Controller
from wbc.cli.console import progress_bar, say, show_figures, tell, write_json
from wbc.cli.folders import filled, recording, run_folder
from wbc.cli.output import RECORDED, WalkOutput, Where
from wbc.cli.session import INTERRUPTED, Stopper
from wbc.climb import report
from wbc.climb.folder import PART, REQUEST, SCENE
from wbc.climb.grids import cylinder_grid
from wbc.climb.loop import ClimbOutcome
from wbc.climb.plan_files import PLAN
from wbc.climb.rates import TwistSource
from wbc.climb.request import ClimbRequest, Objective, PathRequest, RemovedFootholds
from wbc.climb.search import NoStancesError
from wbc.climb.session import ClimbDone, ClimbHooks, ClimbSession, check_folder, less_footholds
from wbc.errors import InfeasibleError
from wbc.log import LogFileError
from wbc.terminal import LinesOfInput
from wbc.track.summary import save_summary
from wbc.viewer.walks import save_climb_page

#: Exit code of a run without a plan, or that did not arrive
REFUSED = 3
#: Exit code of a run that violates something by its check
VIOLATED = 4
#: Files of a run's folder; those of shapes of its scene are numbered
RUN_FILES = (REQUEST, SCENE, "scene-*.npy", PLAN, PART, *report.WRITTEN, *RECORDED)

#: Files of a folder of the published planner
PUBLISHED_FILES = ("published.npz", "holds.png", "summary.json")


class LimbLines(LinesOfInput):
    """Answers to proposals: lines of the standard input, until it ends or somebody stops the run."""

    def answer(self, move: str, refused: str) -> str | None:
        """A line, "" for yes, or another foothold; None at the end of the input or of the run: nobody says yes."""
        if refused:
            tell(refused)
        tell(f"{move}? [Enter: yes, another foothold, or Ctrl-D: stop]")
        return self.read()


def carried_out(
    request: ClimbRequest, output: WalkOutput, *, asks: bool = False, twists: TwistSource | None = None
) -> int:
    """Carry out a climb and write its folder; the exit code.

    Args:
        asks: whether every move is proposed first. twists: what drives the body in place of a file.

    Raises:
        OutputError: the folder cannot be written. What the request means that is wrong; nothing is written then.
    """
    stopper, lines = Stopper(), LimbLines() if asks else None
    doing = [""]
    title = f"{Path(request.climber.robot).stem} on {Path(request.scene.scene).stem}"
    with contextlib.ExitStack() as stack, progress_bar() as bar:
        stage = bar.add_task("preparing", total=None)

        def told(what: str, part: float | None) -> None:
            doing[0] = what
            bar.update(stage, description=what, total=None if part is None else 1.0, completed=part or 0.0)

        def compiled(controller: Controller) -> None:
            # From here on there is a log to write; a Ctrl-C before ends the command at once
            stack.enter_context(stopper.listening())
            if (begin := recording(stack, folder, output.mcap)) is not None:
                begin(controller)

        if lines is not None:
            lines.stop = stopper
        ask = None if lines is None else lines.answer
        session = ClimbSession(request, ClimbHooks(told, stopper, ask, twists, compiled))
        folder = run_folder(output.out, f"walk-{title.replace(' on ', '-')}", RUN_FILES, output.force)
        # A full collection would look at all modules of the program in the middle of a tick
        gc.collect()
        gc.freeze()
        try:
            done = session.run(folder, output.check, output.backend)
        except (NoStancesError, InfeasibleError) as error:
            write_json(folder / report.FIGURES, {"outcome": "refused", "reason": str(error)})
            show_figures(title, [("outcome", "refused")], folder, _files(folder))
            tell(error, "refused")
            return REFUSED
        except KeyboardInterrupt:
            tell(doing[0], "interrupted")
            raise
        told("writing", None)
        about = {"robot": request.climber.robot, "scene": request.scene.scene, **done.figures}
        if isinstance(request.mode, PathRequest):
            about["speed"] = request.mode.speed
        with filled(folder) as fresh:
            report.write(
                done.run, done.report, about, fresh, output.pictures and not stopper(), told, stop=stopper,
                replay=save_climb_page,
            )  # fmt: skip
    shown = report.climb_figures(done.run, done.report, about)
    show_figures(title, ((figure.label, figure.text) for figure in shown), folder, _files(folder))
    return _ended(done, stopper())


def _files(folder: Path) -> list[Path]:
    return [file for pattern in RUN_FILES for file in sorted(folder.glob(pattern))]


def checked(folder: Path) -> int:
    """Run the checker on a folder, and say how its run ended.

    Raises:
        LogFileError: no run, or one that was ended before it moved.
    """
    if not validation.exists("run", folder) or not folder.is_dir():
        raise LogFileError("run", str(folder), validation.no_such(folder, "there is no such folder"))
    found, ended = check_folder(folder)
    for finding in found.findings:
        say(finding)
    say("the run keeps all rules" if found.clean else f"{len(found.violations)} rules are violated")
    if not ended:
        tell(f"the run was ended; `wbc walk resume {folder}` goes on with it", "note")
    return 0 if found.clean else VIOLATED


def published(
    removed: RemovedFootholds, places: Sequence[str], objective: Objective, speeds: tuple[float, float], output: Where
) -> int:
    """Walk as the published planner does and write the folder; the exit code.

    Args:
        speeds: of the body [m/s], and of its turning [rad/s].

    Raises:
        What the planner raises for bad input; nothing is written then.
    """
    from wbc.published.three_arm_walker.on_request import perform_published, published_figures, save_published

    run = perform_published(less_footholds(cylinder_grid(), removed), places, objective, *speeds)
    folder = run_folder(output.out, "walk-published", PUBLISHED_FILES, output.force)
    figures = published_figures(run)
    files = [*save_published(run, folder), save_summary(figures, folder)]
    show_figures("published walker on cylinder", ((one.label, one.text) for one in figures), folder, files)
    if not run.arrived:
        tell(run.reason, "stopped")
    return 0 if run.arrived else REFUSED


def _ended(done: ClimbDone, interrupted: bool) -> int:
    """The exit code, and why the run did not do what it was to do."""
    violations = [] if done.report is None else done.report.violations
    for finding in violations:
        tell(finding, "violated")
    arrived = done.run.outcome is ClimbOutcome.ARRIVED
    if not arrived:
        tell(done.run.reason, str(done.run.outcome))
    if interrupted:
        return INTERRUPTED
    return VIOLATED if violations else 0 if arrived else REFUSED
