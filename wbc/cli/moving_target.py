"""``wbc moving-target``: a peg into a hole, or a hand onto a fixture, of an object that moves."""

from __future__ import annotations

from math import degrees, isfinite
from pathlib import Path
from typing import Annotated

import typer

from wbc.cli import options

_SCENE, _SENSE, _OUTPUT = "What it does", "What is known of the object", "What it writes"

Job = Annotated[
    str, typer.Option(help="peg: into a hole of a table. grasp: a fixture of a free body.", rich_help_panel=_SCENE)
]
Motion = Annotated[
    str,
    typer.Option(help="sea, tumble, swing (2 in at 0.1 Hz, 5 degrees at 0.05 Hz), rest.", rich_help_panel=_SCENE),
]
Runs = Annotated[int, typer.Option(help="Random trials with each knowledge.", min=1, rich_help_panel=_SCENE)]
Severity = Annotated[
    float, typer.Option(help="What the motion's heights and rates are multiplied by.", rich_help_panel=_SCENE)
]
Clearance = Annotated[float, typer.Option(help="Between peg and hole, all round, in m.", rich_help_panel=_SCENE)]
Knowledges = Annotated[
    list[str] | None,
    typer.Option(help="none, pose, twist, late, estimated; may be repeated. Default: all.", rich_help_panel=_SENSE),
]
Noise = Annotated[float, typer.Option(help="Standard deviation of measured positions, in m.", rich_help_panel=_SENSE)]
Turn = Annotated[float, typer.Option(help="The same of measured rotations, in rad.", rich_help_panel=_SENSE)]
Latency = Annotated[float, typer.Option(help="Age of a measurement when it arrives, in s.", rich_help_panel=_SENSE)]
Dropouts = Annotated[
    float, typer.Option(help="How often a second measurements stop for 0.2 s.", rich_help_panel=_SENSE)
]
Film = Annotated[bool, typer.Option(help="Whether to draw the film.", rich_help_panel=_OUTPUT)]
RunFolder = Annotated[
    Path | None,
    typer.Option(
        "--out", "--output", help="Run folder. Default: runs/moving-JOB-MOTION-TIME.", rich_help_panel=_OUTPUT
    ),
]


def moving_target(
    robot: options.RobotName = "panda",
    frame: options.FrameName = None,
    job: Job = "peg",
    motion: Motion = "sea",
    runs: Runs = 20,
    severity: Severity = 1.0,
    clearance: Clearance = 1.5e-3,
    knowledge: Knowledges = None,
    noise: Noise = 0.5e-3,
    turn: Turn = 0.5e-3,
    latency: Latency = 0.05,
    dropouts: Dropouts = 0.0,
    backend: options.Backend = "auto",
    film: Film = True,
    output: RunFolder = None,
    force: options.Force = False,
) -> None:
    """Work on an object that moves, with and without compensation, and leave figures, plots and a film.

    Ctrl-C ends the trials early; those that were done are written all the same.

    Example: [bold]wbc moving-target --motion tumble --runs 50[/bold]
    """
    import contextlib

    from rich.table import Table

    from wbc import robots, validation
    from wbc.cli.console import err, out, progress_bar
    from wbc.cli.folders import filled, run_folder
    from wbc.cli.planning import tip_frame
    from wbc.cli.session import INTERRUPTED, Stopper
    from wbc.moving_target import folder as files
    from wbc.moving_target import pictures
    from wbc.moving_target.knowledge import Knowledge, Measurement
    from wbc.moving_target.study import JOBS, MOTIONS, grasp, outcome, peg, trials
    from wbc.moving_target.trial import Trial

    validation.one_of("job", job, JOBS)
    validation.one_of("motion", motion, MOTIONS)
    kinds = [Knowledge(validation.one_of("knowledge", k, list(Knowledge))) for k in knowledge or list(Knowledge)]
    for name, value in (("noise", noise), ("turn", turn), ("latency", latency), ("dropouts", dropouts)):
        validation.scalar(name, value, low=0.0)
    validation.scalar("severity", severity, low=0.0)
    validation.scalar("clearance", clearance, low=0.0, open_low=True, unit="m")
    machine = robots.load(robot)
    tip = machine.check_frame("frame", frame) if frame else tip_frame(machine, None)
    sensor = Measurement((noise, turn), latency, dropouts=dropouts)
    if job == "peg":
        study = peg(machine, tip, motion, clearance, sensor, severity=severity)
    else:
        study = grasp(machine, tip, motion, sensor, severity=severity)
    folder = run_folder(output, f"moving-{job}-{motion}", files.WRITTEN, force)
    stopper = Stopper()
    with progress_bar() as bar, contextlib.ExitStack() as stack:
        stage = bar.add_task("compiling", total=runs * len(kinds))

        def told(kind: Knowledge, number: int, trial: Trial) -> None:
            bar.update(stage, advance=1, description=f"trial {number + 1}: {kind}")

        stack.enter_context(stopper.listening())
        done = trials(study, runs, kinds, backend=backend, told=told, stop=stopper)
        done = {kind: found for kind, found in done.items() if found}
        if not done:
            raise typer.Exit(INTERRUPTED)
        figures = {kind: outcome(kind, found) for kind, found in done.items()}
        with filled(folder) as fresh:
            written = files.save(study, done, figures, fresh)
            bar.update(stage, description="plots", total=None)
            written += pictures.plot(study, done, fresh)
        if film and not stopper():
            pair = {k: done[k][0] for k in (min(done, key=kinds.index), max(done, key=kinds.index))}
            bar.update(stage, description="film", total=1, completed=0)

            def shown(part: float) -> None:
                bar.update(stage, completed=part)

            with filled(folder) as fresh:
                drawn = pictures.film(study, pair, fresh / "film", shown, stopper)
            written += [] if drawn is None else [drawn]
    table = Table(title=f"{machine.name}, {job}, {motion}", title_justify="left", box=None, pad_edge=False)
    for head in ("the object is known by", "done", "rms mm", "largest mm", "degrees", "time s", "rate", "known to mm"):
        table.add_column(head, justify="left" if "object" in head else "right")
    for kind, found in figures.items():
        time = f"{found.time[0]:.2f}" if found.successes else "-"
        sizes = (1e3 * found.rms, 1e3 * found.worst, degrees(found.angle))
        cells = [f"{size:.3f}" if isfinite(size) else "-" for size in sizes]
        last = [time, f"{found.rate:.2f}", f"{1e3 * found.knowledge_rms:.3f}"]
        table.add_row(pictures.LABELS[kind], f"{found.successes} of {found.done}", *cells, *last)
    console = out()
    console.print(table)
    for kind, found in figures.items():
        for reason, count in found.reasons.items():
            console.print(f"{pictures.LABELS[kind]}: {count} times {reason}", highlight=False)
    console.print(f"{folder}: {', '.join(path.name for path in written)}", soft_wrap=True, highlight=False)
    if stopper():
        err().print("interrupted: the trials that were done are written")
        raise typer.Exit(INTERRUPTED)
