"""Doing a plan at the terminal: progress, Ctrl-C, the run folder and the printed summary."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from rich.progress import Progress

from wbc.api import Controller
from wbc.cli.console import progress_bar, show_figures, tell
from wbc.cli.folders import filled, run_folder, with_mcap
from wbc.cli.output import RECORDED, TrackOutput
from wbc.extras import MissingPackageError
from wbc.interrupts import interrupts
from wbc.log import FORMATS, Log, save
from wbc.record.recording import Recording, RecordingError
from wbc.simulation import Plant
from wbc.track.plots import save_picture, save_plots
from wbc.track.report import conflicts, save_report
from wbc.track.run import track
from wbc.track.setup import PathRun
from wbc.track.summary import Figure, save_summary, summarise

INTERRUPTED = 130
#: Inputs of every tick, in the run folder
RECORDING = RECORDED[0]
#: Ticks between two moves of the progress bar, so that the bar costs nothing
STRIDE = 25


class Stopper:
    """Ctrl-C as a question that the loop asks between two ticks, so that no tick is cut in half."""

    def __init__(self) -> None:
        self.asked = False

    def __call__(self) -> bool:
        """Whether to stop."""
        return self.asked

    @contextlib.contextmanager
    def listening(self) -> Iterator[None]:
        """Within it the first Ctrl-C asks to stop, and the second interrupts at once."""

        def ask() -> None:
            if self.asked:
                raise KeyboardInterrupt
            self.asked = True

        with interrupts(ask):
            yield


def perform(plan: PathRun, output: TrackOutput, plant: Plant | None = None) -> int:
    """Do a plan on a plant, write its folder and print its summary; exit code 130 if Ctrl-C ended it early.

    Raises:
        WbcError: bad input; nothing is written then.
    """
    written = (*(f"log.{kind}" for kind in FORMATS), *RECORDED, "summary.json", "report.html", "replay.html")
    folder = run_folder(output.out, f"{plan.robot.name}-{plan.label}", written, output.force)
    stopper = Stopper()
    with progress_bar() as bar:
        stage = bar.add_task("compiling", total=None)

        def tell_stage(text: str) -> None:
            bar.update(stage, description=text, total=None)

        recording = folder / RECORDING if output.record or output.mcap else None

        def record(controller: Controller) -> contextlib.AbstractContextManager[object]:
            if recording is None:
                return contextlib.nullcontext()
            if output.mcap:
                return with_mcap(controller, folder)
            folder.mkdir(parents=True, exist_ok=True)
            return controller.record(recording, overwrite=True)

        log = _tracked(plan, bar, stage, stopper, record, plant)
        with stopper.listening():
            figures = summarise(log)
            with filled(folder) as fresh:
                files = [save(log, fresh, output.log), save_summary(figures, fresh)]
            files += [folder / name for name in RECORDED if (folder / name).is_file()]
            with filled(folder) as fresh:
                if output.plots:
                    files += _drawn(plan, log, fresh, tell_stage)
                files += _pages(log, figures, fresh, recording, output.plots, tell_stage)
    title = f"{plan.robot.name} follows {plan.label} with {plan.frame}"
    show_figures(title, ((figure.label, figure.text) for figure in figures), folder, files)
    for warning in start_warnings(log):
        tell(warning, "warning")
    return INTERRUPTED if log.meta["interrupted"] else 0


def _tracked(
    plan: PathRun,
    bar: Progress,
    stage: Any,
    stopper: Stopper,
    record: Callable[[Controller], contextlib.AbstractContextManager[object]],
    plant: Plant | None,
) -> Log:
    with contextlib.ExitStack() as stack:

        def compiled(controller: Controller) -> None:
            # From here on there is a log to write; a Ctrl-C while compiling ends the command at once
            stack.enter_context(stopper.listening())
            # One that cannot be written to the end says so in the log; the run is worth keeping all the same
            stack.enter_context(contextlib.suppress(RecordingError))
            stack.enter_context(record(controller))
            bar.update(stage, description=f"{plan.robot.name}: {plan.label}", total=plan.ticks)

        def progress(ticks: int) -> None:
            if ticks % STRIDE == 0 or ticks == plan.ticks:
                bar.update(stage, completed=ticks)

        return track(plan, progress, stopper, compiled, plant=plant)


def _drawn(plan: PathRun, log: Log, folder: Path, told: Callable[[str], None]) -> list[Path]:
    told("plots")
    files = save_plots(log, folder, lambda name: told(f"plots: {name}"))
    told("picture")
    picture = save_picture(log, plan.robot, folder / "overview.png")
    return files if picture is None else [*files, picture]


def _pages(
    log: Log, figures: list[Figure], folder: Path, recorded: Path | None, plots: bool, told: Callable[[str], None]
) -> list[Path]:
    """The report; with a recording also why there were conflicts, and the page that plays the run."""
    told("report")
    out: list[Path] = []
    said: dict[int, str] = {}
    if recorded is not None and len(log):
        from wbc.viewer.runs import PAGE_RATE, REPLAY, save_page, sentences_of, states_of

        recording = Recording(recorded)
        if wanted := conflicts(log):
            said = sentences_of(recording, wanted)
        if plots:
            told("replay page")
            # A run is worth keeping where what draws the page is not installed
            with contextlib.suppress(MissingPackageError):
                out.append(save_page(*states_of(recording, rate=PAGE_RATE), folder / REPLAY))
    return [*out, save_report(log, figures, folder, said)]


def start_warnings(log: Log) -> list[str]:
    """Links that are too near to an obstacle before anything has moved: nothing can be promised for such a run."""
    margin = log.meta["margin"]
    close = {link: float(gap[0]) for link, gap in log.group("clearance").items() if len(gap) and gap[0] < margin - 1e-6}
    return [
        f"at the start {link} is {1e3 * gap:.0f} mm from an obstacle, the margin is {1e3 * margin:g} mm"
        for link, gap in close.items()
    ]
