"""``wbc walk``: a walk on holds, planned, carried out, checked and shown; ``wbc plans`` compares two plans."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wbc.cli.walking import options


def walk(
    structure: options.StructureName = "",
    robot: options.RobotName = "three-armed",
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
    from wbc import robots
    from wbc.cli.walking.modes import performance
    from wbc.cli.walking.run import changed_data, new_folder, walk_free, walk_published
    from wbc.errors import RangeError
    from wbc.walking.run.request import PublishedRequest, read_request

    two_ended = robot == "two-ended"
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
    if change and planner == "published":
        raise RangeError("set", change, "the published planner has numbers of its own, three_arm_walker.Calibration")
    machine = robots.walker(data=changed_data(change or [], two_ended), two_ended=two_ended)
    # Bad input shows before a folder is made
    if isinstance(request, PublishedRequest):
        if resume or ask or least_time:
            raise RangeError("planner", planner, "resuming, asking and the least time are of the planner 'free'")
        walk_published(request, new_folder(request, output, force))
        return
    perform = performance(request, machine, resume, ask, least_time, tuple(to or ()))
    folder = new_folder(request, output, force)
    walk_free(perform, machine, folder, backend, check or strict, pictures, strict)


def plans(
    one: Annotated[Path, typer.Argument(help="A plan.json.")],
    other: Annotated[Path, typer.Argument(help="Another one.")],
) -> None:
    """Show what two plans do differently, one line each; exit code 1 if there is anything."""
    from wbc.cli.console import out
    from wbc.walking.planner.plan import differences, read_plan

    first, second = (read_plan(path) for path in (one, other))
    lines = differences(first, second)
    for line in lines:
        out().print(line, markup=False, soft_wrap=True)
    if lines:
        raise typer.Exit(1)
    out().print(f"the same {len(first.regrasps)} re-grasps")
