"""``wbc study``: many trials of a scenario, over parameters and seeds, on this machine or a cluster."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

_HOW, _OUTPUT = "Where it runs", "What it writes"

What = Annotated[
    str | None, typer.Argument(help="A YAML file, or a built-in scenario: reach, manipulability, layouts, ik.")
]
Seeds = Annotated[int | None, typer.Option(help="Seeds 0, 1, ... Default: the file's; of a built-in scenario 10.")]
Workers = Annotated[
    int | None, typer.Option(help="Processes of a cluster on this machine. Default: none.", rich_help_panel=_HOW)
]
Address = Annotated[
    str | None, typer.Option(help="Scheduler of a Dask cluster, as tcp://HOST:8786.", rich_help_panel=_HOW)
]
Resume = Annotated[
    Path | None, typer.Option(help="Folder of a run that was ended: goes on with it.", rich_help_panel=_HOW)
]
Out = Annotated[Path | None, typer.Option(help="Run folder. Default: runs/study-TIME.", rich_help_panel=_OUTPUT)]
Force = Annotated[bool, typer.Option("--force", help="Write into a folder that has a study.", rich_help_panel=_OUTPUT)]
AsJson = Annotated[bool, typer.Option("--json", help="Print the summary as JSON.", rich_help_panel=_OUTPUT)]

#: Exit code where a trial failed
FAILED = 1


def study(
    what: What = None,
    seeds: Seeds = None,
    workers: Workers = None,
    address: Address = None,
    resume: Resume = None,
    out: Out = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Many trials of a scenario, over parameters and seeds, on this machine or a cluster.

    Every trial is kept when it ends: after Ctrl-C, a kill or a lost worker, --resume goes on. See docs/study.md.

    Example: [bold]wbc study reach --seeds 20[/bold]
    """
    from wbc import validation
    from wbc.cli.app import INTERRUPTED
    from wbc.cli.console import err, print_json, progress_bar
    from wbc.cli.console import out as console
    from wbc.cli.folders import run_folder
    from wbc.errors import RangeError, RobotFileError
    from wbc.study import Kept, Progress, Study, carry_out
    from wbc.study.kept import FILES, STUDY
    from wbc.study.summary import conclude

    if (what is None) == (resume is None):
        raise RangeError("study", what, "expected a file, a scenario, or --resume FOLDER")
    if resume is not None:
        for option, value in (("seeds", seeds), ("out", out), ("force", force or None)):
            if value is not None:
                raise RangeError(option, value, "--resume goes on with the study of its folder as it was asked for")
        if not (resume / STUDY).is_file():
            there = validation.exists("resume", resume)
            raise RobotFileError(
                "resume",
                str(resume),
                "holds no study" if there else validation.no_such(resume, "there is no such folder"),
            )
        asked, folder = Study.read(resume / STUDY), resume
    else:
        assert what is not None
        if validation.is_file("study", what) or Path(what).suffix:
            asked = Study.read(what, seeds)
        else:
            asked = Study(scenario=what, seeds=10 if seeds is None else seeds)
        folder = run_folder(out, "study", FILES, force)
    ended = False
    with Kept(folder, asked) as kept:
        with progress_bar() as bar:
            task = bar.add_task("trials", total=asked.count)

            def tick(now: Progress) -> None:
                bar.update(task, completed=now.before + now.done)

            try:
                carry_out(kept, workers=workers, address=address, tick=tick)
            except KeyboardInterrupt:
                ended = True
        summary = conclude(kept)
    if as_json:
        print_json(summary)
    else:
        console().print(f"{summary['finished']} of {summary['trials']} trials, {summary['rows']} rows", highlight=False)
        for name, figures in summary["metrics"].items():
            console().print(f"  {name}: " + ", ".join(f"{key} {value:.6g}" for key, value in figures.items()))
        console().print(str(folder), markup=False, soft_wrap=True)
    for failure in summary["failures"]:
        err().print(f"failed: {failure}", markup=False, soft_wrap=True)
    if ended:
        err().print(f"ended early; go on with: wbc study --resume {folder}", markup=False, soft_wrap=True)
        raise typer.Exit(INTERRUPTED)
    if summary["failed"]:
        raise typer.Exit(FAILED)
