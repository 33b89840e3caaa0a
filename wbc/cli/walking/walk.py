"""``wbc walk``: a walk on holds, planned, carried out, checked and shown; ``wbc check`` and ``wbc plans`` read runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wbc.cli.walking import options

#: Parameters that a run which is gone on with takes; all others are its own already
RESUMED = ("resume", "to", "change", "arms", "ask", "least_time")
#: Parameters about how a walk is done and what it writes
ANYWAY = ("backend", "output", "force", "check", "strict", "pictures")


def walk(
    context: typer.Context,
    structure: options.StructureName = "",
    robot: options.RobotName = "three-armed",
    arms: options.Arms = 3,
    gait: options.Gait = "any",
    mode: options.Mode = "velocity",
    speed: options.Speed = options.SPEED,
    turn_rate: options.TurnRate = options.TURN_RATE,
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
    plant: options.PlantName = "kinematic",
    gravity: options.Gravity = "0,0,0",
    fault: options.Faults = None,
    backend: options.Backend = "auto",
    output: options.RunFolder = None,
    force: options.Force = False,
    check: options.Check = True,
    strict: options.Strict = False,
    pictures: options.Pictures = True,
    least_time: options.LeastTime = False,
) -> None:
    """Walk on a structure of holds with three arms, or end over end, and leave log, plan, check, pictures and a page.

    Ends with 3 if the walk is not possible or does not arrive, with 4 if the checker finds a violation. Ctrl-C ends it
    early; what was done until then is written all the same, and so is what a kill leaves.
    """
    from wbc.cli.console import err
    from wbc.cli.walking.modes import performance, plant_choice
    from wbc.cli.walking.run import changed_machine, new_folder, walk_free, walk_published
    from wbc.errors import RangeError
    from wbc.walking.run.request import PublishedRequest, read_request

    if strict:
        err().print("[yellow]note[/yellow]: --strict is no longer needed: a violation ends with 4 anyway")
    if resume:
        for name in _given(context) - {*RESUMED, *ANYWAY}:
            option = next(param for param in context.command.params if param.name == name).opts[0]
            reason = "a run that is gone on with keeps its own; leave it out"
            raise RangeError(option.lstrip("-"), context.params[name], reason)
        _resumed(context, resume, tuple(to or ()), ask, least_time, check or strict)
        return
    request = read_request(
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
    if planner == "published" and (change or arms != 3):
        raise RangeError("set", change, "the published planner has numbers of its own, three_arm_walker.Calibration")
    machine = changed_machine(change or [], robot == "two-ended", arms if "arms" in _given(context) else None)
    # Bad input shows before a folder is made
    if isinstance(request, PublishedRequest):
        if plant != "kinematic":
            raise RangeError(
                "plant", plant, "the published walker moves joints exactly; plants are of the planner 'free'"
            )
        if ask or least_time:
            raise RangeError("planner", planner, "asking and the least time are of the planner 'free'")
        walk_published(request, new_folder(request.site.structure, output, force))
        return
    perform = performance(request, machine, ask, least_time, plant_choice(plant, gravity, fault))
    folder = new_folder(request.site.structure, output, force)
    walk_free(perform, machine, folder, backend, check or strict, pictures)


def _given(context: typer.Context) -> set[str]:
    """Names of the parameters that the user gave."""
    return {
        name
        for name in context.params
        if (source := context.get_parameter_source(name)) is not None and source.name == "COMMANDLINE"
    }


def _resumed(
    context: typer.Context, resume: str, points: tuple[str, ...], ask: bool, least_time: bool, check: bool
) -> None:
    """Go on with a run, or begin one again that was ended before it walked."""
    from wbc.cli.walking.modes import performance
    from wbc.cli.walking.run import changed_machine, new_folder, walk_free
    from wbc.errors import RangeError
    from wbc.walking.run.resume_mode import going_on, machine_walked, plant_walked, read_resume
    from wbc.walking.torque.choice import PlantChoice

    given, of = context.params, read_resume(resume, points)
    output = given["output"]
    if output is not None and output.resolve() == Path(of.folder).resolve():
        raise RangeError("out", str(output), "this is the folder of the run that is gone on with; it needs its own")
    request = going_on(of)
    machine = machine_walked(request, Path(of.folder))
    named = _given(context)
    if "arms" in named and given["arms"] != len(machine.arms):
        raise RangeError("arms", given["arms"], f"the run has {len(machine.arms)} arms")
    if "change" in named:
        machine = changed_machine(given["change"], machine.two_ended, len(machine.arms))
    plant = PlantChoice.of_run(plant_walked(request, Path(of.folder)))
    perform = performance(request, machine, ask, least_time, plant)
    folder = new_folder("resumed", output, given["force"])
    walk_free(perform, machine, folder, given["backend"], check, given["pictures"])


def check(
    run: Annotated[Path, typer.Argument(help="Folder of a run, ended or killed.")],
) -> None:
    """Check the walk in a run's folder; exit code 4 if it violates anything."""
    from wbc.cli.walking.run import check_folder

    check_folder(run)


def plans(
    one: Annotated[Path, typer.Argument(help="A plan.json, or the folder of a run.")],
    other: Annotated[Path, typer.Argument(help="Another one.")],
) -> None:
    """Show what two plans do differently, one line each; exit code 1 if there is anything."""
    from wbc.cli.console import out
    from wbc.walking.planner.plan import differences, read_plan

    first, second = (read_plan(path / "plan.json" if path.is_dir() else path) for path in (one, other))
    lines = differences(first, second)
    for line in lines:
        out().print(line, markup=False, soft_wrap=True)
    if lines:
        raise typer.Exit(1)
    out().print(f"the same {len(first.regrasps)} re-grasps")
